"""Settings by their former names: in older logs and studies."""

from __future__ import annotations

from typing import Any

POSE_MODEL = (
    *("rate", "scale_sigma", "yaw_scale_sigma", "random_walk", "yaw_random_walk", "bias_sigma"),
    *("yaw_bias_sigma", "leg_height_sigma", "correlation_time", "white_noise", "yaw_white_noise"),
)
"""Settings of the section `pose_model`, which was `odometry`."""

RENAMED = {
    "map.hit": "map.log_odds_hit",
    "map.miss": "map.log_odds_miss",
    "map.clamp_low": "map.prob_min",
    "map.clamp_high": "map.prob_max",
    "map.hold_under_body": "map.no_decay_radius",
    "map.surface_guard": "map.floor_grazing_filter",
    "map.band_low": "map.min_obstacle_height",
    "map.band_high": "map.max_obstacle_height",
    "map.inflation_margin": "costmap.localization_margin",
    "map.cost_scaling_factor": "costmap.cost_scaling_factor",
    "map.cost_range": "costmap.cost_range",
    "map.unknown_policy": "costmap.unknown_policy",
    "map.class_margins": "costmap.class_margins",
    "map.max_slope": "costmap.max_slope",
    "map.dynamic_after": "map.dynamic.burn_in",
    "map.dynamic_at_once": "map.dynamic.flag_on_first_hit",
    "map.vacated_after": "map.dynamic.free_after_misses",
    "map.static_after": "map.dynamic.static_after",
    "map.look_ahead": "map.dynamic.prediction_horizon",
    "odometry.scale": "pose_model.scale_sigma",
    "odometry.turn_scale": "pose_model.yaw_scale_sigma",
    "odometry.walk": "pose_model.random_walk",
    "odometry.turn_walk": "pose_model.yaw_random_walk",
    "odometry.sigma": "pose_model.bias_sigma",
    "odometry.turn_sigma": "pose_model.yaw_bias_sigma",
    "odometry.legs_sigma": "pose_model.leg_height_sigma",
    "odometry.jitter": "pose_model.white_noise",
    "odometry.turn_jitter": "pose_model.yaw_white_noise",
    **{f"odometry.{name}": f"pose_model.{name}" for name in POSE_MODEL},
    "behaviour.patience": "behaviour.wait_timeout",
    "behaviour.tries": "behaviour.max_recoveries",
    "behaviour.backups": "behaviour.max_backtracks",
    "behaviour.backup_length": "behaviour.backtrack_length",
    "behaviour.turn_first": "behaviour.rotate_in_place_angle",
    "behaviour.stop_corner": "behaviour.max_corner_angle",
    "behaviour.least_advance": "behaviour.min_advance",
    "behaviour.improve_period": "behaviour.replan_period",
    "behaviour.goal_reach": "behaviour.goal_search_radius",
    "behaviour.goal_patience": "behaviour.goal_wait_timeout",
    "behaviour.backwards_speed": "behaviour.reverse_speed_fraction",
    "behaviour.penalized_speed": "behaviour.unknown_speed_fraction",
    "planner.keep_ratio": "planner.switch_ratio",
    "planner.corner_price": "planner.corner_cost",
}
"""Former key of a setting -> its key."""

FORMER_VALUES: dict[str, dict[str, Any]] = {
    "planner.name": {"field": "astar"},
    "map.floor_grazing_filter": {"floor": True, "none": False},
}
"""Former values of a setting, by its key."""


def renamed(key: str) -> str:
    """Return the key of a setting, given that or its former one."""
    return RENAMED.get(key, key)


def current_value(key: str, value: Any) -> Any:
    """Return the value of a setting, given that or its former one."""
    return FORMER_VALUES.get(key, {}).get(value, value) if isinstance(value, str) else value


def with_current_names(document: Any) -> Any:
    """Return a config's JSON document with every setting under its current name.

    What is no document of sections is returned as it is, for the check of its types to refuse.
    """
    if not isinstance(document, dict):
        return document
    current = {
        name: dict(section) if isinstance(section, dict) else section
        for name, section in document.items()
    }
    for former, key in RENAMED.items():
        section, _, name = former.partition(".")
        fields = current.get(section)
        if not isinstance(fields, dict) or name not in fields:
            continue
        _put(current, key, current_value(key, fields.pop(name)))
    return current


def _put(document: dict[str, Any], key: str, value: Any) -> None:
    *path, name = key.split(".")
    for part in path:
        document = document.setdefault(part, {})
    document.setdefault(name, value)
