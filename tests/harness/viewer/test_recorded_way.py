"""The way of a recorded robot in Rerun."""

import re

import pytest

from tests.harness.shadow.conftest import BODY, shadowed, written
from tests.harness.viewer.test_rerun_view import entities
from wayproof.harness.cli.main import main
from wayproof.harness.shadow.assess import assess
from wayproof.harness.shadow.picture import COLOURS_OF_WAY

pytest.importorskip("rerun")


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """A robot that drives into a post which it has seen."""
    folder = tmp_path_factory.mktemp("way")
    (folder / "wheeled.toml").write_text(BODY)
    path = written(
        folder / "post.clf", [(0.1 * k, 0.0, 0.0) for k in range(20)], block=(1.7, 0.0), ahead=6.0
    )
    return shadowed(path, folder / "wheeled.toml", folder / "post.mcap")


def test_each_leg_is_shown_in_the_colour_of_its_verdict(log, tmp_path, capsys):
    legs = assess(log).legs
    verdicts = {"admitted" if leg.admitted else leg.why for leg in legs}
    assert {"admitted", "occupied"} <= verdicts
    out = tmp_path / "way.rrd"
    assert main(["view", str(log), "--save", str(out)]) == 0
    capsys.readouterr()
    strips = lines_in(out)
    for verdict in COLOURS_OF_WAY:
        expected = [leg for leg in legs if ("admitted" if leg.admitted else leg.why) == verdict]
        assert strips.get(f"/log/world/way/{verdict}", 0) == len(expected)
    assert "/log/world/trail" not in strips


def lines_in(recording):
    """Number of rows with lines of each entity of a file, by Rerun's own command."""
    found = {}
    row = r"with (\d+) rows .*? - (/log/\S+) - .*LineStrips3D:strips"
    for rows, entity in re.findall(row, entities(recording)):
        found[entity] = found.get(entity, 0) + int(rows)
    return found
