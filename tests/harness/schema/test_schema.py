"""The schema of logs: reproducible, with fixed numbers, and old logs open."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.tools import field_numbers
from tests.tools.small_log import COMMITTED, committed_name
from wayproof.harness.cli.main import main
from wayproof.harness.errors import InputError
from wayproof.harness.log import writer as log
from wayproof.harness.log.copy import thin
from wayproof.harness.log.reader import open_log
from wayproof.harness.log.writer import WITH_REASONS
from wayproof.harness.metrics import score
from wayproof.harness.replay.audit import audit
from wayproof.harness.replay.fork import fork
from wayproof.harness.replay.replay import replay
from wayproof.harness.trace import read_trace

ROOT = Path(__file__).parents[3]
PROTO = "harness/schema/wayproof.proto"


def test_the_generated_code_is_that_of_the_schema(tmp_path):
    outputs = [f"--python_out={tmp_path}", f"--pyi_out={tmp_path}"]
    command = [sys.executable, "-m", "grpc_tools.protoc", "--proto_path=.", *outputs, PROTO]
    subprocess.run(command, cwd=ROOT, check=True)
    for name in ("wayproof_pb2.py", "wayproof_pb2.pyi"):
        generated = (tmp_path / "harness/schema" / name).read_text()
        assert (ROOT / "harness/schema" / name).read_text() == generated, "run: make schema"


def test_no_field_number_changed_its_meaning():
    assert field_numbers.changed(field_numbers.committed(), field_numbers.current()) == []


def test_every_field_number_is_in_the_table():
    new = field_numbers.added(field_numbers.committed(), field_numbers.current())
    assert new == [], "run: python -m tests.tools.field_numbers"


def test_a_reused_number_is_found():
    table = {"Point": {"1": "double x", "2": "double y"}}
    again = {"Point": {"1": "double x", "2": "float y"}}
    assert field_numbers.changed(table, again) == ["Point 2: was 'double y', is 'float y'"]
    assert field_numbers.changed(table, {"Point": {"1": "double x"}}) == []
    assert field_numbers.added(table, {"Point": {"3": "double z"}}) == ["Point 3: double z"]


def test_the_committed_log_of_this_version_replays():
    """After a deliberate change: python -m tests.tools.small_log"""
    path = COMMITTED / committed_name()
    assert path.stat().st_size < 150_000
    again = replay(path)
    assert again.identical, again.differences


@pytest.mark.parametrize("path", sorted(COMMITTED.glob("*.mcap")), ids=lambda path: path.stem)
def test_every_committed_log_opens(path):
    version, *packed = path.stem.removeprefix("format-").split("-")
    opened = open_log(path)
    assert opened.run["format_version"] == version
    assert opened.record == ("decisions" if packed or version == "4" else "full")
    assert bool(opened.not_compared) == (version not in WITH_REASONS)
    decisions = list(opened.decisions())
    assert len(decisions) == int(opened.result["decisions"])
    assert decisions[-1].chain == opened.result["chain"]
    for decision in decisions:
        assert len(decision.trajectory.path) >= 1
        assert len(decision.trajectory.arc_length) == len(decision.trajectory.heading) >= 1
        assert not decision.HasField("packed")
        assert decision.HasField("predicate") == (version in WITH_REASONS)
    if opened.record == "full":
        assert sum(1 for _ in opened.records()) == len(decisions)


def test_a_format_that_is_not_known_is_one_line(tmp_path, monkeypatch):
    monkeypatch.setattr(log, "FORMAT_VERSION", "99")
    with log.LogWriter(tmp_path / "later.mcap", b"{}", b"{}", "<mujoco/>") as writer:
        writer.finish({"outcome": "success", "chain": ""})
    with pytest.raises(InputError, match=r"format version 99, expected 2 to 6$"):
        open_log(tmp_path / "later.mcap")


def test_an_old_log_is_compared_except_fields_that_changed_meaning(capsys):
    """Its trajectories are those of this version, its actions and reasons are not."""
    path = COMMITTED / committed_name("3")
    again = replay(path)
    assert again.identical, again.differences
    assert again.not_compared == ("action", "reason", "label", "predicate", "chain")
    assert main(["replay", str(path)]) == 0
    out = capsys.readouterr().out
    assert "reason, label, predicate, chain not compared: an older format" in out
    found = audit(path)
    assert (found.violations, found.reasons, found.decisions) == ((), 0, again.decisions)
    metrics = score(read_trace(open_log(path)))
    assert (metrics["explorations"], metrics["stops"]) == (None, None)
    with pytest.raises(InputError, match="format version 3, expected 6, whose chain a fork"):
        fork(path, 2, [], path.with_name("fork.mcap"))


def test_a_copy_of_an_old_log_keeps_its_format(tmp_path):
    path = tmp_path / "old.mcap"
    path.write_bytes((COMMITTED / committed_name("3")).read_bytes())
    thin(path)
    assert open_log(path).run["format_version"] == "4"
    assert list(open_log(path).decisions())[-1].chain == open_log(path).result["chain"]
