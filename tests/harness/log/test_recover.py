"""Logs that are cut short: recovery of the readable part, and a disk that fills."""

import contextlib
import io
import json
import resource
import signal

import pytest

from tests.harness.log.conftest import damaged
from tests.tools.soak.child import in_child
from wayproof.harness.cli.main import main
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log
from wayproof.harness.log.recover import recover
from wayproof.harness.replay.audit import audit
from wayproof.harness.replay.replay import replay


@pytest.mark.parametrize("share", [0.6, 0.95, 0.999])
def test_complete_decisions_before_a_cut_are_recovered(source, tmp_path, share):
    data = source.read_bytes()
    path = damaged(tmp_path, data[: int(share * len(data))])
    path = path.rename(tmp_path / "cut.mcap.partial")
    out = tmp_path / "whole.mcap"
    before = [one.chain for one in open_log(source).decisions()]
    if share < 0.7:  # the one chunk is not whole
        with pytest.raises(InputError, match="no whole decision in it"):
            recover(path, out)
        return
    recover(path, out)
    log = open_log(out)
    assert log.result["outcome"] == "error"
    assert log.result["reason"].startswith("recovered: truncated")
    chains = [one.chain for one in log.decisions()]
    assert chains == before[: len(chains)]
    assert replay(out).identical
    assert audit(out).violations == ()


def test_recover_on_the_command_line(source, tmp_path, capsys):
    path = damaged(tmp_path, source.read_bytes()[:-100])
    out = tmp_path / "out.mcap"
    assert main(["export", str(path), "--log", str(out), "--json"]) == 0
    [document] = json.loads(capsys.readouterr().out)["files"]
    assert document["decisions"] == 6
    assert document["damage"].startswith("truncated")
    assert main(["replay", str(out)]) == 0
    partial = path.rename(tmp_path / "a.mcap.partial")
    assert main(["export", str(partial), "--log", str(tmp_path / "a.mcap")]) == 0
    assert (tmp_path / "a.mcap").read_bytes() == out.read_bytes()
    assert (tmp_path / "a.mcap.partial.ended").is_file()
    assert main(["export", str(tmp_path / "none.mcap"), "--log", str(tmp_path / "x.mcap")]) == 2
    assert "no such file" in capsys.readouterr().err


def test_a_full_disk_ends_in_a_line_and_a_readable_log(recorded, tmp_path):
    """A limit on the file's size stands for the disk: a write fails in the middle of a chunk."""
    recorded("empty", "drone", 1)  # compiles everything, which writes files of its own
    path = tmp_path / "a.mcap"

    def work(report):
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (250_000, 250_000))
        with contextlib.redirect_stderr(io.StringIO()) as said:
            code = main(["run", "empty", "--robot", "drone", "--seed", "1", "--log", str(path)])
        report(f"{code} {said.getvalue()}")

    ended = in_child(work, 60.0)
    line = ended.lines[-1] if ended.lines[-1] else ended.lines[-2]
    assert line.startswith(f"2 wayproof: log '{path}': ")
    assert line.endswith("File too large; what fitted is in .partial")
    readable = tmp_path / "readable.mcap"
    assert recover(tmp_path / "a.mcap.partial", readable).decisions >= 10
    assert replay(readable).identical
