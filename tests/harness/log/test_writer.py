"""Writing of logs that are cut short."""

import contextlib
import io
import resource
import signal

from tests.tools.soak.child import in_child
from wayproof.harness.cli.main import main
from wayproof.harness.log.recover import recover
from wayproof.harness.replay.replay import replay


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
