"""Scenarios of imported worlds: what an import chose, a run accepts."""

from dataclasses import replace

import numpy as np
import pytest

from wayproof.harness.attribution import read_case
from wayproof.harness.attribution.ways import true_ways
from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log
from wayproof.harness.recompute.moments import SegmentedStack, segments_of
from wayproof.harness.recompute.rebuild import rebuild
from wayproof.harness.recompute.side_by_side import changed_mission
from wayproof.harness.replay.audit import audit
from wayproof.harness.replay.replay import replay
from wayproof.harness.replay.verify import verify
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build
from wayproof.harness.scenario.scene_text import safe_scene
from wayproof.maps import UNKNOWN
from wayproof.models.world_files import ImportOptions
from wayproof.models.world_files.importer import import_world


def saved(folder, world):
    path = folder / "world.xml"
    path.write_text(world.text)
    return str(path)


SLOPES = {"quadruped": ["costmap.max_slope=0.3"], "drone": []}


@pytest.mark.parametrize("robot", ["quadruped", "drone"])
def test_a_walk_on_terrain_begins_and_ends_on_the_ground(tmp_path, robot):
    x, y = np.meshgrid(np.linspace(0.0, 12.0, 121), np.linspace(0.0, 8.0, 81))
    np.save(tmp_path / "hills.npy", 2.0 + 0.3 * np.exp(-((x - 6.0) ** 2) - (y - 4.0) ** 2))
    world, notes = import_world(tmp_path / "hills.npy", ImportOptions(resolution=0.1))
    assert notes[-1].startswith("ground at 2 m at the start: the scene is moved by -2")
    assert (0.5 < np.array(world.start[:2])).all()
    assert np.hypot(*np.subtract(world.goal, world.start)[:2]) > 8.0
    scenario = build(Config(saved(tmp_path, world), robot, 0))
    assert scenario.config.start[2] == pytest.approx(scenario.spec.rest_height, abs=1e-3)
    assert "<hfield" in safe_scene(scenario.scene.mjcf)
    climbing = override(Config(saved(tmp_path, world), robot, 0, goal=(6.0, 4.0)), SLOPES[robot])
    on_top = build(climbing)
    assert on_top.config.goal[2] == pytest.approx(on_top.spec.rest_height + 0.3, abs=0.01)


def ridge(folder, width=6.0, height=0.3):
    """Return a world with a ridge across its middle, up to a width from y = 0 on."""
    x, y = np.meshgrid(np.linspace(0.0, 12.0, 121), np.linspace(0.0, 6.0, 61))
    np.save(folder / "ridge.npy", height * np.exp(-((x - 6.0) ** 2)) * (y <= width))
    ends = (1.5, 3.0, 0.0), (10.5, 3.0, 0.0)
    return import_world(folder / "ridge.npy", ImportOptions(resolution=0.1), *ends)[0]


def test_what_walks_is_refused_a_ridge_that_it_would_have_to_climb(tmp_path):
    file = saved(tmp_path, ridge(tmp_path))
    refused = r"no level ground leads 'quadruped' .* up to 0\.30 m, .* costmap\.max_slope=0\.3$"
    with pytest.raises(InputError, match=refused):
        build(Config(file, "quadruped", 0))
    build(Config(file, "drone", 0))
    build(override(Config(file, "quadruped", 0), SLOPES["quadruped"]))
    around = build(Config(saved(tmp_path, ridge(tmp_path, width=3.0)), "quadruped", 0))
    assert not around.warnings


def test_of_ground_that_is_nearly_level_a_warning_names_the_setting(tmp_path):
    x, _ = np.meshgrid(np.linspace(0.0, 12.0, 121), np.linspace(0.0, 6.0, 61))
    np.save(tmp_path / "swell.npy", 0.028 * np.exp(-((x - 6.0) ** 2)))
    ends = (1.5, 3.0, 0.0), (10.5, 3.0, 0.0)
    world, _ = import_world(tmp_path / "swell.npy", ImportOptions(resolution=0.1), *ends)
    config = Config(saved(tmp_path, world), "quadruped", 0)
    (warning,) = build(config).warnings
    assert warning.endswith("up to 0.03 m: --set costmap.max_slope=0.1 maps its slopes")
    assert not build(override(config, ["costmap.max_slope=0.1"])).warnings


