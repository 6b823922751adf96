"""Words of a decision: above a picture, and for stepping through a log."""

from __future__ import annotations

import math
import textwrap

import numpy as np

from wayproof.harness.clearance import in_metres, map_clearance_is_bound, true_in_metres
from wayproof.harness.decision import widened_in_words
from wayproof.harness.explain.commanded import Commanded, command_in_words
from wayproof.harness.inputs import Pose
from wayproof.harness.log.paths import length
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.viewer.moments import Moment

INTENDED = ("follow", "explore", "goal")
"""Actions without an obstruction."""

WIDTH = 110
"""Characters of a line above a picture."""


def is_warning(decision: pb.Decision) -> bool:
    """Return whether something obstructs the robot, or a command is not admitted.

    The far end of a path is mostly unknown: following it up to there is no warning.
    """
    if decision.verdict.verdict not in ("", "admitted"):
        return True
    return decision.action not in INTENDED or decision.label == "deadline_missed"


def describe(
    decision: pb.Decision,
    cost_range: float,
    commanded: Commanded | None = None,
    pose: Pose | None = None,
    truth: pb.Truth | None = None,
) -> str:
    """Return the text of a decision in Markdown.

    Args:
        decision: Logged decision.
        cost_range: `costmap.cost_range` of its config, m.
        commanded: Command of a stack on trial; None of the built-in stack.
        pose: Estimated pose, to compare with the truth.
        truth: Ground truth; of a recording, which has none, its clearance is not a number.
    """
    is_bound = map_clearance_is_bound(decision, cost_range)
    stages = decision.stages
    label = "" if decision.label == "none" else f" · label `{decision.label}`"
    missed = " · **deadline missed**" if decision.deadline_missed else ""
    search = "the path was kept"
    if decision.planner:
        search = f"{decision.planner}, seed {decision.planner_seed}"
        search += f", {decision.planner_iterations} iterations"
    path = f"{decision.path_length_m:.2f} m" if len(decision.global_path) else "no path"
    delay, deadline = decision.delay_s * 1e3, decision.deadline_s * 1e3
    return "\n".join(
        [
            f"### {decision.sequence}: {decision.action}{label}",
            f"{decision.reason}",
            "",
            *([] if commanded is None else _stack_lines(decision, commanded)),
            f"- map `{decision.map_version[:12]}` ({decision.representation}, "
            f"{decision.resolution_m:g} m), unknown policy `{decision.unknown_policy}`",
            f"- inflation {decision.inflation_radius_m:.3f} m, of it margin "
            f"{decision.localization_margin_m:.3f} m{widened_in_words(decision)}",
            *_truth_lines(pose, truth),
            f"- oldest evidence along the path {decision.evidence_age_s:.2f} s",
            f"- committed {decision.committed_length_m:.2f} m of {path}, "
            f"least clearance {in_metres(decision.least_clearance_m, is_bound)}",
            f"- search: {search}",
            f"- delay {delay:.0f} ms of {deadline:.0f} ms{missed}",
            f"- stages, ms: sense {stages.sense_ms:.1f}, map {stages.map_ms:.1f}, costmap "
            f"{stages.costmap_ms:.1f}, plan {stages.plan_ms:.1f}",
        ]
    )


def _truth_lines(pose: Pose | None, truth: pb.Truth | None) -> list[str]:
    if pose is None or truth is None or math.isnan(truth.clearance_m):
        return []
    error = float(np.linalg.norm(pose.position - np.array(truth.position)))
    clearance = true_in_metres(truth.clearance_m)
    return [f"- truth: pose {error:.3f} m off, clearance {clearance}"]


def _stack_lines(decision: pb.Decision, commanded: Commanded) -> list[str]:
    plan = length(commanded.planned_path) if len(commanded.planned_path) else 0.0
    return [
        f"- stack: {command_in_words(commanded.message)}",
        f"- referee: **{commanded.verdict}**, free for {decision.verdict.free_m:.2f} m"
        + ("; the guard braked in its place" if commanded.cut else ""),
        f"- its planned path: {f'{plan:.2f} m' if plan else 'none'}",
    ]


def head(moment: Moment, cost_range: float, axes: int) -> list[str]:
    """Return the lines above a picture: time, decision, action and label; figures; reason.

    Args:
        moment: The decision.
        cost_range: `costmap.cost_range` of its config, m.
        axes: Number of axes that the pose error is over: 2 on the ground, 3 in the air.
    """
    decision, truth = moment.decision, moment.truth
    label = "" if decision.label == "none" else f" [{decision.label}]"
    first = f"decision {decision.sequence}, {moment.time_ns * 1e-9:.1f} s: {decision.action}{label}"
    mapped = in_metres(decision.least_clearance_m, map_clearance_is_bound(decision, cost_range))
    off = math.dist(moment.record.inputs.pose.position[:axes], truth.position[:axes])
    known = not math.isnan(truth.clearance_m)  # a recording has no truth
    now = f"{true_in_metres(truth.clearance_m)}, " if known else ""
    figures = f"clearance {now}in the map along the path {mapped}; pose error {off:.2f} m"
    reason = decision.reason
    if moment.commanded is not None:
        reason = f"referee: {moment.commanded.verdict}. {reason}"
    return [first, figures, *textwrap.wrap(reason, WIDTH)]
