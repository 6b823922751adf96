"""`python -m wayproof.harness.bench.soak.forge`: a short log forged in every way, and who notices.

Prints a table in Markdown; the exit code is 1 if a forged log that is no mere claim is verified.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from wayproof.harness.bench.soak.forgeries import CLAIMS, EDITS, forge
from wayproof.harness.config import Config, override
from wayproof.harness.replay.verify import Step, verify
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build

SETTINGS = ("episode.time_limit=1.2", 'perturbation={"kind": "pose_drift", "severity": 5}')
"""Of the episode: it is perturbed, and it fails, so that there is most to forge."""

NOTICED_BY: dict[Step | None, str] = {
    "content": "`score`, `explain`, `audit`, `report`, `view`, `replay`",
    "replay": "`replay`",
    "simulation": "`replay --closed-loop`",
    None: "a signature alone",
}
"""What notices it beside `verify`, by the step of `verify` that found it."""


def main() -> int:
    """Forge and verify, and print the table."""
    passed = []
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "source.mcap"
        run_episode(build(override(Config("empty", "drone", 1), SETTINGS)), source)
        assert verify(source).verified, "the untouched log is not verified"
        print("| edited | noticed by | first place named |\n|---|---|---|")
        for name in EDITS:
            found = verify(forge(source, name, Path(folder) / "forged.mcap"))
            place = f"`{found.findings[0].field}`" if found.findings else ""
            print(f"| {name} | {NOTICED_BY[found.failed]} | {place} |", flush=True)
            if found.verified and name not in CLAIMS:
                passed.append(name)
    print(f"\n{len(EDITS)} edits, {len(CLAIMS)} of them claims; verified by mistake: {passed}")
    return 1 if passed else 0


if __name__ == "__main__":
    sys.exit(main())
