"""The C++ compiler of this machine."""

import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[3]
FLAGS = ["-O2", "-std=c++17", "-Wall", "-Wextra", "-Werror"]


def compiler():
    """The command of a C++ compiler, in words.

    `$CXX`, one on the path, or the one of the package `ziglang`, which the extra `dev` has.
    """
    if given := shlex.split(os.environ.get("CXX", "")):
        return given
    if found := next(filter(shutil.which, ("c++", "g++", "clang++")), None):
        return [found]
    return [sys.executable, "-m", "ziglang", "c++"]


def compile_cpp(source, program, *flags):
    """Compile a stack that includes the header of the example; later flags win."""
    words = [
        *compiler(),
        *FLAGS,
        *flags,
        f"-I{ROOT / 'examples/cpp'}",
        "-o",
        str(program),
        str(source),
    ]
    ended = subprocess.run(words, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr
    return program
