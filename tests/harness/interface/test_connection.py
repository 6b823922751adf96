"""Connections to a stack in another process."""

import shlex
import socket
import struct
import sys
import time
from pathlib import Path

import pytest

from wayproof.harness.errors import InputError
from wayproof.harness.interface.connect import make_stack
from wayproof.harness.interface.connection import ChildProcess
from wayproof.harness.interface.incoming import NotHarness
from wayproof.harness.interface.serve import ServedStack, _listening, answer_all
from wayproof.harness.schema import stack_pb2 as sb


def framed(message):
    data = message.SerializeToString()
    return struct.pack("<I", len(data)) + data


def test_a_child_is_heard_to_its_last_line_though_threads_are_late():
    interval = sys.getswitchinterval()
    sys.setswitchinterval(60.0)
    try:
        for _ in range(5):
            child = ChildProcess("sh -c 'echo last words >&2; exit 7'")
            until = time.perf_counter() + 0.1
            while time.perf_counter() < until:  # no other thread runs while it ends
                pass
            assert child.ending() == "exit code 7"
            assert child.stderr() == "last words\n"
            child.close()
    finally:
        sys.setswitchinterval(interval)


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
            framed(sb.ToStack(hello=sb.Hello(version=1)))
            + framed(sb.ToStack(observation=sb.Observation())),
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