def test_a_walk_on_a_ridge_runs_again_from_its_log_and_has_a_way(tmp_path):
    ends = {"start": (5.0, 3.0), "goal": (9.0, 3.0)}  # before its top, and level to 0.1 mm
    config = replace(Config(saved(tmp_path, ridge(tmp_path)), "quadruped", 0), **ends)
    config = override(config, [*SLOPES["quadruped"], "episode.time_limit=1.5"])
    first = run_episode(build(config), tmp_path / "a.mcap")
    log = open_log(tmp_path / "a.mcap")
    assert log.mission.rest_height > 0.0
    case = read_case(log)
    navigator = case.navigator_at(len(case.moments) - 1)
    ways = true_ways(case, navigator, 0)
    assert ways.exists
    assert ways.widest() > ways.radius
    steep = replace(case, config=override(case.config, ["costmap.max_slope=0.0"]))
    assert true_ways(steep, navigator, 0).exists
    assert replay(log.path).identical
    assert run_episode(rebuild(log), tmp_path / "again.mcap").chain == first.chain
    assert audit(log.path).violations == ()


@pytest.mark.large
def test_audit_and_attribution_see_the_ground_that_a_ridge_was_walked_on(tmp_path):
    ends = {"start": (3.0, 3.0), "goal": (9.0, 3.0)}
    steep = saved(tmp_path, ridge(tmp_path, height=0.34))
    config = override(replace(Config(steep, "quadruped", 0), **ends), ["costmap.max_slope=0.35"])
    assert run_episode(build(config), tmp_path / "a.mcap").outcome == "success"
    assert audit(tmp_path / "a.mcap").violations == ()
    log = open_log(tmp_path / "a.mcap")
    case, stack = read_case(log), SegmentedStack(segments_of(log))
    hidden = 0
    for record, number in zip(log.records(), range(100), strict=False):
        stack.step(record)
        if number % 20 == 9:
            costmap = case.navigator_at(number).costmap
            np.testing.assert_array_equal(costmap.state, stack.navigator.costmap.state)
            hidden += (costmap.state == UNKNOWN).sum()
    assert hidden > 1000  # behind the crest, where no hole is


def test_a_log_of_a_flat_floor_that_is_changed_to_slopes_knows_the_height_at_rest():
    built = build(Config("corridor", "quadruped", 0))
    climbing = override(built.config, SLOPES["quadruped"])
    assert built.mission.rest_height == 0.0
    changed = changed_mission(built.mission, built.config, climbing)
    assert changed.rest_height == pytest.approx(built.spec.rest_height)


def test_an_actor_walks_in_an_episode_that_runs_again_from_its_log(tmp_path):
    stops = [(0, 3, -2, 1), (4, 3, 2, 1), (8, 3, -2, 1)]
    way = "".join(f"<waypoint><time>{t}</time><pose>{x} {y} {z} 0 0 0</pose></waypoint>"
                  for t, x, y, z in stops)  # fmt: skip
    path = tmp_path / "a.world"
    path.write_text(
        "<sdf version='1.6'><world name='w'><include><uri>model://ground_plane</uri></include>"
        f"<actor name='a'><script><trajectory id='0'>{way}</trajectory></script></actor>"
        "</world></sdf>"
    )
    world, _ = import_world(path, None, (0.0, 0.0, 0.0), (6.0, 0.0, 0.0))
    config = override(Config(saved(tmp_path, world), "drone", 0), ["episode.time_limit=1.5"])
    first = run_episode(build(config), tmp_path / "first.mcap")
    log = open_log(tmp_path / "first.mcap")
    case = read_case(log)
    (last,) = case.moments[-1].truth.movers
    seconds = case.moments[-1].time_ns * 1e-9
    assert last.position == pytest.approx([3.0, -2.0 + seconds, 0.0], abs=0.01)
    assert replay(log.path).identical
    assert run_episode(rebuild(log), tmp_path / "again.mcap").chain == first.chain


