"""Predictions of a predictor from outside, requested between two decisions."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.config import Config
from wayproof.harness.errors import InputError
from wayproof.harness.inputs import Inputs
from wayproof.harness.interface.connect import PredictorSession, connect_predictor
from wayproof.harness.mission import Mission
from wayproof.harness.prediction.predicted_box import (
    MOST_CELLS,
    blank_message,
    prediction_message,
)
from wayproof.harness.prediction.predictor import MapBox, Shape
from wayproof.harness.stack.prediction import Predicted, Predictions
from wayproof.maps.columns import WORD_BITS, ColumnMap, Window, unpack
from wayproof.maps.states import FREE, OCCUPIED


class LivePredictions:
    """Predictions requested from a running predictor.

    It has the time from one decision to the next, and the decisions do not wait for it: what it
    says of the map after one decision is an input of the next. Where latencies are measured, what
    takes longer than this period is left out.
    """

    def __init__(
        self, session: PredictorSession, config: Config, mission: Mission, period_s: float
    ) -> None:
        """Request predictions of the map of a mission.

        Args:
            session: The predictor.
            config: Settings.
            mission: Mission of the episode.
            period_s: Time from one decision to the next, s.

        Raises:
            InputError: A box would hold too many cells.
        """
        self._session = session
        self._area = Window.covering(mission.low, mission.high, config.map.resolution)
        self._reach = round(config.prediction.reach / config.map.resolution)
        self._longest_ms = 1e3 * period_s if config.latency.mode == "measured" else math.inf
        cells = math.prod(
            fixed or min(size, longest)
            for fixed, size, longest in zip(
                session.shape,
                self._area.shape,
                (2 * self._reach, 2 * self._reach, self._area.shape[2]),
                strict=True,
            )
        )
        if cells > MOST_CELLS:
            raise InputError(
                f"prediction.reach: a box of {cells} cells, expected at most {MOST_CELLS}"
            )

    def of(
        self, measured: ColumnMap, newest: Inputs, sequence: int, time_ns: int
    ) -> Predicted | None:
        """Request the prediction of the box about the robot."""
        window = box_about(newest.pose.position, self._area, self._reach, self._session.shape)
        box = MapBox(
            time_ns=newest.time_ns,
            sequence=sequence,
            window=window,
            states=states_of(measured, window),
            position=newest.pose.position.copy(),
            quaternion=newest.pose.quaternion.copy(),
        )
        began = time.perf_counter()
        answer = self._session.query(box)
        took_ms = (time.perf_counter() - began) * 1e3
        late = math.ceil(took_ms) > self._longest_ms
        message = blank_message(sequence, time_ns, self._session.name, late)
        if not late:
            message = prediction_message(message, box, *answer)
        return Predicted(message, took_ms)


@contextlib.contextmanager
def predictions_for(
    config: Config, mission: Mission, period_s: float
) -> Iterator[tuple[Predictions | None, PredictorSession | None]]:
    """Yield the predictions that a config names, and the predictor, which is closed in the end.

    Args:
        config: Settings; a predictor from outside that they name is run.
        mission: Mission of the episode.
        period_s: Time from one decision to the next, s.

    Raises:
        InputError: There is no such predictor, or it does not answer.
    """
    if not config.runs_predictor:
        yield None, None
        return
    session = connect_predictor(config.prediction.source, config.plugins.wall_s)
    try:
        yield LivePredictions(session, config, mission, period_s), session
    finally:
        session.close()


def box_about(position: NDArray[np.float64], area: Window, reach: int, shape: Shape) -> Window:
    """Return the box of cells about a position.

    Args:
        position: (3,) m, world.
        area: Cells of the operating area.
        reach: Cells from the position to its sides along x and y, where no shape is requested; it
            ends with the area.
        shape: Requested cells along each axis; along z they begin where the area does.
    """
    first, sizes = [], []
    for axis in range(3):
        low, size, fixed = area.first[axis], area.shape[axis], shape[axis]
        centre = math.floor(position[axis] / area.resolution)
        if fixed is not None:
            first.append(low if axis == 2 else centre - fixed // 2)
            sizes.append(fixed)
            continue
        begin = low if axis == 2 else min(max(centre - reach, low), low + size - 1)
        end = low + size if axis == 2 else max(min(centre + reach, low + size), begin + 1)
        first.append(begin)
        sizes.append(end - begin)
    (x, y, z), (nx, ny, nz) = first, sizes
    return Window(area.resolution, (x, y, z), (nx, ny, nz))


def states_of(measured: ColumnMap, window: Window) -> NDArray[np.uint8]:
    """Return the states (nx, ny, nz) of the cells of a window, read-only."""
    nx, ny, nz = window.shape
    occupied, free = measured.columns(window.first, (nx, ny, -(-nz // WORD_BITS)))
    states = unpack(free, nz) * np.uint8(FREE) + unpack(occupied, nz) * np.uint8(OCCUPIED)
    states.flags.writeable = False
    return states
