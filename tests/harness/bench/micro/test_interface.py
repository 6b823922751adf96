import json

import pytest

from wayproof.harness.bench.micro import interface
from wayproof.harness.cli.main import main


def test_the_overhead_is_what_the_process_adds(capsys, monkeypatch):
    monkeypatch.setattr(interface, "EPISODE_S", 2.0)
    monkeypatch.setattr(interface, "WORLD", "empty")
    monkeypatch.setattr(interface, "LIDARS", ("own",))
    assert main(["bench", "interface", "--repeats", "1", "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)["rows"]
    assert row["beams"] == 20_000
    assert row["steps"] == 16
    assert 0.0 < row["in_process_ms_p50"] < row["exec_ms_p50"]
    for name in ("p50", "p99"):
        difference = row[f"exec_ms_{name}"] - row[f"in_process_ms_{name}"]
        assert row[f"overhead_ms_{name}"] == pytest.approx(difference)