def test_a_log_is_verified_where_the_shortest_way_of_its_file_is_not_straight(tmp_path):
    path = tmp_path / "wall.world"
    ground = "<include><uri>model://ground_plane</uri></include>"
    wall = (
        "<model name='w'><static>1</static><pose>3 0 0 0 0 0.33333333</pose><link name='l'>"
        "<collision name='c'><geometry><box><size>0.2 3 6</size></box></geometry></collision>"
        "</link></model>"
    )
    path.write_text(f"<sdf version='1.6'><world name='w'>{ground}{wall}</world></sdf>")
    world, _ = import_world(path, None, (0.0, 0.0, 0.0), (6.0, 0.0, 0.0))
    config = override(Config(saved(tmp_path, world), "quadruped", 0), ["episode.time_limit=0.5"])
    result = run_episode(build(config), tmp_path / "a.mcap")
    assert 6.5 < result.route_length_m < 8.0  # 6.0 straight through the wall
    assert verify(tmp_path / "a.mcap").findings == ()


def test_what_a_walker_steps_on_does_not_block_its_start(tmp_path):
    boxes = [("slab", "2 2 0.01", "0 0 0.005"), ("post", "0.2 0.2 1", "6 3 0.5")]
    models = "".join(
        f"<model name='{name}'><static>1</static><pose>{at} 0 0 0</pose><link name='l'>"
        f"<collision name='c'><geometry><box><size>{size}</size></box></geometry></collision>"
        "</link></model>"
        for name, size, at in boxes
    )
    ground = "<include><uri>model://ground_plane</uri></include>"
    path = tmp_path / "a.world"
    path.write_text(f"<sdf version='1.6'><world name='w'>{ground}{models}</world></sdf>")
    world, _ = import_world(path, None, (0.0, 0.0, 0.0), (4.0, 0.0, 0.0))
    build(Config(saved(tmp_path, world), "quadruped", 0))
    with pytest.raises(InputError, match=r"start: .* is within the body's radius .* of 'post_0'"):
        build(Config(saved(tmp_path, world), "quadruped", 0, start=(6.0, 2.6)))


TILTED = """<mujoco><worldbody><geom name="floor_0" type="box" size="7 4 .1" pos="4 0 {z}"
  euler="0 {angle} 0"/><geom type="box" size=".1 .1 1" pos="3 3 1"/></worldbody></mujoco>"""


def world_with(folder, geoms):
    (folder / "a.xml").write_text(geoms)
    ends = (0.0, 0.0, 0.0), (7.0, 0.0, 0.0)
    return saved(folder, import_world(folder / "a.xml", ImportOptions(floor=0.0), *ends)[0])


def test_a_tilted_floor_of_any_kind_is_refused_with_the_setting_that_maps_it(tmp_path):
    angle = 3.0
    z = 4.0 * np.tan(np.radians(angle)) - 0.1 / np.cos(np.radians(angle))
    file = world_with(tmp_path, TILTED.format(angle=-angle, z=z))
    with pytest.raises(InputError, match=r"no level ground .* costmap\.max_slope=0\.15$"):
        build(Config(file, "quadruped", 0))
    scenario = build(override(Config(file, "quadruped", 0), ["costmap.max_slope=0.15"]))
    assert scenario.world.ground_height((7.0, 0.0)) == pytest.approx(7.0 * np.tan(np.radians(3.0)))
    level = world_with(tmp_path, TILTED.format(angle=0.0, z=-0.1))
    assert build(Config(level, "quadruped", 0)).world.terrain == ()


def test_a_goal_on_another_level_is_refused_to_what_walks(tmp_path):
    geoms = """<mujoco><worldbody><geom type="plane" size="9 9 1"/><geom name="deck" type="box"
      size="1 2 .05" pos="7 0 .75"/><geom type="box" size=".1 .1 1" pos="3 3 1"/></worldbody>
      </mujoco>"""
    file = world_with(tmp_path, geoms)
    for goal in ((7.0, 0.0, 1.1), (7.0, 0.0, 0.8), (2.0, 0.0, -0.3)):
        with pytest.raises(InputError, match="not on the floor there, at 0 m"):
            build(replace(Config(file, "quadruped", 0), goal=goal))
    rest = build(Config(file, "quadruped", 0)).mission.goal
    assert build(replace(Config(file, "quadruped", 0), goal=rest)).mission.goal == rest
