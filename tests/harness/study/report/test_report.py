"""The page of a study, and the comparison of two."""

from __future__ import annotations

import html
import json
import re
import shlex
import xml.etree.ElementTree as ET
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from tests.harness.study.here import run_here
from wayproof.harness.cli.main import main, parse
from wayproof.harness.log.reader import open_log
from wayproof.harness.study.file import read_study
from wayproof.harness.study.plan import plan_episodes
from wayproof.harness.study.report.provenance import run_command
from wayproof.harness.study.store import Store
from wayproof.harness.study.study import run_study

STUDY = """
name = "page"
worlds = ["corridor"]
robots = ["drone"]
seeds = 2
gates = ["success.mean >= 0.99"]
[axes]
"episode.time_limit" = [60, 2]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study whose second variant cannot but time out."""
    folder = tmp_path_factory.mktemp("page")
    path = folder / "study.toml"
    path.write_text(STUDY)
    study = read_study(str(path))
    run_study(study, plan_episodes(study), Store(folder / "out"), run_here, lambda done: None)
    return folder / "out"


def test_a_page_tells_what_happened(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["report", str(folder), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
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


def test_a_page_needs_nothing_from_outside(folder: Path) -> None:
    main(["report", str(folder)])
    page = (folder / "report.html").read_text()
    assert not re.findall(r"""(?:src|href)\s*=\s*["'](?!#)""", page)
    assert "<script" not in page
    for svg in re.findall(r"<svg.*?</svg>", page, re.DOTALL):
        ET.fromstring(svg)  # well-formed


def test_the_same_logs_give_the_same_bytes(folder: Path) -> None:
    sites = []
    for _ in range(2):
        main(["report", str(folder)])
        files = [folder / "report.html", *sorted((folder / "report").rglob("*.*"))]
        sites.append({path: path.read_bytes() for path in files})
    assert sites[0] == sites[1]
    assert len(sites[0]) == 1 + 3 + 4


def test_every_link_of_the_site_leads_to_a_page_of_it(folder: Path) -> None:
    main(["report", str(folder)])
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


def test_the_page_of_an_episode_has_its_twin_its_charts_and_commands(folder: Path) -> None:
    main(["report", str(folder)])
    table = pq.read_table(folder / "table.parquet").to_pylist()
    row = next(one for one in table if one["outcome"] == "timeout")
    twin = next(one for one in table if one["seed"] == row["seed"] and one is not row)
    page = (folder / "report" / "episodes" / f"{row['key']}.html").read_text()
    assert f'href="{twin["key"]}.html">its twin' in page
    assert page.count("<svg") == 2 + 2 + 4  # maps, strips, charts
    assert f">{row['least_clearance']:.3f}</td>" in page
    assert f"{row['least_clearance'] - twin['least_clearance']:+.3f}" in page
    commands = html.unescape(re.findall(r"<pre>(.*?)</pre>", page, re.DOTALL)[0]).splitlines()
    assert commands[-1].endswith("--set episode.time_limit=2.0")
    for command in commands:  # as they are typed where the report was made
        program, *words = shlex.split(command)
        options = parse(words)
        assert program == "wayproof"
        named = [] if options.verb == "run" else options.log
        paths = named if isinstance(named, list) else [named]
        assert all(Path(one).is_file() for one in paths if not str(one).isdecimal())  # a decision


def test_a_command_of_a_page_runs_its_episode_again(folder: Path, tmp_path: Path) -> None:
    study = read_study(str(folder.parent / "study.toml"))
    planned = next(one for one in plan_episodes(study) if one.config.episode.time_limit == 2.0)
    words = shlex.split(run_command(planned))[1:]
    assert main([*words, "--log", str(tmp_path / "d.mcap")]) == 1
    chain = open_log(tmp_path / "d.mcap").result["chain"]
    assert chain == open_log(Store(folder).log(planned.key)).result["chain"]


def test_what_users_write_is_text_and_not_markup(folder: Path) -> None:
    store = Store(folder)
    [key, *_] = [path.stem for path in store.logs.glob("*.mcap")]
    kept = store.log(key).read_bytes()
    store.log(key).unlink()
    store.record_error(key, "<script>alert(1)</script>")
    main(["report", str(folder)])
    (store.errors / f"{key}.json").unlink()
    store.log(key).write_bytes(kept)
    assert "&lt;script&gt;" in (folder / "report.html").read_text()


def test_a_study_is_no_worse_than_itself(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Two seeds cannot show it, though; no gate fails."""
    compared = ["compare", str(folder), str(folder)]
    assert main(compared) == 3
    assert "every decision is the same in all 4 pairs" in capsys.readouterr().out
    assert main([*compared, "--allow-inconclusive", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert all(one["against"]["changed"] == 0 for one in document["arms"])
    assert all(one["against"]["drop"]["estimate"] == 0 for one in document["arms"])


def test_a_comparison_is_a_page_a_table_and_test_cases(folder: Path, tmp_path: Path) -> None:
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
def test_bad_input_is_one_line(
    folder: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    assert main([one.format(folder=folder) for one in arguments]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
