"""The schema of logs: reproducible, and with fixed numbers."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.tools.small_log import COMMITTED
from wayproof.harness.errors import InputError
from wayproof.harness.log import writer as log
from wayproof.harness.log.reader import open_log
from wayproof.harness.replay.replay import replay

ROOT = Path(__file__).parents[3]
PROTO = "harness/schema/wayproof.proto"


def test_the_generated_code_is_that_of_the_schema(tmp_path):
    outputs = [f"--python_out={tmp_path}", f"--pyi_out={tmp_path}"]
    command = [sys.executable, "-m", "grpc_tools.protoc", "--proto_path=.", *outputs, PROTO]
    subprocess.run(command, cwd=ROOT, check=True)
    for name in ("wayproof_pb2.py", "wayproof_pb2.pyi"):
        generated = (tmp_path / "harness/schema" / name).read_text()
        assert (ROOT / "harness/schema" / name).read_text() == generated, "run: make schema"


def test_the_committed_log_replays():
    """After a deliberate change: python -m tests.tools.small_log"""
    assert COMMITTED.stat().st_size < 150_000
    again = replay(COMMITTED)
    assert again.identical, again.differences


def test_a_format_that_is_not_known_is_one_line(tmp_path, monkeypatch):
    monkeypatch.setattr(log, "FORMAT_VERSION", "99")
    with log.LogWriter(tmp_path / "later.mcap", b"{}", b"{}", "<mujoco/>") as writer:
        writer.finish({"outcome": "success", "chain": ""})
    with pytest.raises(InputError, match=r"format version 99, expected 7$"):
        open_log(tmp_path / "later.mcap")
