"""`python -m tests.tools.soak.forge`: detection of forged logs.

Prints a table in Markdown; exit code 1 if a forged log is verified, except for mere claims.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from tests.tools.soak.forgeries import CLAIMS, EDITS, forge
from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.replay.verify import Step, verify
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build

SETTINGS = ("episode.time_limit=1.2", 'perturbation={"kind": "pose_drift", "severity": 5}')
"""Settings of the episode: perturbed and failing, which gives most to forge."""

NOTICED_BY: dict[Step | None, str] = {
    "content": "`score`, `explain`, `audit`, `report`, `view`, `replay`",
    "replay": "`replay`",
    "simulation": "`replay simulate`",
    None: "a signature alone",
}
"""Step of `verify` that detects an edit -> verbs that detect it as well."""


def main() -> int:
    """Forge and verify a log in every way, and print the table."""
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
