"""Falls over the end of the floor, in an imported scene of slabs without a plane."""

from dataclasses import replace

import pytest

from wayproof.harness.attribution import find_cause, read_case
from wayproof.harness.attribution.floor_edge import floor_edge
from wayproof.harness.cli.main import main
from wayproof.harness.counterfactual.check import check
from wayproof.harness.log.reader import open_log
from wayproof.harness.replay.audit import audit

EDGE_X = 4.0
DOCK = """<mujoco><worldbody>
<geom name="floor_west" type="box" size="4 4 0.1" pos="0 0 -0.1"/>
<geom name="floor_bridge" type="box" size="4 1.2 0.1" pos="8 -2.8 -0.1"/>
<geom name="floor_east" type="box" size="3 4 0.1" pos="15 0 -0.1"/>
<geom name="wall_west" type="box" size="0.1 4 0.6" pos="-4.1 0 0.6"/>
<geom name="wall_east" type="box" size="0.1 4 0.6" pos="18.1 0 0.6"/>
</worldbody></mujoco>"""
"""Two platforms and a bridge at one side; the straight line between the ends leads over nothing."""


@pytest.fixture(scope="module")
def dock(tmp_path_factory):
    folder = tmp_path_factory.mktemp("dock")
    (folder / "scene.xml").write_text(DOCK)
    world = folder / "dock.xml"
    scene = ["import", str(folder / "scene.xml"), "--start=-2,2", "--goal=15,2"]
    assert main([*scene, "--out", str(world)]) == 0
    return world


def walk(world, path, *options):
    options = [f"--{name}" for name in options]
    return main(["run", str(world), "--robot=quadruped", "--seed=2", f"--log={path}", *options])


def test_a_stack_that_walks_over_the_edge_did_not_lose_its_path(over):
    log = open_log(over)
    assert (log.result["outcome"], log.result["cause"]) == ("fall", "disregarded_obstacle")
    case = read_case(log)
    edge = floor_edge(case)
    assert edge.place[0] == pytest.approx(EDGE_X + 0.05, abs=0.05)
    assert 0 < edge.commands[0] < edge.decision
    finding = find_cause(case)
    assert (finding.decision, finding.place) == (edge.decision, edge.place)
    verdict = check(log, finding)
    assert verdict.answer == "confirmed"
    assert [one.remedy for one in verdict.checks if one.saves] == ["guard"]


def test_a_fall_elsewhere_is_none_over_the_edge(over):
    case = read_case(open_log(over))
    assert floor_edge(case) is not None
    before = [one for one in case.moments if one.true_position[0] < EDGE_X - 0.7]
    end_s = before[-1].time_ns * 1e-9 + 0.05
    assert floor_edge(replace(case, moments=tuple(before), end_s=end_s)) is None
    assert floor_edge(replace(case, outcome="stuck")) is None


@pytest.fixture(scope="module")
def over(dock, tmp_path_factory):
    """A stack that walks straight over the edge."""
    path = tmp_path_factory.mktemp("over") / "over.mcap"
    assert walk(dock, path, "stack=blind") == 1
    return path


@pytest.mark.large
def test_the_built_in_stack_stays_on_the_floor_and_finds_the_bridge(dock, tmp_path):
    for policy in ("forbid", "allow"):
        path = tmp_path / f"{policy}.mcap"
        walk(dock, path, f"set=costmap.unknown_policy={policy}")
        reached = open_log(path).result["outcome"]
        assert reached in ("success", "aborted")
        assert audit(path).violations == ()  # its ways end on faces of cells
