"""The page of a study, in text and in a browser, and the comparison of two."""

from __future__ import annotations

import html
import http.server
import json
import re
import shlex
import shutil
import socket
import subprocess
import threading
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from PIL import Image

from tests.harness.study.here import HEAD, run_here, written
from wayproof.harness.cli.main import main, parse
from wayproof.harness.log.reader import open_log
from wayproof.harness.study.file import read_study
from wayproof.harness.study.plan import plan_episodes
from wayproof.harness.study.report.provenance import run_command
from wayproof.harness.study.store import Store
from wayproof.harness.study.study import run_study

STUDY = f"""{HEAD}
seeds = 2
gates = ["success.mean >= 0.99"]
[set]
"start" = [3.0, 3.0]
"goal" = [5.0, 3.0]
"map.resolution" = 0.2
[axes]
"episode.time_limit" = [20, 1]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A study whose second variant cannot but time out, with its report."""
    path = written(tmp_path_factory.mktemp("page"), STUDY)
    study, out = read_study(path), Path(path).parent / "out"
    run_study(study, plan_episodes(study), Store(out), run_here, lambda done: None)
    assert main(["report", str(out)]) == 0
    return out


def test_a_page_tells_what_happened_and_the_same_again(folder, capsys):
    files = [folder / "report.html", *sorted((folder / "report").rglob("*.*"))]
    before = {path: path.read_bytes() for path in files}
    assert len(before) == 1 + 3 + 4
    assert main(["report", str(folder), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert before == {path: path.read_bytes() for path in files}
    assert not any(socket.gethostname().encode() in content for content in before.values())
    page = (folder / "report.html").read_text()
    assert document["report"] == str(folder / "report" / "index.html")
    assert document["verdict"] == "failed"
    assert "2 of 4 episodes reached the goal. Of 2 gates: 1 failed, 1 inconclusive" in page
    assert page.count("<figure>") == 2  # one for each failure
    assert page.count(": timeout</strong>") == 2
    logs = re.findall(r"wayproof explain (\S+)</code> <code>wayproof view (\S+)</code>", page)
    assert len(logs) == 2
    for log, same in logs:  # as they are typed where the report was made
        assert Path(log).is_file()
        assert log == same


def test_a_page_needs_nothing_from_outside(folder):
    page = (folder / "report.html").read_text()
    assert not re.findall(r"""(?:src|href)\s*=\s*["'](?!#)""", page)
    assert "<script" not in page
    for svg in re.findall(r"<svg.*?</svg>", page, re.DOTALL):
        ET.fromstring(svg)  # well-formed


def test_every_link_of_the_site_leads_to_a_page_of_it(folder):
    pages = sorted((folder / "report").rglob("*.html"))
    assert len(pages) == 2 + 4
    linked = set()
    for page in pages:
        text = page.read_text()
        for link in re.findall(r"""(?:src|href)\s*=\s*["']([^"'#]+)""", text):
            target = (page.parent / link).resolve()
            assert target.is_file(), f"{page}: {link}"
            linked.add(target)
        for svg in re.findall(r"<svg.*?</svg>", text, re.DOTALL):
            ET.fromstring(svg)
    assert {page.resolve() for page in pages} <= linked


def test_the_page_of_an_episode_has_its_twin_its_charts_and_commands(folder):
    table = pq.read_table(folder / "table.parquet").to_pylist()
    row = next(one for one in table if one["outcome"] == "timeout")
    twin = next(one for one in table if one["seed"] == row["seed"] and one is not row)
    page = (folder / "report" / "episodes" / f"{row['key']}.html").read_text()
    assert f'href="{twin["key"]}.html">its twin' in page
    assert page.count("<svg") == 2 + 2 + 4  # maps, strips, charts
    assert f">{row['least_clearance']:.3f}</td>" in page
    assert f"{row['least_clearance'] - twin['least_clearance']:+.3f}" in page
    commands = html.unescape(re.findall(r"<pre>(.*?)</pre>", page, re.DOTALL)[0]).splitlines()
    assert "--set episode.time_limit=1.0" in commands[-1]
    for command in commands:  # as they are typed where the report was made
        program, *words = shlex.split(command)
        options = parse(words)
        assert program == "wayproof"
        named = [] if options.verb == "run" else options.log
        paths = named if isinstance(named, list) else [named]
        assert all(Path(one).is_file() for one in paths if not str(one).isdecimal())  # a decision


def test_a_command_of_a_page_runs_its_episode_again(folder, tmp_path):
    study = read_study(str(folder.parent / "study.toml"))
    planned = next(one for one in plan_episodes(study) if one.config.episode.time_limit == 1.0)
    words = shlex.split(run_command(planned))[1:]
    assert main([*words, "--log", str(tmp_path / "d.mcap")]) == 1
    chain = open_log(tmp_path / "d.mcap").result["chain"]
    assert chain == open_log(Store(folder).log(planned.key)).result["chain"]


def test_what_users_write_is_text_and_not_markup(folder, tmp_path):
    store = Store(shutil.copytree(folder, tmp_path / "out"))
    [key, *_] = [path.stem for path in store.logs.glob("*.mcap")]
    store.log(key).unlink()
    store.record_error(key, "<script>alert(1)</script>")
    main(["report", str(store.folder)])
    assert "&lt;script&gt;" in (store.folder / "report.html").read_text()


def test_a_study_is_no_worse_than_itself(folder, capsys):
    """Two seeds cannot show it, though; no gate fails."""
    compared = ["compare", str(folder), str(folder)]
    assert main(compared) == 3
    assert "every decision is the same in all 4 pairs" in capsys.readouterr().out
    assert main([*compared, "--allow-inconclusive", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert all(one["against"]["changed"] == 0 for one in document["arms"])
    assert all(one["against"]["drop"]["estimate"] == 0 for one in document["arms"])


def test_a_comparison_is_a_page_a_table_and_test_cases(folder, tmp_path):
    page, table, cases = (tmp_path / name for name in ("c.html", "c.md", "c.xml"))
    options = ["--html", str(page), "--markdown", str(table), "--junit", str(cases)]
    assert main(["compare", str(folder), str(folder), *options]) == 3
    assert "Episodes with another outcome" in page.read_text()
    assert not re.findall(r"""(?:src|href)\s*=\s*["'](?:https?:|//)""", page.read_text())
    assert "inconclusive" in table.read_text()
    assert ET.parse(cases).getroot().get("errors") == "8"  # four gates, two arms


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["report", "nowhere"], "no folder of a study"),
        (["compare", "{folder}", "nowhere"], "no folder of a study"),
        (["compare", "{folder}", "{folder}", "--gate", "speed.drop <= 0"], "unknown metric"),
    ],
)
def test_bad_input_is_one_line(folder, capsys, arguments, message):
    assert main([one.format(folder=folder) for one in arguments]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")

NOBODY = "not an origin"
"""Whom the browser names as the one who asks, where it asks for itself."""


@pytest.fixture(scope="module")
def browser():
    """The first one that is installed."""
    found = [path for path in map(shutil.which, BROWSERS) if path]
    if not found:
        pytest.skip("no browser here; apt-get install chromium")
    return found[0]


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


def test_a_page_is_seen_and_asks_nothing_of_anybody(browser, folder, tmp_path):
    seen = Seen(browser, (folder / "report.html").as_uri(), tmp_path)
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
<img src="PICTURE">
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
        text.value = "timeout"; text.dispatchEvent(new Event("input"));
        console.log(`FILTERED ${column(0).length} ${page.querySelector("#count").textContent}`);
      }
    };
    frame.srcdoc = text;
    document.body.append(frame);
  }
