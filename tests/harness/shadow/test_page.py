import base64
import re

from wayproof.harness.cli.main import main
from wayproof.harness.shadow.page import write_page


def test_the_page_of_a_recording_holds_its_picture_and_its_verdict(fr079_log, tmp_path):
    out = tmp_path / "page.html"
    summary = write_page(fr079_log, out)
    text = out.read_text()
    assert summary.verdict in text
    assert summary.chain in text
    picture = re.search(r"base64,([^\"]+)", text)[1]
    assert base64.b64decode(picture).startswith(b"\x89PNG")
    assert "http" not in text  # it is one file


def test_report_takes_the_log_of_a_recording(fr079_log, capsys):
    assert main(["report", str(fr079_log)]) == 0
    assert "page: " in capsys.readouterr().out
    assert fr079_log.with_suffix(".html").exists()
