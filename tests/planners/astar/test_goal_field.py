import dataclasses

import numpy as np
import pytest

from tests.planners.worlds import make_space, point
from wayproof.planners import (
    Body,
    FreeSpace,
    GoalField,
    PlannerConfig,
)
from wayproof.planners.kernels.segment import walk_path


def put_box(space: FreeSpace, rng: np.random.Generator, boxes: list[np.ndarray]):
    """A random box comes and the oldest of four goes; the new space, and the cells that differ."""
    low = rng.integers(0, np.array(space.distances.shape))
    boxes.append(np.array([low, low + rng.integers(2, 7, size=3)]))
    del boxes[:-4]
    blocked = np.zeros(space.distances.shape, dtype=bool)
    for box in boxes:
        blocked[tuple(slice(a, b) for a, b in zip(*box, strict=True))] = True
    after = make_space(blocked)
    differ = np.argwhere(after.distances != space.distances)
    return after, (differ.min(axis=0), differ.max(axis=0) + 1)


def test_a_long_body_is_replanned_for_as_anew():
    rng = np.random.default_rng(3)
    body = Body((-0.3, 0.0, 0.3), (0.2, 0.2, 0.2)).discs(0.0, 0.1, flat=True)
    walls = np.zeros((60, 50, 1), dtype=bool)
    walls[:25, 40] = walls[:25, 49] = True  # between them it cannot turn about
    space, boxes, turned = make_space(walls), [], 0
    kept = GoalField(point(space, 55.5, 5.5), PlannerConfig())
    for step in range(30):
        space, _ = put_box(space, rng, boxes)
        both = make_space(walls | (space.distances == 0))
        long = dataclasses.replace(both, collision_distance_sq=7, discs=body)
        start, heading = point(space, 5.5 + 0.3 * step, 44.9), 0.4 * (step % 2)
        again = kept.plan(long, start, seed=step + 1, heading=heading)
        fresh = GoalField(kept.goal, PlannerConfig()).plan(long, start, step + 1, heading)
        assert again.label == fresh.label
        if again.waypoints is not None:
            assert again.waypoints.tobytes() == fresh.waypoints.tobytes()
            assert again.headings.tobytes() == fresh.headings.tobytes()
            assert not long.turnable(start[None])[0]
            turned += 1
    assert turned > 8


@pytest.mark.parametrize("shape", [(60, 50, 1), (30, 26, 16)])
@pytest.mark.parametrize("given", [False, True])
def test_replanning_is_the_same_as_planning_anew(shape, given):
    rng = np.random.default_rng(7)
    space, boxes = make_space(np.zeros(shape, dtype=bool)), []
    depth = 0.5 if shape[2] == 1 else 8.5
    goal = point(space, shape[0] - 4.5, 5.5, depth)
    kept, plans = GoalField(goal, PlannerConfig()), set()
    for step in range(40):
        space, box = put_box(space, rng, boxes)
        start = point(space, 4.5 + 0.2 * step, shape[1] - 5.5, depth)
        if step % 5 == 4:  # a start or goal that is blocked must not make it miss a change
            start = point(space, -1.0, 0.0, depth)
        again = kept.plan(space, start, seed=step + 1, changed=box if given else None)
        fresh = GoalField(goal, PlannerConfig()).plan(space, start, seed=step + 1)
        assert again.label == fresh.label
        if again.waypoints is None:
            continue
        plans.add(again.waypoints.tobytes())
        assert again.waypoints.tobytes() == fresh.waypoints.tobytes()
        assert again.cost == fresh.cost
        _, least, *_ = walk_path(space.grid, space.collision_distance_sq, 0.0, again.waypoints)
        assert least > space.collision_distance_sq
    assert len(plans) > 25