</script>
"""
"""Page that opens others in frames of a width, and says how wide they are; sorts and filters.

It also asks for a picture, so that what is looked for in a page is found where it is.
"""


class _Quiet(http.server.BaseHTTPRequestHandler):
    """Has nothing."""

    def do_GET(self) -> None:
        self.send_error(404)

    def log_message(self, *_: object) -> None:
        del _


@pytest.fixture
def address():
    """Address of a picture, which there is none of."""
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), _Quiet)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}/picture.png"
    server.shutdown()
    server.server_close()


def test_no_page_scrolls_sideways_and_the_table_sorts_and_filters(
    browser, folder, tmp_path, address
):
    site = folder / "report"
    style = f"<style>{(site / 'style.css').read_text()}</style>"
    episode = next(site.glob("episodes/*.html")).relative_to(site)
    names = ["index.html", "episodes.html", str(episode)]
    texts = {
        name: re.sub(r'<link rel="stylesheet"[^>]*>', lambda _: style, (site / name).read_text())
        for name in names
    }
    pages = [[name, width, texts[name]] for name in names for width in (390, 1280)]
    wrapper = tmp_path / "frames.html"
    listed = json.dumps(pages).replace("</", "<\\/")
    script = LOOKED_AT.replace("PICTURE", address).replace("PAGES", listed)
    wrapper.write_text(f"<body>{script}</body>")
    seen = Seen(browser, wrapper.as_uri(), tmp_path)
    said = "\n".join(seen.console)
    widths = re.findall(r"WIDTH (\S+) (\d+) (\d+) (\d+)", said)
    assert len(widths) == len(pages), said
    for name, width, inner, content in widths:
        assert int(content) <= int(inner) <= int(width), (name, width, content)
    assert "SEEDS 1,1,0,0" in said
    assert "FILTERED 2 2 of 4" in said
    assert address in seen.urls
