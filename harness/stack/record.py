"""The record of a decision: what it rests on, what was chosen and why, and how long it took."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.inputs import Inputs
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.decision import add_points, thinned, trajectory_message
from wayproof.harness.stack.mapping import Mapper
from wayproof.harness.stack.reasons import Reason, reason_message, sentence
from wayproof.harness.stack.types import Choice, View
from wayproof.planners import Trajectory

Array = NDArray[np.float64]


def record(
    inputs: Inputs,
    view: View,
    choice: Choice,
    mapper: Mapper,
    inflation_radius: float,
    version: str,
) -> pb.Decision:
    """Write a decision down; delay and chain come when it is committed.

    Args:
        inputs: What it was made on.
        view: What of it the behaviour saw.
        choice: What was decided.
        mapper: Whose map and costmap it rests on.
        inflation_radius: Of the body as it was planned for, m.
        version: Of the map.
    """
    path, search, config = choice.trajectory.path, choice.search, mapper.costmap.config
    decision = pb.Decision(
        sequence=inputs.sequence,
        trigger=f"{inputs.sweeps[0].sensor} sweep" if inputs.sweeps else "pose",
        representation=config.kind,
        map_version=version,
        resolution_m=mapper.map.resolution,
        unknown_policy=config.unknown_policy,
        inflation_radius_m=inflation_radius,
        localization_margin_m=mapper.costmap.margin,
        blocked_at_or_below=view.admitted.collision_distance_sq,
        position=inputs.pose.position.tolist(),
        quaternion=inputs.pose.quaternion.tolist(),
        position_sigma=inputs.pose.position_sigma,
        input_digest=inputs.digest,
        evidence_age_s=mapper.evidence_age(path, inputs.time_ns),
        planner=view.planner.name if search else "",
        planner_seed=choice.search_seed,
        planner_iterations=search.iterations if search else 0,
        path_cost=_path_cost(view, choice.guide),
        path_length_m=_length(choice.guide),
        least_clearance_m=view.known.least_clearance(path),
        action=choice.action,
        reason=sentence(choice.reason),
        grounds=reason_message(choice.reason),
        label=choice.label,
        trajectory=trajectory_message(choice.trajectory),
        committed_length_m=_length(path),
    )
    add_points(decision, "guide", thinned(choice.guide))
    decision.timestamp.FromNanoseconds(inputs.time_ns)
    return decision


def record_missed_deadline(decision: pb.Decision, standing: Trajectory) -> None:
    """Change a decision that came too late to what the robot does instead: follow what stands."""
    late_ns = decision.timestamp.ToNanoseconds() - standing.start_ns
    decision.action = "stop_and_wait" if late_ns >= standing.duration_s * 1e9 else "follow"
    decision.label = "deadline_missed"
    delay_s, deadline_s = decision.delay_s, decision.deadline_s
    reason = Reason("deadline_missed", delay_s=delay_s, deadline_s=deadline_s)
    decision.reason = sentence(reason)
    decision.grounds.CopyFrom(reason_message(reason))
    decision.trajectory.CopyFrom(trajectory_message(standing))
    decision.committed_length_m = _length(standing.path)
    decision.ClearField("guide")


class StageClock:
    """Wall time of each stage of one decision."""

    def __init__(self, sense_ms: float) -> None:
        """Start the first stage; `sense_ms` is what the sweeps took before."""
        self._ms = {"sense": sense_ms}
        self._began = time.perf_counter()

    def end(self, stage: str) -> None:
        """End a stage, and start the next."""
        now = time.perf_counter()
        self._ms[stage] = (now - self._began) * 1e3
        self._began = now

    def write(self, stages: pb.StageLatency, within_plan_s: float) -> None:
        """Write all of them; distances worked out while planning are the costmap's."""
        caught_up_ms = within_plan_s * 1e3
        stages.sense_ms, stages.map_ms = self._ms["sense"], self._ms["map"]
        stages.costmap_ms = self._ms["costmap"] + caught_up_ms
        stages.plan_ms = self._ms["plan"] - caught_up_ms


def _path_cost(view: View, guide: Array | None) -> float:
    weight = view.planner.clearance_weight
    return 0.0 if guide is None else view.passable.path_cost(guide, weight)


def _length(path: Array | None) -> float:
    if path is None or len(path) < 2:
        return 0.0
    return float(np.sqrt(np.square(np.diff(path, axis=0)).sum(axis=1)).sum())
