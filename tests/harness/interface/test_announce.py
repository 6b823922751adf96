"""An empty message before each observation, for stacks that wish it, wakes them in time."""

import io
import shlex
import struct
import sys

import pytest

from wayproof import Config, build, open_log, override, run_episode
from wayproof.harness.interface.serve import ServedStack, answer_all
from wayproof.harness.interface.types import Command, Velocity
from wayproof.harness.replay.replay import replay
from wayproof.harness.schema import stack_pb2 as sb

PEER = '''"""A stack that notes the length of each message that it gets."""
import os
import struct
import sys

from wayproof.harness.schema import stack_pb2 as sb

read, write = os.fdopen(0, "rb"), os.fdopen(1, "wb")


def answer(**kind):
    data = sb.FromStack(**kind).SerializeToString()
    write.write(struct.pack("<I", len(data)) + data)
    write.flush()


lengths = []
while head := read.read(4):
    message = sb.ToStack.FromString(read.read(*struct.unpack("<I", head)))
    lengths.append(f"{message.WhichOneof('kind')}")
    if message.HasField("hello"):
        answer(hello=sb.Hello(version=1, name="peer", announced=sys.argv[1] == "yes"))
    elif message.HasField("observation"):
        motion = sb.Velocity(duration_s=0.5)
        answer(command=sb.Command(sequence=message.observation.sequence, velocity=motion))
    elif message.HasField("close"):
        break
open(sys.argv[2], "w").write(" ".join(lengths))
'''


@pytest.mark.parametrize("wish", ["yes", "no"])
def test_only_a_stack_that_wishes_it_gets_an_empty_message_before_each_observation(tmp_path, wish):
    script, notes = tmp_path / "peer.py", tmp_path / "notes"
    script.write_text(PEER)
    stack = "exec:" + shlex.join([sys.executable, str(script), wish, str(notes)])
    settings = [f"stack.name={stack}", "episode.time_limit=0.5"]
    config = override(Config("cylinders", "quadruped", 1), settings)
    run_episode(build(config), tmp_path / "a.mcap")
    kinds = notes.read_text().split()
    steps = kinds.count("observation")
    assert steps == sum(1 for _ in open_log(tmp_path / "a.mcap").records())
    each = ["None", "observation"] if wish == "yes" else ["observation"]
    assert kinds == ["hello", "task", *each * steps, "close"]
    assert replay(tmp_path / "a.mcap").identical


class Counts:
    """Stack that counts its steps."""

    steps = 0

    def start(self, task):
        pass

    def step(self, observation):
        self.steps += 1
        return Command(Velocity(0.0))

    def close(self):
        pass


def framed(*messages):
    data = [message.SerializeToString() for message in messages]
    return b"".join(struct.pack("<I", len(one)) + one for one in data)


@pytest.mark.parametrize("kept", [None, 3, 4, 6])  # whole; an end within a length, after it, within
def test_an_announcement_without_an_observation_is_no_step(tmp_path, kept):
    data = framed(sb.ToStack(hello=sb.Hello(version=1)), sb.ToStack(), sb.ToStack())
    ending = framed(sb.ToStack(close=sb.Close()))
    (tmp_path / "input").write_bytes(data + ending[:kept])
    stack, written = Counts(), io.BytesIO()
    with open(tmp_path / "input", "rb", buffering=0) as read:
        answer_all(ServedStack(stack, "counts"), read.fileno(), written)
    assert stack.steps == 0
    assert sb.FromStack.FromString(written.getvalue()[4:]).hello.announced
