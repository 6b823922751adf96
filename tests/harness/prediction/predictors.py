"""Predictors from outside: a good one, and one for each way to be broken."""

import time

import numpy as np

AT = 3
"""Number of the decision before which the broken ones fail."""


def along(view):
    """Log-odds of columns: walls go on for a metre, and floors for half of one."""
    log_odds = np.zeros(view.occupied.shape)
    near = view.free
    for _ in range(5):
        near = near | np.roll(near, 1, 0) | np.roll(near, -1, 0)
        near = near | np.roll(near, 1, 1) | np.roll(near, -1, 1)
    log_odds[near] = -3.0
    for axis in (0, 1):
        for step in (1, -1):
            ahead = view.occupied & np.roll(view.occupied, step, axis)
            for _ in range(10):
                ahead = np.roll(ahead, step, axis)
                log_odds[ahead] = 2.0
    return log_odds


class Walls:
    name = "walls 1"

    def predict(self, box):
        return along(box.columns())


class Free:
    """All is free, up to the height of columns and, in the air, above it."""

    def predict(self, box):
        log_odds = np.full(box.states.shape, -4.0)
        log_odds[:, :, : round(0.5 - box.origin[2] / box.resolution)] = 4.0  # the floor
        return log_odds


class Cells:
    """Every unknown cell beside an occupied one is occupied, too."""

    def predict(self, box):
        occupied = box.states == 2
        near = occupied | np.roll(occupied, 1, 0) | np.roll(occupied, 1, 1)
        return np.where(near, np.float32(4.0), np.float32(0.0))


class Breaks:
    """Answers well, and then once as `broken` does."""

    def predict(self, box):
        if box.sequence == AT:
            return self.broken(box)
        return np.zeros(box.states.shape[:2])


class Nan(Breaks):
    def broken(self, box):
        log_odds = np.zeros(box.states.shape)
        log_odds[1, 2, 3] = np.nan
        return log_odds


class Shape(Breaks):
    def broken(self, box):
        return np.zeros((3, 3))


class Text(Breaks):
    def broken(self, box):
        return "free, I think"


class Raises(Breaks):
    def broken(self, box):
        raise KeyError("weights")


class Overwrites(Breaks):
    def broken(self, box):
        box.states[0] = 1
        return np.zeros(box.states.shape)


class Hangs(Breaks):
    def broken(self, box):
        time.sleep(1000.0)


class Slow:
    """Takes longer than a period, each third time."""

    def predict(self, box):
        if box.sequence % 3 == 0:
            time.sleep(0.3)
        return along(box.columns())


class Unable(Walls):
    def __init__(self):
        raise OSError("no weights")


class Silent:
    pass
