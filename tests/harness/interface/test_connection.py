"""Connections to a stack in another process."""

import sys
import time

from wayproof.harness.interface.connection import ChildProcess


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
