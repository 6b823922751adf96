"""Programs that the docs call: each returns its exit code and its output."""

import contextlib
import importlib.util
import io
import os
import re
import subprocess
import sys
from pathlib import Path

from tests.harness.interface.cpp import compiler
from wayproof.harness.cli.main import main

ROOT = Path(__file__).parents[2]
PYTHONPATH = os.pathsep.join((str(ROOT / "src"), str(ROOT)))
FOUND = {**os.environ, "PYTHONPATH": PYTHONPATH, "COLUMNS": "80"}
TARGETS = re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)


def make_folders(words):
    """Make folders as `mkdir -p` does."""
    assert words[0] == "-p", words
    for name in words[1:]:
        Path(name).mkdir(parents=True, exist_ok=True)
    return 0, ""


def dry_run(words):
    """Run make without its commands; check that the modules in them exist."""
    ended = subprocess.run(
        ["make", "-n", *words], cwd=ROOT, capture_output=True, text=True, check=False
    )
    modules = re.findall(r"python -m (\S+)", ended.stdout)
    missing = [name for name in modules if importlib.util.find_spec(name) is None]
    assert not missing, f"make {words}: no module {missing}"
    return ended.returncode, ended.stdout + ended.stderr


def compile_here(words):
    """Compile C++ by this machine's compiler, or by the one of `ziglang`."""
    ended = subprocess.run([*compiler(), *words], capture_output=True, text=True, check=False)
    return ended.returncode, ended.stdout + ended.stderr


def run_here(words):
    """Run wayproof in this process; return its exit code and output."""
    output = io.StringIO()
    with contextlib.redirect_stdout(output), contextlib.redirect_stderr(output):
        code = main(words)
    return code, output.getvalue()


def run_command(words):
    """Run wayproof in a process of its own; return its exit code and output."""
    return run_python(["-m", "wayproof", *words])


def run_python(words):
    """Run Python in a process of its own; return its exit code and output."""
    ended = subprocess.run(
        [sys.executable, *words], env=FOUND, capture_output=True, text=True, check=False
    )
    return ended.returncode, ended.stdout + ended.stderr
