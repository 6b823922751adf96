"""Curves of an episode over simulated time: clearance, speed, error of the pose, latency."""

from __future__ import annotations

import math

import numpy as np

from wayproof.harness.attribution.case import yaw_of
from wayproof.harness.config import Config
from wayproof.harness.prediction_config import NO_PREDICTOR
from wayproof.harness.viewer.moments import Moment

PLOTS = {
    "clearance": "true clearance, m",
    "speed": "true speed, m/s",
    "pose": "error of the pose and margin, m",
    "heading": "error of the heading, degrees",
    "path": "committed path, m",
    "latency": "stages, ms, without the first decision",
    "delay": "delay and deadline, ms, without the first decision",
}
"""Names of the plots: one unit to a plot."""

STYLES = {
    "clearance/true_m": ("true clearance", 0x2E9E4FFF),
    "speed/true_m_s": ("true speed", 0xB0B0B0FF),
    "path/committed_m": ("committed path", 0x3C6EEBFF),
    "pose/error_m": ("error", 0xFF4040FF),
    "pose/margin_m": ("margin", 0x00B8D9FF),
    "heading/error_deg": ("error of the heading", 0xFF4040FF),
    "latency/sense_ms": ("sense", 0x9696A0FF),
    "latency/map_ms": ("map", 0x3C6EEBFF),
    "latency/costmap_ms": ("costmap", 0xE0A000FF),
    "latency/plan_ms": ("plan", 0x2E9E4FFF),
    "delay/delay_ms": ("delay", 0x00B8D9FF),
    "delay/deadline_ms": ("deadline", 0xFF4040FF),
}
"""Names and colours of the curves."""

BY_PROVENANCE = {
    "path/committed_unmeasured_m": ("of it not measured", 0xFF4040FF),
    "path/global_measured_m": ("global path, measured", 0x2E9E4FFF),
    "path/global_prior_m": ("global path by the prior map", 0xE0A000FF),
    "path/global_predicted_m": ("global path, predicted", 0x9650C8FF),
    "path/global_unproven_m": ("global path, by nothing", 0x9696A0FF),
}
"""Those of curves that only a log with a prior map or predictions has."""

PREDICTED = "path/global_predicted_m"


def styles(config: Config) -> dict[str, tuple[str, int]]:
    """Return names and colours of a log's curves; those of predictions name their source."""
    if not config.has_layers:
        return STYLES
    found, (words, colour) = STYLES | BY_PROVENANCE, BY_PROVENANCE[PREDICTED]
    if (source := config.prediction.source) != NO_PREDICTOR:
        found[PREDICTED] = f"{words} by {source}", colour
    if config.runs_predictor:
        found["latency/predict_ms"] = "predictor, beside them", colour
    return found


def curves(moment: Moment, axes: int) -> dict[str, float]:
    """Return the values of the curves at a moment, by name.

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
        pose = moment.record.inputs.pose
        turn = yaw_of(pose.quaternion.tolist()) - yaw_of(truth.quaternion)
        found |= {
            "clearance/true_m": truth.clearance_m,
            "pose/error_m": math.dist(pose.position[:axes], truth.position[:axes]),
            "pose/margin_m": decision.localization_margin_m,
            "heading/error_deg": math.degrees(math.remainder(turn, 2.0 * math.pi)),
        }
    if decision.sequence:
        each = ("sense", "map", "costmap", "plan", *(["predict"] if stages.predict_ms else []))
        found |= {f"latency/{name}_ms": getattr(stages, f"{name}_ms") for name in each}
        found |= {
            "delay/delay_ms": decision.delay_s * 1e3,
            "delay/deadline_ms": decision.deadline_s * 1e3,
        }
    return found
