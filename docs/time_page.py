"""Type the blocks of a page as they stand, in a fresh folder, and tell how long each line took.

Usage: python docs/time_page.py docs/get-started.md

`wayproof` has to be on the search path.
"""

import os
import re
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

BLOCK = re.compile(r"^```sh(?: exit=\d)?\n(.*?)^```", re.MULTILINE | re.DOTALL)
HERE = re.compile(r"(cat > \S+ <<'END'\n.*?^END\n)", re.MULTILINE | re.DOTALL)


def main(page: Path) -> None:
    """Run every line of every block; a row for each."""
    blocks = BLOCK.findall(page.read_text())
    print(f"| typed | exit | s | processor s |\n|---|---|---|---|    load {os.getloadavg()[0]:.0f}")
    with tempfile.TemporaryDirectory() as folder:
        for part in (part for block in blocks for part in HERE.split(block)):
            for line in [part] if part.startswith("cat >") else part.splitlines():
                row(line, folder)


def row(line: str, folder: str) -> None:
    """Run one line, and tell."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    began = time.perf_counter()
    ended = subprocess.run(["bash", "-c", line], cwd=folder, capture_output=True, check=False)
    wall = time.perf_counter() - began
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    told = line.splitlines()[0]
    print(f"| `{told}` | {ended.returncode} | {wall:.1f} | {used:.1f} |", flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
