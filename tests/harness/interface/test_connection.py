"""Connections to a stack in another process, and what is a message on them and what is none."""

import io
import shlex
import socket
import struct
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from wayproof import Config, build, open_log, override, run_episode
from wayproof.harness.errors import InputError
from wayproof.harness.interface.command_messages import (
    CommandError,
    check_command,
    command_message,
    costmap_of,
)
from wayproof.harness.interface.connect import make_stack
from wayproof.harness.interface.connection import ChildProcess
from wayproof.harness.interface.incoming import NotHarness
from wayproof.harness.interface.serve import ServedStack, _listening, answer_all
from wayproof.harness.interface.types import Command, Grid, Velocity, Waypoints
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


PEER = Path(__file__).with_name("peer.py")


@pytest.mark.parametrize("wish", ["announced", "not"])
def test_only_a_stack_that_wishes_it_gets_an_empty_message_before_each_observation(tmp_path, wish):
    notes = tmp_path / "notes"
    stack = "exec:" + shlex.join([sys.executable, str(PEER), wish, str(notes)])
    settings = [f"stack.name={stack}", "episode.time_limit=0.5"]
    config = override(Config("cylinders", "quadruped", 1), settings)
    run_episode(build(config), tmp_path / "a.mcap")
    kinds = notes.read_text().split()
    steps = kinds.count("observation")
    assert steps == sum(1 for _ in open_log(tmp_path / "a.mcap").records())
    each = ["None", "observation"] if wish == "announced" else ["observation"]
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


CELLS = np.array([[0, 50, 100], [-1, 99, 1]], np.int8)


def test_a_costmap_comes_back_as_it_was():
    message = command_message(Command(costmap=Grid(np.array([-1.0, 2.0]), 0.05, CELLS)), 3)
    grid = costmap_of(sb.Command.FromString(message.SerializeToString()))
    assert (grid.origin.tolist(), grid.resolution) == ([-1.0, 2.0], 0.05)
    assert grid.cells.tolist() == CELLS.tolist()
    assert costmap_of(command_message(Command(), 3)) is None


def of_grid(origin=(0.0, 0.0), resolution=0.1, cells=CELLS):
    return Command(costmap=Grid(np.array(origin), resolution, cells))


@pytest.mark.parametrize(
    ("command", "line"),
    [
        (of_grid((0.0, np.nan)), "costmap: expected an origin within 10000 m"),
        (of_grid((np.inf, 0.0)), "costmap: expected an origin within 10000 m"),
        (of_grid(np.zeros(3)), "costmap.origin: got 3 numbers"),
        (of_grid(resolution=np.nan), "a resolution above 0 m"),
        (of_grid(resolution=0.0), "a resolution above 0 m"),
        (of_grid(cells=CELLS.astype(float)), r"shape \(2, 3\), float64, expected \(ny, nx\) int8"),
        (of_grid(cells=CELLS[0]), r"shape \(3,\), int8, expected \(ny, nx\) int8"),
        (Command(Velocity(np.array([0.3]))), r"velocity.forward: got an array of shape \(1,\)"),
        (Command(Velocity("fast")), "velocity.forward: got str, expected a number"),
        (Command(scalars={"a": None}), r"scalars\['a'\]: got NoneType, expected a number"),
        (Command(Waypoints(np.zeros((1, 3)), [1.0])), "waypoints.speed: got list"),
    ],
)
def test_what_is_no_command_is_named(command, line):
    with pytest.raises(CommandError, match=line):
        command_message(command, 0)


def test_a_costmap_of_another_process_has_as_many_cells_as_it_says():
    grid = sb.Grid(resolution=0.1, width=2, height=2, cells=b"123")
    with pytest.raises(CommandError, match="got 3 cells for 2 x 2"):
        check_command(sb.Command(costmap=grid))
