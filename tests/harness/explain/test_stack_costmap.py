"""A stack's own costmap on cards, in pictures and in both viewers."""

from pathlib import Path

import numpy as np
import pytest
from foxglove_schemas_protobuf.Grid_pb2 import Grid
from mcap.reader import make_reader
from PIL import Image

from tests.harness.viewer.test_rerun_view import entities
from wayproof.harness.attribution import read_case
from wayproof.harness.cli.main import main
from wayproof.harness.explain.commanded import costmap_at
from wayproof.harness.log.reader import open_log
from wayproof.harness.viewer.layer import COLOURS, shades
from wayproof.maps import FREE, OCCUPIED, UNKNOWN

STACKS = Path(__file__).parents[1] / "interface" / "stacks_on_trial.py"


@pytest.fixture(scope="module")
def log(recorded):
    settings = f"stack.name={STACKS}:Maps", "episode.time_limit=1"
    return Path(recorded("empty", "quadruped", 1, *settings).log)


def pixels_of(picture):
    with Image.open(picture) as image:
        return np.asarray(image.convert("RGB"))


def test_the_newest_costmap_is_shown_until_the_next(log):
    case = read_case(open_log(log))
    own = costmap_at(case, 5)
    assert own.sequence == 3
    assert own.grid.cells.shape == (10, 20)
    assert own.grid.origin == pytest.approx(
        np.subtract(case.moments[3].pose.position[:2], (1, 0.5))
    )


@pytest.mark.parametrize(
    "command",
    [["explain", "LOG", "5", "--png", "OUT"], ["view", "LOG", "--decision", "5", "--png", "OUT"]],
)
def test_a_picture_has_it_beside_the_referee_s(log, tmp_path, command):
    out = tmp_path / "x.png"
    named = {"LOG": str(log), "OUT": str(out)}
    assert main([named.get(word, word) for word in command]) == 0
    beside = pixels_of(out)[:, 700:]
    assert beside.shape == (840, 700, 3)
    middle = shades(np.array([50], np.int8))[0]
    assert (beside == middle).all(axis=2).sum() > 500
    cells = beside[:650]  # the legend is below; a square metre is 74 x 74 pixels
    for state, area in ((FREE, 0.75), (OCCUPIED, 0.25)):
        shown = (cells == COLOURS[state]).all(axis=2).sum() / 74.0**2
        assert shown == pytest.approx(area, rel=0.5)


def test_rerun_has_it_in_a_view_of_its_own(log, recorded, tmp_path):
    pytest.importorskip("rerun")
    from wayproof.harness.viewer.layout import layout

    out = tmp_path / "x.rrd"
    assert main(["view", str(log), "--save", str(out)]) == 0
    assert "/log/world/stack_costmap" in entities(out)
    space, maps = layout({"log": open_log(log)}).root_container.contents[0].contents
    assert [view.name for view in maps.contents][1] == "the stack's own costmap"
    contents = [view.contents for view in (space, *maps.contents)]
    shows = ["- $origin/stack_costmap" not in each for each in contents]
    assert shows == [False, False, True, False, False]
    assert "- $origin/layer" in contents[2]
    other = Path(recorded("empty", "drone", 1, "episode.time_limit=1").log)
    maps = layout({"log": open_log(other)}).root_container.contents[0].contents[1]
    assert len(maps.contents) == 3


def test_foxglove_gets_it_as_a_grid(log, tmp_path):
    out = tmp_path / "x.mcap"
    assert main(["export", str(log), "--foxglove", str(out)]) == 0
    with out.open("rb") as file:
        read = make_reader(file).iter_messages(topics=["/viz/stack_costmap"])
        grids = [Grid.FromString(message.data) for _, _, message in read]
    assert len(grids) == 4
    cells = np.frombuffer(grids[0].data, np.uint8).reshape(10, 20, 4)[..., :3]
    assert tuple(cells[0, 0]) == COLOURS[OCCUPIED]
    assert tuple(cells[9, 0]) == COLOURS[FREE]
    assert tuple(cells[0, 19]) == COLOURS[UNKNOWN]
    assert grids[0].cell_size.x == 0.1
