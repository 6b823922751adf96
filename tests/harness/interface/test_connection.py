"""Connections to a stack in another process, and messages that wake it in time."""

import io
import shlex
import socket
import struct
import sys
import time
from pathlib import Path

import pytest

from wayproof import Config, build, open_log, override, run_episode
from wayproof.harness.errors import InputError
from wayproof.harness.interface.connect import make_stack
from wayproof.harness.interface.connection import ChildProcess
from wayproof.harness.interface.incoming import NotHarness
from wayproof.harness.interface.serve import ServedStack, _listening, answer_all
from wayproof.harness.interface.types import Command, Velocity
from wayproof.harness.replay.replay import replay
from wayproof.harness.schema import stack_pb2 as sb


def framed(*messages):
    data = [message.SerializeToString() for message in messages]
    return b"".join(struct.pack("<I", len(one)) + one for one in data)


def test_a_child_is_heard_to_its_last_line_though_threads_are_late():
    interval = sys.getswitchinterval()
    sys.setswitchinterval(60.0)
    try:
        for _ in range(3):
            child = ChildProcess("sh -c 'echo last words >&2; exit 7'")
            until = time.perf_counter() + 0.1
            while time.perf_counter() < until:  # no other thread runs while it ends
                pass
            assert child.ending() == "exit code 7"
            assert child.stderr() == "last words\n"
            child.close()
    finally:
        sys.setswitchinterval(interval)
    killed = ChildProcess("sh -c 'kill -9 $$'")
    assert killed.ending() == "signal SIGKILL"
    killed.close()


ESCAPES = """
import os, sys, time
if os.fork() == 0:
    os.setsid()
    if os.fork() == 0:
        for descriptor in range(3):
            os.close(descriptor)
        open(sys.argv[1], "w").write(str(os.getpid()))
        time.sleep(600)
    os._exit(0)
while not os.path.exists(sys.argv[1]) or not open(sys.argv[1]).read():
    time.sleep(0.01)
if sys.argv[2] == "waits":
    sys.stdin.read()
"""


@pytest.mark.skipif(sys.platform != "linux", reason="a keeper is of Linux")
@pytest.mark.parametrize("then", ["waits", "ends"])
def test_a_grandchild_that_left_the_session_ends_with_the_child(tmp_path, then):
    mark = tmp_path / "pid"
    child = ChildProcess(shlex.join([sys.executable, "-c", ESCAPES, str(mark), then]))
    until = time.monotonic() + 60.0
    while not (mark.exists() and mark.read_text()):
        assert time.monotonic() < until
        time.sleep(0.01)
    child.close()
    assert not Path(f"/proc/{mark.read_text()}").exists()


@pytest.mark.parametrize(
    ("sent", "said"),
    [
        (struct.pack("<I", 2_000_000_000), "a message of 2000000000 bytes, expected 67108864"),
        (struct.pack("<I", 8) + b"\xff" * 8, "8 bytes that are no message"),
        (struct.pack("<I", 4) + b"\0", "got 1 of 4 bytes in time"),
        (framed(sb.ToStack(observation=sb.Observation())), "got observation, expected hello"),
        (
            framed(sb.ToStack(hello=sb.Hello(version=1)), sb.ToStack(observation=sb.Observation())),
            "got an observation, expected the task before it",
        ),
        (b"", "got 0 of 4 bytes in time"),
    ],
)
def test_who_is_no_harness_is_hung_up_on(monkeypatch, sent, said):
    monkeypatch.setattr("wayproof.harness.interface.incoming.MESSAGE_S", 0.2)
    ours, theirs = socket.socketpair()
    with ours, theirs, theirs.makefile("wb") as write:
        ours.sendall(sent)
        with pytest.raises(NotHarness, match=said):
            answer_all(ServedStack(make_stack("gap"), "gap"), theirs.fileno(), write, 0.2, 0.2)


def test_an_address_without_a_host_is_this_machine():
    with _listening("tcp::0") as server:
        assert server.getsockname()[0] == "127.0.0.1"
    with pytest.raises(InputError, match="expected unix:PATH or tcp:HOST:PORT"):
        _listening("tcp::99999")


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
