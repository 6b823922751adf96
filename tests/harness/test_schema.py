"""The schema is a contract: reproducible, numbered for good, and old logs still open."""

import subprocess
import sys
from pathlib import Path

import pytest

from harness.errors import InputError
from harness.evidence.replay import replay
from harness.logs import field_numbers
from harness.logs.log import FORMAT_VERSION, PACKED_FORMAT_VERSION
from harness.logs.reader import open_log
from harness.logs.small_log import COMMITTED, committed_name

ROOT = Path(__file__).parents[2]
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
    assert new == [], "run: python -m harness.logs.field_numbers"


def test_a_number_that_is_given_again_is_found():
    table = {"Point": {"1": "double x", "2": "double y"}}
    again = {"Point": {"1": "double x", "2": "float y"}}
    assert field_numbers.changed(table, again) == ["Point 2: was 'double y', is 'float y'"]
    assert field_numbers.changed(table, {"Point": {"1": "double x"}}) == []
    assert field_numbers.added(table, {"Point": {"3": "double z"}}) == ["Point 3: double z"]


def test_the_committed_log_of_this_version_replays():
    """If decisions changed on purpose: python -m harness.logs.small_log writes it anew."""
    path = COMMITTED / committed_name()
    assert path.stat().st_size < 150_000
    again = replay(path)
    assert again.identical, again.differences


@pytest.mark.parametrize("path", sorted(COMMITTED.glob("*.mcap")), ids=lambda path: path.stem)
def test_a_committed_log_opens_or_says_why_not(path):
    version = path.stem.removeprefix("format-")
    if version not in (FORMAT_VERSION, PACKED_FORMAT_VERSION):
        with pytest.raises(InputError, match=f"version {version}, expected 3 or 4$"):
            open_log(path)
        return
    log = open_log(path)
    assert log.run["format_version"] == version
    assert log.record == ("decisions" if version == PACKED_FORMAT_VERSION else "full")
    decisions = list(log.decisions())
    assert len(decisions) == int(log.result["decisions"])
    assert decisions[-1].chain == log.result["chain"]
    for decision in decisions:
        assert len(decision.trajectory.path) >= 1
        assert len(decision.trajectory.arc_length) == len(decision.trajectory.heading) >= 1
        assert not decision.HasField("packed")
    if log.record == "full":
        assert sum(1 for _ in log.records()) == len(decisions)
