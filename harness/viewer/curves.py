"""Curves of an episode over simulated time: clearance, speed, error of the pose, latency."""

from __future__ import annotations

import math

import numpy as np

from wayproof.harness.attribution.case import yaw_of
from wayproof.harness.viewer.snapshots import Snapshot


def curves(moment: Snapshot, axes: int) -> dict[str, float]:
    """Return the values of the curves over simulated time, by name; one unit to a plot.

    The first decision's latency is left out: it is a hundred times that of others, which would
    lie on the axis.

    Args:
        moment: The moment.
        axes: Number of axes of a position that count.
    """
    decision, truth, stages = moment.decision, moment.truth, moment.decision.stages
    found = {
        "speed/true_m_s": float(np.linalg.norm(truth.velocity)),
        "path/committed_m": decision.committed_length_m,
    }
    if decision.HasField("global_evidence"):
        committed, ahead = decision.committed_evidence, decision.global_evidence
        found |= {
            "path/committed_unmeasured_m": committed.prior_m + committed.predicted_m,
            "path/global_measured_m": ahead.measured_m,
            "path/global_prior_m": ahead.prior_m,
            "path/global_predicted_m": ahead.predicted_m,
            "path/global_unproven_m": ahead.unproven_m,
        }
    if not math.isnan(truth.clearance_m):  # a recording has no truth
        true, believed = np.array(truth.position), moment.pose.position
        turn = yaw_of(moment.pose.quaternion.tolist()) - yaw_of(truth.quaternion)
        found |= {
            "clearance/true_m": truth.clearance_m,
            "pose/error_m": float(np.linalg.norm((believed - true)[:axes])),
            "pose/margin_m": decision.localization_margin_m,
            "heading/error_deg": math.degrees(math.remainder(turn, 2.0 * math.pi)),
        }
    if decision.sequence:
        found |= {
            "latency/sense_ms": stages.sense_ms,
            "latency/map_ms": stages.map_ms,
            "latency/costmap_ms": stages.costmap_ms,
            "latency/plan_ms": stages.plan_ms,
            "delay/delay_ms": decision.delay_s * 1e3,
            "delay/deadline_ms": decision.deadline_s * 1e3,
        }
    if stages.predict_ms:
        found["latency/predict_ms"] = stages.predict_ms
    return found
