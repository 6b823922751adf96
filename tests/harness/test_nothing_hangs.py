"""Tasks that cannot be done end in time, with the outcome and the label that say why."""

import pytest

from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log
from wayproof.harness.replay.replay import replay
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build
from wayproof.models.worlds import WORLDS, Box, World
from wayproof.models.worlds.layout import room_walls

LOW, HIGH = (0.0, 0.0, -0.5), (7.0, 5.0, 3.0)
WALL = Box.between((4.0, 0.0, 0.0), (4.2, 5.0, 3.0), "partition")
PILLAR = Box.between((4.8, 1.2, 0.0), (5.2, 1.6, 3.0), "crate")
SHORT = ("episode.time_limit=40", "behaviour.wait_timeout=0.5", "behaviour.max_recoveries=3")


def small_world(*boxes):
    return World(
        name="small",
        seed=0,
        low=LOW,
        high=HIGH,
        solids=(*room_walls(LOW, HIGH), *boxes),
        start=(1.5, 2.5, 0.0),
        start_heading=0.0,
        goal=(5.5, 2.5, 0.0),
    )


@pytest.fixture
def episode(monkeypatch, tmp_path):
    """Run in a room of 7 x 5 m with some boxes: the result and the decisions."""

    def run(boxes, robot, *settings):
        monkeypatch.setitem(WORLDS, "small", lambda *_: small_world(*boxes))
        config = override(Config("small", robot, 0), (*SHORT, *settings))
        result = run_episode(build(config), tmp_path / "episode.mcap")
        log = open_log(tmp_path / "episode.mcap")
        assert replay(tmp_path / "episode.mcap").identical
        return result, [record.decision for record in log.records()]

    return run


EXACT = ("pose_model.bias_sigma=0", "pose_model.yaw_bias_sigma=0")


# With an exact pose, beams miss some cells under the ceiling for good: there might be a way for a
# drone.
@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("robot", "settings", "label"),
    [
        ("drone", EXACT, "unknown_ahead"),
        ("quadruped", (), "no_path"),
    ],
)
def test_a_sealed_room_ends_in_an_abort_that_says_why(episode, robot, settings, label):
    result, decisions = episode([WALL], robot, *settings)
    assert result.outcome == "aborted", result.reason
    assert decisions[-1].label == label
    assert result.sim_time_s < 40.0
    assert result.collisions == 0
    back = [d for d in decisions if d.action == "recover" and d.predicate.kind == "going_back"]
    assert robot == "drone" or 0 < len({d.predicate.since for d in back}) <= 2


def test_a_goal_inside_the_inflation_is_approached_and_then_given_up(episode):
    # 0.45 m from the pillar: the body of 0.36 m would fit, but not with its margin.
    result, decisions = episode([PILLAR], "drone", "goal=[5.0,2.0]", "episode.goal_tolerance=0.05")
    assert result.outcome == "aborted", result.reason
    assert decisions[-1].label == "goal_blocked"
    assert result.goal_distance_m < 0.5
    waited = [d for d in decisions if d.label == "goal_blocked"]
    assert len(waited) * 0.1 == pytest.approx(5.0, abs=0.3)


@pytest.mark.large
def test_a_goal_inside_the_inflation_is_reached_where_the_tolerance_allows(episode):
    settings = ("goal=[5.0,2.0]", "episode.goal_tolerance=0.6")
    assert episode([PILLAR], "drone", *settings)[0].outcome == "success"


@pytest.mark.parametrize(
    ("settings", "word"),
    [
        (["goal=[5.0,1.4]"], "goal"),
        (["start=[5.0,1.4]"], "start"),
        (["goal=[9.0,2.5]"], "geofence"),
    ],
)
def test_places_that_cannot_be_are_refused_before_the_episode(episode, settings, word):
    with pytest.raises(InputError, match=word):
        episode([PILLAR], "drone", *settings)
