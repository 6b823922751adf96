"""A stack in a process of its own that sends garbage on its standard output, from one decision on.

`python -m tests.tools.faults.garbage_stack`; the seed of the task chooses what.
"""

from __future__ import annotations

import random
import struct
import sys

from wayproof.harness.schema import stack_pb2 as sb


def garbage(seed: int, sequence: int) -> bytes:
    """Return bytes in place of the command that answers an observation."""
    rng = random.Random(seed)
    answer = sb.FromStack(command=sb.Command(sequence=sequence + 1))
    answer.command.velocity.forward = 0.2
    greeting = sb.FromStack(hello=sb.Hello(version=1, name="again"))
    return (
        b"[INFO] [planner]: planning took 12 ms\n",
        framed(rng.randbytes(200)),
        framed(answer.SerializeToString()),
        framed(greeting.SerializeToString()),
        framed(b""),
        rng.randbytes(4096),
    )[seed % 6]


def framed(data: bytes) -> bytes:
    """Return a message after its length."""
    return struct.pack("<I", len(data)) + data


def main() -> None:
    """Answer as it should be until the fault begins."""
    seed, begins = 0, 0
    while len(head := sys.stdin.buffer.read(4)) == 4:
        data = sys.stdin.buffer.read(struct.unpack("<I", head)[0])
        message = sb.ToStack.FromString(data)
        kind = message.WhichOneof("kind")
        if kind == "close":
            break
        if kind == "task":
            seed = message.task.seed
            begins = random.Random(seed).randrange(3, 13)
            continue
        answer = sb.FromStack()
        if kind == "hello":
            answer.hello.version, answer.hello.name = 1, "garbage"
        else:
            answer.command.sequence = sequence = message.observation.sequence
            answer.command.velocity.forward = 0.2
            answer.command.velocity.duration_s = 0.5
            if sequence >= begins:
                sys.stdout.buffer.write(garbage(seed, sequence))
                sys.stdout.buffer.flush()
                continue
        sys.stdout.buffer.write(framed(answer.SerializeToString()))
        sys.stdout.buffer.flush()


if __name__ == "__main__":
    main()
