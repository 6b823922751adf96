"""Run the `sh` blocks of a page in a fresh folder, and time each command.

Usage: python docs/time_page.py docs/get-started.md

`wayproof` has to be on the search path.
"""

import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from blocks import blocks, commands


def main(page: Path) -> None:
    """Run every command of every block; a row for each."""
    print(
        f"| command | exit | s | processor s |\n|---|---|---|---|    load {os.getloadavg()[0]:.0f}"
    )
    with tempfile.TemporaryDirectory() as folder:
        for block in blocks(page.read_text()):
            for command in commands(block) if block.kind == "sh" else ():
                if command.startswith("export "):  # holds for the commands after it
                    os.environ.update([command.split()[1].split("=", 1)])
                else:
                    row(command, folder)


def row(command: str, folder: str) -> None:
    """Run one command and print its row."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    began = time.perf_counter()
    ended = subprocess.run(["bash", "-c", command], cwd=folder, capture_output=True, check=False)
    wall = time.perf_counter() - began
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    shown = command.splitlines()[0]
    print(f"| `{shown}` | {ended.returncode} | {wall:.1f} | {used:.1f} |", flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
