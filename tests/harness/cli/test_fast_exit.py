import argparse
import os
import subprocess
import sys
from pathlib import Path

import pytest

from wayproof.harness.cli.fast_exit import READING_VERBS, runs_only_our_code
from wayproof.harness.cli.main import main

ENVIRONMENT = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[3] / "src")}

PROCESS = """
import atexit, sys
from wayproof.harness.cli.fast_exit import FastExit

class Kept:
    def __del__(self):
        print("freed")

handler, kept = FastExit(), Kept()
atexit.register(print, "handler of a later import")
handler.code = {code}
print("x" * 100_000)
{last}
"""


def process(*words, **options):
    """Run Python in a process of its own."""
    options = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **options}
    return subprocess.run(
        [sys.executable, *words], text=True, env=ENVIRONMENT, timeout=120, **options
    )


@pytest.mark.parametrize(("code", "freed"), [(3, False), (0, False), (None, True)])
def test_output_and_other_handlers_are_kept(code, freed):
    done = process("-c", PROCESS.format(code=code, last="sys.exit(handler.code or 0)"))
    lines = done.stdout.splitlines()
    assert lines[:2] == ["x" * 100_000, "handler of a later import"]
    assert lines[2:] == (["freed"] if freed else [])
    assert (done.returncode, done.stderr) == (code or 0, "")


def test_an_error_ends_as_ever():
    done = process("-c", PROCESS.format(code=None, last="raise ValueError('broken')"))
    assert done.returncode == 1
    assert done.stderr.endswith("ValueError: broken\n")


@pytest.mark.parametrize(
    ("verb", "options", "only_ours"),
    [
        *((verb, {"allow_plugins": False}, True) for verb in READING_VERBS),
        *((verb, {"allow_plugins": True}, False) for verb in READING_VERBS),
        ("explain", {"allow_plugins": False, "stack": "mine.py:Stack"}, False),
        ("run", {"set": [], "stack": None, "robot": "drone"}, True),
        ("run", {"set": [], "stack": "exec:./mine", "robot": "drone"}, False),
        ("run", {"set": ["stack.name=mine.py:Stack"], "stack": None, "robot": "drone"}, False),
        ("run", {"set": ["planner.name=mine.py:Plan"], "stack": None, "robot": "drone"}, False),
        ("lab", {}, False),
        ("study", {}, False),
        ("view", {}, False),
    ],
)
def test_where_a_users_code_runs_all_is_finalized(verb, options, only_ours):
    assert runs_only_our_code(argparse.Namespace(verb=verb, **options)) is only_ours


def test_a_verdict_is_whole_and_has_its_exit_code(recorded, capsys):
    explain = ["explain", recorded("empty", "drone", 1).log, "3"]
    assert main(explain) == 0
    done = process("-m", "wayproof", *explain)
    assert (done.returncode, done.stdout, done.stderr) == (0, capsys.readouterr().out, "")
    for command in (explain, ["list"]):
        with open("/dev/full", "w") as full:
            done = process("-m", "wayproof", *command, stdout=full)
        assert done.returncode == 2
        assert done.stderr == "wayproof: standard output: No space left on device\n"
    read, write = os.pipe()
    os.close(read)  # a reader that went away
    done = process("-m", "wayproof", "list", stdout=write)
    os.close(write)
    assert (done.returncode, done.stderr) == (141, "")
    assert main([*explain[:-1], "100000"]) == 2
    assert "expected a decision's number" in capsys.readouterr().err
