"""A stack's own costmap on cards, in pictures and in both viewers."""

from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from PIL import Image

from tests.harness.viewer.drawn import drawn
from tests.harness.viewer.test_rerun_view import entities
from wayproof.harness.attribution import read_case
from wayproof.harness.cli.main import main
from wayproof.harness.explain.stack_costmap import CHEAP, DEAR, costmap_at, shades
from wayproof.harness.log.reader import open_log
from wayproof.harness.schema import foxglove_pb2 as fox
from wayproof.harness.viewer import own_costmap
from wayproof.harness.viewer.layer import COLOURS
from wayproof.harness.viewer.own_costmap import FREE_SPACE, UNKNOWN_SPACE
from wayproof.maps import FREE, OCCUPIED, UNKNOWN

STACKS = Path(__file__).parents[1] / "interface" / "stacks_on_trial.py"
ANY = np.arange(256, dtype=np.uint8).view(np.int8)
COSTS = range(1, 100)


@pytest.fixture(scope="module")
def log(recorded):
    settings = f"stack.name={STACKS}:Maps", "episode.time_limit=1"
    return Path(recorded("empty", "quadruped", 1, *settings).log)


def test_only_a_cost_of_zero_is_free_and_the_rest_is_unknown():
    free, unknown, occupied = COLOURS[FREE], COLOURS[UNKNOWN], COLOURS[OCCUPIED]
    colours = [tuple(one) for one in shades(ANY, unknown=unknown, free=free, occupied=occupied)]
    assert [cost for cost in range(256) if colours[cost] == free] == [0]
    assert [cost for cost in range(256) if colours[cost] == occupied] == [100]
    assert {cost for cost in range(256) if colours[cost] == unknown} == {*range(101, 256)}
    assert (colours[1], colours[99]) == (CHEAP, DEAR)
    assert len({colours[cost] for cost in COSTS}) == 99


def test_rerun_s_codes_are_in_the_same_order():
    rerun_grids = pytest.importorskip("wayproof.harness.viewer.rerun_grids")
    codes = rerun_grids._COSTS.tolist()
    assert [cost for cost in range(256) if codes[cost] == 0] == [0]
    assert [cost for cost in range(256) if codes[cost] == 255] == [*range(101, 256)]
    assert codes[100] == 100
    assert all(128 <= codes[cost] <= 254 for cost in COSTS)  # yellow to red


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


def test_the_picture_of_a_decision_has_it_beside_the_referee_s(log, tmp_path, capsys):
    out = tmp_path / "x.png"
    assert main(["explain", str(log), "5", "--png", str(out)]) == 0
    image = pixels_of(out)
    height, width, _ = image.shape
    assert width > 1.8 * height
    black = 0, 0, 0
    middle = shades(np.array([50], np.int8), unknown=black, free=black, occupied=black)[0]
    assert (image[:, width // 2 :] == middle).all(axis=2).sum() > 500


def test_the_picture_of_the_scene_has_it_from_above(log, tmp_path):
    out = tmp_path / "x.png"
    assert drawn(["picture", str(log), "5", "--out", str(out)]) == (0, "")
    above = pixels_of(out)[:, 960:]
    assert above.shape == (640, 640, 3)
    for colour, area in ((FREE_SPACE, 0.75), (own_costmap.OCCUPIED, 0.25)):  # m^2, of 8 x 8 m
        assert (above == colour).all(axis=2).mean() == pytest.approx(area / 64.0, abs=0.004)
    assert tuple(above[300, 250]) == FREE_SPACE  # 0.9 m behind the robot, to the left
    assert tuple(above[345, 250]) == own_costmap.OCCUPIED  # to the right
    assert tuple(above[300, 385]) == UNKNOWN_SPACE  # ahead
    assert tuple(above[100, 600]) == UNKNOWN_SPACE  # beyond the costmap


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
    assert main(["convert", str(log), "--foxglove", str(out)]) == 0
    with out.open("rb") as file:
        read = make_reader(file).iter_messages(topics=["/viz/stack_costmap"])
        grids = [fox.Grid.FromString(message.data) for _, _, message in read]
    assert len(grids) == 4
    cells = np.frombuffer(grids[0].data, np.uint8).reshape(10, 20, 4)[..., :3]
    assert tuple(cells[0, 0]) == COLOURS[OCCUPIED]
    assert tuple(cells[9, 0]) == COLOURS[FREE]
    assert tuple(cells[0, 19]) == COLOURS[UNKNOWN]
    assert grids[0].cell_size.x == 0.1
