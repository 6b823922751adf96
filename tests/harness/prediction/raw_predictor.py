"""A predictor of no library of ours: messages by hand, as any language would write them."""

import importlib.util
import os
import struct
import sys
import time
from pathlib import Path


def load(folder):
    """The module that `protoc --python_out` made of `stack.proto` in a folder."""
    spec = importlib.util.spec_from_file_location("stack_pb2", Path(folder) / "stack_pb2.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def main(folder, kind):
    sb = load(folder)
    read, write = sys.stdin.buffer, sys.stdout.buffer

    def send(message):
        data = message.SerializeToString()
        write.write(struct.pack("<I", len(data)) + data)
        write.flush()

    while head := read.read(4):
        message = sb.ToStack.FromString(read.read(*struct.unpack("<I", head)))
        what = message.WhichOneof("kind")
        if what == "hello":
            send(sb.FromStack(hello=sb.Hello(version=1, name="raw", role=message.hello.role)))
        elif what == "close":
            break
        elif what == "map_box":
            if message.map_box.sequence == 3 and kind == "dies":
                print("segmentation fault, more or less", file=sys.stderr, flush=True)
                os._exit(7)
            if message.map_box.sequence == 3 and kind == "hangs":
                time.sleep(1000.0)
            nx, ny, nz = message.map_box.shape
            answer = sb.Prediction(sequence=message.map_box.sequence)
            if kind == "outside":
                answer.offset.extend([1, 0, 0])
                answer.shape.extend([nx, 2, 2])
                answer.log_odds = bytes(4 * nx)
            elif kind == "short":
                answer.log_odds = bytes(7)
            elif kind == "other":
                answer.sequence += 1
            else:  # the upper half of the box is occupied
                answer.offset.extend([0, 0, nz // 2])
                answer.shape.extend([nx, ny, nz - nz // 2])
                answer.log_odds = bytes([40]) * (nx * ny * (nz - nz // 2))
            send(sb.FromStack(prediction=answer))


main(*sys.argv[1:])
