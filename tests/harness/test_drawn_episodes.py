"""Drawn areas, posts, starts and goals: with free space to the goal no robot waits for ever.

Of a dozen the first two run in every test. With `-m ""`, `DRAWN_EPISODES=N` runs N of them, and
`DRAWN_FROM=K` begins at the K-th.
"""

import math
import os
from dataclasses import replace

import numpy as np
import pytest

from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build
from wayproof.models.robots import ROBOTS
from wayproof.models.worlds import Box, Cylinder, World

FIRST = int(os.environ.get("DRAWN_FROM", "0"))
EPISODES = range(FIRST, FIRST + int(os.environ.get("DRAWN_EPISODES", "12")))
SPEED = {"quadruped": 0.5, "drone": 1.0}
"""Speed that a way takes at the least, m/s."""

FAR = 4.0
"""Greatest share of longer episodes: those whose goal is at the far end of the area, in 100."""

NEAREST_POST = 1.6
"""Least distance of posts from one another, and from start and goal, m: robots fit between."""

HEIGHT = 3.0


def drawn(number):
    """The robot, the world and the time limit, s, of one episode."""
    rng = np.random.default_rng([20, number])
    robot = ("quadruped", "drone")[number % 2]
    inset = ROBOTS[robot].spec.radius + 0.25
    length = float(np.exp(rng.uniform(math.log(5.0), math.log(300.0))))
    width = float(rng.uniform(4.0, min(length, 60.0) + 4.0))
    low = rng.uniform(-20.0, 20.0, 2)
    high = low + np.array([length, width])
    goal = placed(rng, low, high, inset, near=rng.choice(["corner", "border", "inside"]))
    start = goal
    for _ in range(1000):
        start = placed(rng, low, high, inset, near=rng.choice(["border", "inside"]))
        way = float(np.hypot(*(goal - start)))
        farthest = 300.0 if robot == "drone" and rng.uniform(0.0, 100.0) < FAR else 30.0
        if min(3.0, 0.4 * length) < way < farthest:
            break
    posts = placed_posts(rng, low, high, [start, goal])
    heading = float(rng.uniform(-math.pi, math.pi))
    world = World(
        name="empty",
        seed=number,
        low=(*low.tolist(), 0.0),
        high=(*high.tolist(), HEIGHT),
        solids=(*walls(low, high), *posts),
        start=(*start.tolist(), 0.0),
        start_heading=heading,
        goal=(*goal.tolist(), 0.0),
    )
    return robot, world, 25.0 + way / SPEED[robot]


def placed(rng, low, high, inset, near):
    """A place in an area, m: in a corner, at a border or anywhere in it."""
    share = rng.uniform(0.0, 1.0, 2)
    beside = inset + rng.uniform(0.0, 0.5, 2)
    place = low + inset + share * (high - low - 2.0 * inset)
    axes = {"corner": [0, 1], "border": [rng.integers(2)], "inside": []}[str(near)]
    for axis in axes:
        place[axis] = rng.choice([low[axis] + beside[axis], high[axis] - beside[axis]])
    return place


def placed_posts(rng, low, high, ends):
    """Round and square posts, far enough apart, that leave a way along every border."""
    count = int(rng.integers(0, 1 + min(60, int(np.prod(high - low) / 12.0))))
    apart, posts = [*ends], []
    for _ in range(count):
        place = rng.uniform(low, high)
        inside = (np.minimum(place - low, high - place) > NEAREST_POST).all()
        if not inside or min(np.hypot(*(place - one)) for one in apart) < NEAREST_POST + 0.3:
            continue
        apart.append(place)
        (x, y), size = place.tolist(), float(rng.uniform(0.05, 0.3))
        if rng.uniform() < 0.5:
            posts.append(Cylinder((x, y, 0.0), (x, y, 2.0), size, "post"))
        else:
            yaw = float(rng.uniform(0.0, 3.0))
            posts.append(Box((x, y, 1.0), (0.7 * size, 0.7 * size, 1.0), yaw, "post"))
    return posts


def walls(low, high):
    """Walls along the borders, outside of the area; none of one area in three."""
    if int(low[0] * 1e3) % 3 == 0:
        return []
    (x, y), (w, h) = (0.5 * (low + high)).tolist(), (0.5 * (high - low)).tolist()
    thin = 0.1
    return [
        Box((x, y + side * (h + thin), 1.0), (w, thin, 1.0), 0.0, "wall") for side in (-1.0, 1.0)
    ] + [Box((x + side * (w + thin), y, 1.0), (thin, h, 1.0), 0.0, "wall") for side in (-1.0, 1.0)]


@pytest.mark.few(2)
@pytest.mark.parametrize("number", EPISODES)
def test_with_free_space_to_the_goal_no_robot_waits(tmp_path, number):
    robot, world, limit = drawn(number)
    settings = [f"episode.time_limit={limit:.1f}", "episode.stuck_after=12", "record=decisions"]
    config = replace(override(Config("empty", robot, number), settings), goal=world.goal[:2])
    ended = run_episode(build(config, world), tmp_path / "drawn.mcap")
    assert ended.outcome == "success", f"{ended.outcome}: {ended.reason}; {ended.cause}"
