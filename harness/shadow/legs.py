"""The recorded way in legs: steps long enough to be way, each judged when it was entered."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wayproof.harness.geometry import polyline_length
from wayproof.harness.judge.body import track_of
from wayproof.harness.log.paths import Array
from wayproof.harness.shadow.overlap import Cell
from wayproof.harness.shadow.way import LEAST_STEP, knots


@dataclass(frozen=True)
class Piece:
    """The way from one decision to the next, judged on the map of the first.

    Attributes:
        sequence: Number of the decision.
        begin_ns: Its time.
        end_ns: Time of the next.
        poses: (n, 4) believed: x, y, z, m, and heading, rad.
        admitted: Whether the body was free at and between all poses.
        why: Reason why it was not; empty if it was.
        cells: Cells in the way.
    """

    sequence: int
    begin_ns: int
    end_ns: int
    poses: Array
    admitted: bool
    why: str
    cells: tuple[Cell, ...]


@dataclass(frozen=True)
class Leg:
    """Successive pieces that together are at least one step of way.

    Attributes:
        sequence: Decision on whose map it was entered, or, where it was not admitted, the one on
            whose map it first was not.
        begin_ns: Time at its begin.
        end_ns: Time at its end.
        poses: (n, 4) believed: x, y, z, m, and heading, rad.
        length_m: m.
        admitted: Whether each piece was admitted on the map of its own decision.
        why: Reason of the first piece that was not; empty if all were.
        cells: Cells in the way of that piece.
        hindsight_cells: Number of cells that the bare body overlapped and that the map without
            decay holds occupied at the end of the recording.
    """

    sequence: int
    begin_ns: int
    end_ns: int
    poses: Array
    length_m: float
    admitted: bool
    why: str
    cells: tuple[Cell, ...]
    hindsight_cells: int = 0


def legs_of(pieces: Sequence[Piece], offsets: Sequence[float] = ()) -> list[Leg]:
    """Join successive pieces to legs.

    A rest of less than a step at the end of the recording, or before a gap between the pieces, is
    no way, and is left out; but where a long body turns in it, so that it moves off its middle by a
    step, that belongs to the leg before.

    Args:
        pieces: The pieces.
        offsets: Offsets of the discs of a long body along it, m; none of a round one.
    """
    return [_leg(step) for run in _without_gaps(pieces) for step in _steps_of(run, offsets)]


def _without_gaps(pieces: Sequence[Piece]) -> list[list[Piece]]:
    """Divide pieces where one begins later than the one before ends."""
    runs: list[list[Piece]] = []
    for piece in pieces:
        if not runs or piece.begin_ns > runs[-1][-1].end_ns:
            runs.append([])
        runs[-1].append(piece)
    return runs


def _steps_of(pieces: Sequence[Piece], offsets: Sequence[float]) -> list[list[Piece]]:
    """Join pieces without a gap to steps, the last with the turns after it."""
    steps, rest = _steps(pieces)
    turns, _ = _steps(rest, offsets)
    if steps:
        steps[-1].extend(piece for turn in turns for piece in turn)
    return steps


def _steps(
    pieces: Sequence[Piece], offsets: Sequence[float] = (0.0,)
) -> tuple[list[list[Piece]], list[Piece]]:
    """Join pieces until a place at any of the offsets along the body has moved by a step.

    Returns:
        The steps, and the pieces after the last.
    """
    steps: list[list[Piece]] = []
    open_: list[Piece] = []
    for piece in pieces:
        open_.append(piece)
        first = open_[0].poses[:1]
        if any(_moves_by_a_step(first, piece.poses, offset) for offset in offsets):
            steps.append(open_)
            open_ = []
    return steps, open_


def _moves_by_a_step(first: Array, poses: Array, offset: float) -> bool:
    """Return whether a place along the body gets a step from where it was at first (1, 4)."""
    away = track_of(poses, offset) - track_of(first, offset)
    return bool(np.square(away).sum(axis=1).max() >= LEAST_STEP * LEAST_STEP)


def _leg(pieces: Sequence[Piece]) -> Leg:
    poses = np.concatenate([piece.poses for piece in pieces])
    kept = knots(poses[:, :3])
    ends = np.unique(np.append(kept, len(poses) - 1))
    refused = [piece for piece in pieces if not piece.admitted]
    named = refused[0] if refused else pieces[0]
    return Leg(
        sequence=named.sequence,
        begin_ns=pieces[0].begin_ns,
        end_ns=pieces[-1].end_ns,
        poses=poses,
        length_m=polyline_length(poses[ends, :3]),
        admitted=not refused,
        why=named.why,
        cells=named.cells,
    )
