"""The record of a decision in the log: its inputs, the command and why, and stage latencies."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.decision import add_points, thinned, trajectory_message
from wayproof.harness.geometry import polyline_length
from wayproof.harness.inputs import Inputs
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.mapping import Mapper
from wayproof.harness.stack.provenance import evidence_along
from wayproof.harness.stack.reasons import Reason, reason_message, sentence
from wayproof.harness.stack.types import Command, PlannerInput
from wayproof.maps import Costmap
from wayproof.planners import Trajectory

Array = NDArray[np.float64]


def record(
    inputs: Inputs,
    planner_input: PlannerInput,
    command: Command,
    mapper: Mapper,
    inflation_radius: float,
    version: str,
) -> pb.Decision:
    """Write a decision down; delay and chain come when it is committed.

    Args:
        inputs: Sweeps and pose that it was made on.
        planner_input: Input of the decision, for the footprint chosen.
        command: Command that was decided.
        mapper: Map and costmap that it rests on.
        inflation_radius: Inflation radius of the footprint chosen, m.
        version: Version of the map.
    """
    path, search, config = command.trajectory.path, command.search, mapper.costmap.config
    reason = with_named_cell(command.reason, mapper.costmap)
    decision = pb.Decision(
        sequence=inputs.sequence,
        trigger=f"{inputs.sweeps[0].sensor} sweep" if inputs.sweeps else "pose",
        representation=mapper.map.config.kind,
        map_version=version,
        resolution_m=mapper.map.resolution,
        unknown_policy=config.unknown_policy,
        inflation_radius_m=inflation_radius,
        localization_margin_m=mapper.costmap.margin,
        widening=mapper.costmap.widening if any(mapper.costmap.widening) else (),
        collision_distance_sq=planner_input.traversable.collision_distance_sq,
        position=inputs.pose.position.tolist(),
        quaternion=inputs.pose.quaternion.tolist(),
        position_sigma=inputs.pose.position_sigma,
        input_digest=inputs.digest,
        evidence_age_s=mapper.evidence_age(path, inputs.time_ns),
        planner=planner_input.planner.name if search else "",
        planner_seed=command.search_seed,
        planner_iterations=search.iterations if search else 0,
        path_cost=_path_cost(planner_input, command.global_path),
        path_length_m=_length(command.global_path),
        least_clearance_m=planner_input.known_free.least_clearance(path),
        action=command.action,
        reason=sentence(reason),
        predicate=reason_message(reason),
        label=command.label,
        trajectory=trajectory_message(command.trajectory),
        committed_length_m=_length(path),
    )
    add_points(decision, "global_path", thinned(command.global_path))
    if planner_input.spaces.evidence:
        spaces = planner_input.spaces.evidence
        decision.committed_evidence.CopyFrom(evidence_along(path, spaces))
        decision.global_evidence.CopyFrom(evidence_along(command.global_path, spaces))
    decision.timestamp.FromNanoseconds(inputs.time_ns)
    return decision


def with_named_cell(reason: Reason, costmap: Costmap) -> Reason:
    """Return a reason that names the cell of the map for which one of the costmap blocks."""
    if reason.cell is None or reason.cell_state == "outside":
        return reason
    blocker = costmap.blocker(np.array(reason.cell))
    return replace(reason, cell=blocker.centre, cell_state=blocker.state)


def record_missed_deadline(decision: pb.Decision, standing: Trajectory) -> None:
    """Change a decision past its deadline to the robot's actual action: to follow `standing`."""
    late_ns = decision.timestamp.ToNanoseconds() - standing.start_ns
    decision.action = "stop_and_wait" if late_ns >= standing.duration_s * 1e9 else "follow"
    decision.label = "deadline_missed"
    delay_s, deadline_s = decision.delay_s, decision.deadline_s
    reason = Reason("late", delay_s=delay_s, deadline_s=deadline_s)
    decision.reason = sentence(reason)
    decision.predicate.CopyFrom(reason_message(reason))
    decision.trajectory.CopyFrom(trajectory_message(standing))
    decision.committed_length_m = _length(standing.path)
    for evidence in ("committed_evidence", "global_evidence"):  # of paths that are discarded
        decision.ClearField(evidence)
    decision.ClearField("global_path")
    decision.ClearField("verdict")  # of a command that nobody follows


class StageClock:
    """Wall time of each stage of one decision."""

    def __init__(self, sense_ms: float) -> None:
        """Start the first stage; `sense_ms` is the wall time of the sweeps before."""
        self._ms = {"sense": sense_ms}
        self._began = time.perf_counter()

    def end(self, stage: str) -> None:
        """End a stage, and start the next."""
        now = time.perf_counter()
        self._ms[stage] = (now - self._began) * 1e3
        self._began = now

    def write(self, stages: pb.StageLatency) -> None:
        """Write all latencies."""
        for stage, ms in self._ms.items():
            setattr(stages, f"{stage}_ms", ms)


def _path_cost(planner_input: PlannerInput, global_path: Array | None) -> float:
    weight = planner_input.planner.clearance_weight
    return 0.0 if global_path is None else planner_input.optimistic.path_cost(global_path, weight)


def _length(path: Array | None) -> float:
    return 0.0 if path is None else polyline_length(path)
