"""A small stack on the wire, which stands, or breaks in one way: `python peer.py HOW [NOTES]`.

It asks for announcements if HOW is `announced`, and notes in a file the kind of each message.
"""

import os
import struct
import sys
import time

from wayproof.harness.schema import stack_pb2 as sb


def answer(**kind):
    data = sb.FromStack(**kind).SerializeToString()
    write.write(struct.pack("<I", len(data)) + data)
    write.flush()


how, *notes = sys.argv[1:]
read, write = os.fdopen(0, "rb"), os.fdopen(1, "wb")
kinds = []
while head := read.read(4):
    message = sb.ToStack.FromString(read.read(*struct.unpack("<I", head)))
    kinds.append(f"{message.WhichOneof('kind')}")
    if message.HasField("hello"):
        answer(hello=sb.Hello(version=1, name="peer", announced=how == "announced"))
    elif message.HasField("observation"):
        if how == "floods":
            print("x" * 100_000, file=sys.stderr)
        if message.observation.sequence == 3:
            if how == "dies":
                print("segmentation fault, more or less", file=sys.stderr, flush=True)
                os._exit(7)
            time.sleep(1000.0 if how == "hangs" else 0.0)
        motion = sb.Velocity(duration_s=0.5)
        answer(command=sb.Command(sequence=message.observation.sequence, velocity=motion))
    elif message.HasField("close"):
        break
for name in notes:
    with open(name, "w") as file:
        file.write(" ".join(kinds))
