"""The page of a study in a browser: it shows something, and asks nothing of anybody."""

from __future__ import annotations

import http.server
import json
import re
import shutil
import socket
import subprocess
import threading
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.harness.study.here import run_here
from wayproof.harness.cli.main import main
from wayproof.harness.study.file import read_study
from wayproof.harness.study.plan import plan_episodes
from wayproof.harness.study.store import Store
from wayproof.harness.study.study import run_study

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")

STUDY = """
name = "seen"
worlds = ["empty"]
robots = ["drone"]
seeds = 2
gates = ["success.mean >= 0.99"]
[set]
"episode.time_limit" = 1
[perturbations]
pose_drift = [3]
"""

NOBODY = "not an origin"
"""Whom the browser names as the one who asks, where it asks for itself."""


@pytest.fixture(scope="module")
def browser() -> str:
    """The first one that is installed."""
    found = [path for path in map(shutil.which, BROWSERS) if path]
    if not found:
        pytest.skip("no browser here; apt-get install chromium")
    return found[0]


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of four episodes that time out."""
    folder = tmp_path_factory.mktemp("seen")
    path = folder / "study.toml"
    path.write_text(STUDY)
    study = read_study(str(path))
    run_study(study, plan_episodes(study), Store(folder / "out"), run_here, lambda done: None)
    assert main(["report", str(folder / "out")]) == 0
    return folder / "out" / "report.html"


class Seen:
    """What a headless browser made of a page: its picture, its requests and what it said."""

    def __init__(self, browser: str, url: str, folder: Path) -> None:
        picture, requests = folder / "page.png", folder / "requests.json"
        options = (
            "--headless=new --no-sandbox --disable-gpu --hide-scrollbars --no-first-run "
            "--disable-background-networking --disable-component-update --disable-sync "
            "--disable-default-apps --disable-extensions --metrics-recording-only "
            "--enable-logging=stderr --v=0 --window-size=1200,2400 --virtual-time-budget=5000"
        ).split()
        done = subprocess.run(
            [
                browser,
                *options,
                "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
                f"--user-data-dir={folder / 'profile'}",
                f"--screenshot={picture}",
                f"--log-net-log={requests}",
                url,
            ],
            capture_output=True,
            text=True,
            timeout=120,
            check=True,
        )
        self.console = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
        self.pixels = np.asarray(Image.open(picture).convert("RGB"))
        self.urls = _requested(requests.read_text())


def _requested(text: str) -> set[str]:
    """Every address that a request of the page named, the browser's own apart."""
    if not text.rstrip().endswith("}"):  # the browser left before it had closed the list
        text = text.rstrip().rstrip(",") + "]}"
    log = json.loads(text)
    start = log["constants"]["logEventTypes"]["URL_REQUEST_START_JOB"]
    requests = [event.get("params", {}) for event in log["events"] if event["type"] == start]
    return {one["url"] for one in requests if "url" in one and one.get("initiator") != NOBODY}


def test_a_page_is_seen_and_asks_nothing_of_anybody(
    browser: str, page: Path, tmp_path: Path
) -> None:
    seen = Seen(browser, page.as_uri(), tmp_path)
    assert seen.console == []
    assert seen.urls == set()
    height, width, _ = seen.pixels.shape
    assert (width, height) == (1200, 2400)
    dark = (seen.pixels < 128).all(axis=2)
    assert 0.005 < dark.mean() < 0.3  # text and lines on white
    assert len(np.unique(seen.pixels.reshape(-1, 3), axis=0)) > 400
    assert dark[:300].any()
    assert dark[900:].any()


LOOKED_AT = """
<script>
  const pages = PAGES;
  let left = pages.length;
  for (const [name, width, text] of pages) {
    const frame = document.createElement("iframe");
    frame.width = width; frame.height = 800;
    frame.onload = () => {
      const page = frame.contentDocument, root = page.documentElement;
      console.log(`WIDTH ${name} ${width} ${root.clientWidth} ${root.scrollWidth}`);
      if (name === "episodes.html") {
        const shown = () => [...page.querySelectorAll("#episodes tbody tr:not([hidden])")];
        const column = n => shown().map(row => row.cells[n].textContent);
        page.querySelectorAll("th")[1].click(); page.querySelectorAll("th")[1].click();
        console.log(`SEEDS ${column(1)}`);
        const text = page.querySelector("#text");
        text.value = "pose_drift"; text.dispatchEvent(new Event("input"));
        console.log(`FILTERED ${column(0).length} ${page.querySelector("#count").textContent}`);
      }
    };
    frame.srcdoc = text;
    document.body.append(frame);
  }
</script>
"""
"""Page that opens others in frames of a width, and says how wide they are; sorts and filters."""


def test_no_page_scrolls_sideways_and_the_table_sorts_and_filters(
    browser: str, page: Path, tmp_path: Path
) -> None:
    site = page.parent / "report"
    style = f"<style>{(site / 'style.css').read_text()}</style>"
    names = [
        "index.html",
        "episodes.html",
        str(next(site.glob("episodes/*.html")).relative_to(site)),
    ]
    texts = {
        name: re.sub(r'<link rel="stylesheet"[^>]*>', lambda _: style, (site / name).read_text())
        for name in names
    }
    pages = [[name, width, texts[name]] for name in names for width in (390, 1280)]
    wrapper = tmp_path / "frames.html"
    listed = json.dumps(pages).replace("</", "<\\/")
    wrapper.write_text(f"<body>{LOOKED_AT.replace('PAGES', listed)}</body>")
    seen = Seen(browser, wrapper.as_uri(), tmp_path)
    said = "\n".join(seen.console)
    widths = re.findall(r"WIDTH (\S+) (\d+) (\d+) (\d+)", said)
    assert len(widths) == len(pages), said
    for name, width, inner, content in widths:
        assert int(content) <= int(inner) <= int(width), (name, width, content)
    assert "SEEDS 1,1,0,0" in said
    assert "FILTERED 2 2 of 4" in said


def test_a_page_that_asks_is_found_out(browser: str, tmp_path: Path) -> None:
    """What the test above looks for is seen where it is there."""
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), _Quiet)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        address = f"http://127.0.0.1:{server.server_port}/picture.png"
        bad = tmp_path / "bad.html"
        bad.write_text(f"<img src='{address}'><script>console.error('oh no')</script>")
        seen = Seen(browser, bad.as_uri(), tmp_path)
    finally:
        server.shutdown()
        server.server_close()
    assert address in seen.urls
    assert len(seen.console) >= 1
    assert len(np.unique(seen.pixels.reshape(-1, 3), axis=0)) < 300


class _Quiet(http.server.BaseHTTPRequestHandler):
    """Has nothing."""

    def do_GET(self) -> None:
        self.send_error(404)

    def log_message(self, *_: object) -> None:
        del _


def test_the_same_logs_give_the_same_bytes_again(page: Path) -> None:
    before = page.read_bytes()
    main(["report", str(page.parent)])
    assert page.read_bytes() == before
    assert socket.gethostname() not in page.read_text()
    for one in (page.parent / "report").rglob("*.html"):
        assert socket.gethostname() not in one.read_text()
