"""Planner inputs made by hand: a room of 8 x 4 m in the plane, and a robot in it.

A room is all free but for rectangles that are unknown or occupied; the distances that a decision
plans on are computed from its cells as a costmap does.
"""

from dataclasses import fields, replace

import numpy as np

from tests.maps.exact_distances import scipy_squared
from wayproof.harness.config import Config
from wayproof.harness.stack.decide import decide
from wayproof.harness.stack.gaits import AnyDirection, Flight, TurnThenGo
from wayproof.harness.stack.situation import Course, drivable_part
from wayproof.harness.stack.state import PlannerState, Route
from wayproof.harness.stack.types import FreeSpaces, PlannerInput
from wayproof.maps import FREE, OCCUPIED, UNKNOWN
from wayproof.planners import Body, FreeSpace, MotionLimits, hold

CELL = 0.1  # m
SHAPE = (80, 40, 1)
REACH = 20  # maximum distance, cells
PERIOD_NS = 100_000_000  # between decisions, and from a decision to its effect
HEIGHT = 0.5 * CELL  # z of all positions, m

ROUND = Body((0.0,), (0.3,))
LONG = Body((-0.3, 0.0, 0.3), (0.2, 0.2, 0.2))
LIMITS = MotionLimits(
    speed=2.0, acceleration=2.5, jerk=15.0, lateral_acceleration=2.5, yaw_rate=2.0
)

START, GOAL = (1.05, 2.05), (6.55, 2.05)


def make_gait(kind, body=ROUND, **others):
    """A gait of a body; others are its fields in place of the usual ones."""
    discs = tuple(zip(body.offsets, body.radii, strict=True))
    return kind(**{"limits": LIMITS, "discs": discs, **others})


TURNS = make_gait(TurnThenGo)
SIDLES = make_gait(AnyDirection, LONG, sideways_speed=0.4)


def place(x, y):
    """A place (3,) in the room, m."""
    return np.array([x, y, HEIGHT])


def make_states(unknown=(), occupied=()):
    """States (nx, ny, 1) of a room's cells."""
    states = np.full(SHAPE, FREE, np.uint8)
    for state, rectangles in ((UNKNOWN, unknown), (OCCUPIED, occupied)):
        for rectangle in rectangles:
            x, x_end, y, y_end = np.rint(np.array(rectangle) / CELL).astype(int)
            states[x:x_end, y:y_end] = state
    return states


def make_space(blocked, body=ROUND):
    """Free space of a body among blocked cells (nx, ny, 1); at its heading if it is elongated."""
    discs = body.discs(margin=0.0, resolution=CELL, flat=True)
    distances = scipy_squared(blocked, REACH).astype(np.uint16)
    least = min(disc.collision_distance_sq for disc in discs)
    costs = np.zeros(REACH**2 + 1)
    return FreeSpace(distances, np.zeros(3), CELL, least, costs, discs if len(discs) > 1 else ())


def make_input(
    states=None,
    body=ROUND,
    policy="forbid",
    position=START,
    goal=GOAL,
    sequence=0,
    gait=None,
    behaviour=None,
    **others,
):
    """Make the input of one decision.

    Args:
        states: From `make_states`; a free room by default.
        body: `ROUND` or `LONG`.
        policy: `forbid`, `penalize` or `allow` unknown space.
        position: (2,) estimated, m.
        goal: (2,) m.
        sequence: Number of the decision, which sets its times.
        gait: From `make_gait`; by default a round body flies, and a long one turns, then goes.
        behaviour: Settings; the usual ones by default.
        others: Fields of the input, or of its spaces, in place of these.
    """
    states = make_states() if states is None else states
    known, passable = make_space(states != FREE, body), make_space(states == OCCUPIED, body)
    config = Config("", "", seed=1)
    config = replace(
        config,
        behaviour=behaviour or config.behaviour,
        costmap=replace(config.costmap, unknown_policy=policy),
        episode=replace(config.episode, goal_tolerance=0.25),
    )
    spaces = FreeSpaces(
        traversable=known if policy == "forbid" else passable,
        known_free=known,
        optimistic=passable,
        cell_states=lambda first, end: states[tuple(map(slice, first, end))],
    )
    input = PlannerInput(
        time_ns=sequence * PERIOD_NS,
        effect_ns=(sequence + 1) * PERIOD_NS,
        sequence=sequence,
        position=place(*position),
        heading=0.0,
        goal=place(*goal),
        config=config,
        spaces=spaces,
        gait=gait or make_gait(TurnThenGo if len(body.radii) > 1 else Flight, body),
    )
    return with_spaces(input, **others)


def with_spaces(input, **values):
    """Return an input with other fields: its own, and those of its spaces."""
    names = {field.name for field in fields(FreeSpaces)}
    own = {name: values.pop(name) for name in [*values] if name in names}
    return replace(input, spaces=replace(input.spaces, **own), **values)


def at_rest(position=START, heading=0.0, **others):
    """The state of a robot that has stood in its place so far; others as of `changed`."""
    return changed(PlannerState((hold(place(*position), 0, heading),)), **others)


def changed(state, **values):
    """Return a state with other fields: its own, and those of its route, tries, trails, narrows."""
    if "global_path" in values:
        state = replace(state, route=Route(values.pop("global_path")))
    for name in ("route", "tries", "trails", "narrows"):
        part = getattr(state, name)
        own = {key: values.pop(key) for key in [*values] if hasattr(part, key)}
        state = replace(state, **{name: replace(part, **own)}) if own else state
    return replace(state, **values)


def course_of(input, state, previous=None, part=None):
    """The course along the global path of a state, by default with its drivable part."""
    start = state.trajectory.at(input.effect_ns)
    part = part or drivable_part(input, state.path, start)
    return Course(input, state, start, previous or state, part)


def sample_at(state, time_ns):
    """Sample the trajectories that a robot has committed to, as a `TrajectorySample`."""
    begun = [one for one in state.committed if one.start_ns <= time_ns]
    return (begun or state.committed[:1])[-1].at(time_ns)


def next_input(state, sequence, **room):
    """Make the input of a decision after the robot has followed its committed trajectories."""
    now = sample_at(state, sequence * PERIOD_NS)
    x, y, _ = now.position
    return make_input(position=(x, y), heading=now.heading, sequence=sequence, **room)


def drive(decisions, state=None, **room):
    """The state after so many decisions in a room, from rest at the start.

    Args:
        decisions: How many.
        state: Before them; that of a robot at rest by default.
        room: Of `make_input`.
    """
    state = at_rest() if state is None else state
    for sequence in range(decisions):
        _, state = decide(next_input(state, sequence, **room), state)
    return state


def final_sample(trajectory):
    """The last sample of a trajectory."""
    return trajectory.at(trajectory.start_ns + round(trajectory.duration_s * 1e9))


def top_speed(trajectory):
    """The greatest speed of a trajectory, m/s, to a millisecond."""
    steps = range(0, round(trajectory.duration_s * 1e3) + 1)
    return max(trajectory.at(trajectory.start_ns + 1_000_000 * step).speed for step in steps)
