"""A decision rests on no distance that was out of date when it was looked at."""

import itertools
from collections import Counter

import numpy as np

from tests.maps.exact_distances import scipy_squared
from tests.planners.stale_distances import lazy_windows
from wayproof.harness.behaviour_config import BehaviourConfig
from wayproof.harness.stack import planner_input
from wayproof.harness.stack.decide import decide
from wayproof.harness.stack.types import PlannerInput, PlannerState
from wayproof.planners import FreeSpace, MotionLimits, PlannerConfig, hold, plan

SHAPE = (110, 70, 16)
CELL, REACH, THRESHOLD = 0.1, 14, 16  # m; cells; cells^2
EDGE = THRESHOLD + 1
LIMITS = MotionLimits(2.0, 2.5, 15.0, 2.5, 2.0)
GOAL = np.array([10.2, 3.5, 0.8])
STEP_NS = 100_000_000


def costs(unknown=None):
    distances = np.sqrt(np.arange(REACH**2 + 1)) - np.sqrt(THRESHOLD)
    table = np.exp(-1.5 * CELL * np.maximum(distances, 0.0))
    table[-1] = 0.0
    if unknown is not None:
        table[EDGE] = unknown
    return table


def make_input(known, passable, position, sequence):
    grid = np.zeros(3), CELL, THRESHOLD
    known = FreeSpace(known, *grid, costs())
    return PlannerInput(
        time_ns=sequence * STEP_NS,
        effect_ns=(sequence + 1) * STEP_NS,
        sequence=sequence,
        seed=1,
        position=position,
        heading=0.0,
        goal=GOAL,
        goal_tolerance=0.4,
        traversable=known,
        known_free=known,
        optimistic=FreeSpace(passable, *grid, costs(4.0)),
        cell_states=lambda first, end: np.ones(end - first, np.uint8),
        unknown_blocks=True,
        turns_in_place=False,
        omnidirectional=True,
        penalize_unknown=False,
        limits=LIMITS,
        planner=PlannerConfig(),
        behaviour=BehaviourConfig(),
        bare_discs=((0.0, 0.3),),
        plan=planner_input.memoized_planner(),
    )


def settle(window, input, state):
    """As a navigator does: decide until nothing that was looked at had been out of date."""
    for rounds in itertools.count(1):
        command, after = decide(input, state)
        outdated = [distances.outdated() for distances in window]
        if not any(outdated) and not any(distances.reader.missed for distances in window):
            return command, after, rounds
        for distances in window:
            distances.catch_up()
        for distances in window:
            distances.reader.missed = False


def content(command, state):
    paths = command.trajectory.path, command.global_path, state.global_path
    kept = [None if path is None else path.tobytes() for path in paths]
    return command.action, command.reason, command.label, command.trajectory.duration_s, *kept


def count_plans(monkeypatch):
    """Number of times that each plan of a global path was made, by its query."""
    counts = Counter()

    def counted(space, start, goal, config, seed, heading):
        kind = id(space.distances), space.few_reads, space.cost_by_distance.tobytes()
        counts[*kind, start.tobytes(), goal.tobytes(), seed, heading] += 1
        return plan(space, start, goal, config, seed, heading)

    monkeypatch.setattr(planner_input, "plan", counted)
    return counts


def test_decisions_among_spoilt_distances_are_those_among_true_ones(monkeypatch):
    """A flight on which boxes come and go, each decision taken twice.

    One that begins anew plans no way twice.
    """
    counts, rounds = count_plans(monkeypatch), 0
    rng = np.random.default_rng(0)
    occupied = np.zeros(SHAPE, np.bool_)
    for low in rng.integers([14, 0], [90, 60], size=(14, 2)):
        occupied[low[0] : low[0] + 5, low[1] : low[1] + 14] = True
    centres = (np.stack(np.meshgrid(*map(np.arange, SHAPE), indexing="ij"), -1) + 0.5) * CELL
    position = np.array([0.8, 3.5, 0.8])
    state, known, taken = PlannerState(hold(position, 0, 0.0)), np.zeros(SHAPE, np.bool_), 0
    for sequence in range(60):
        known |= np.square(centres - position).sum(axis=-1) < 3.0**2
        if sequence % 6 == 3:
            low = rng.integers([20, 0], [90, 60])
            occupied[low[0] : low[0] + 4, low[1] : low[1] + 8] ^= True
        to_not_free = scipy_squared(~known | occupied, REACH).astype(np.uint16)
        to_obstacles = scipy_squared(known & occupied, REACH).astype(np.uint16)
        unsure = np.where(to_not_free < EDGE, np.minimum(to_obstacles, EDGE), to_obstacles)
        passable = unsure.astype(np.uint16)
        true = decide(make_input(to_not_free, passable, position, sequence), state)
        counts.clear()
        window = lazy_windows([to_not_free, passable], 100 * sequence, rng.choice([0.05, 0.4, 1.0]))
        *again, needed = settle(window, make_input(*window, position, sequence), state)
        rounds += needed if counts else 0
        assert set(counts.values()) <= {1}
        assert content(*again) == content(*true)
        taken += 1
        command, state = true
        if command.action in ("goal", "abort"):
            break
        flown = [*state.earlier, state.trajectory]
        now = [one for one in flown if one.start_ns <= (sequence + 1) * STEP_NS][-1]
        position = now.at((sequence + 1) * STEP_NS).position
    assert taken > 20
    assert rounds > taken
