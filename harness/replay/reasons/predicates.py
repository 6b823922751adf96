"""Predicates by kind of reason, computed again from map, pose and earlier decisions.

A predicate yields a text for each part that is false. Paths in a log are thinned, so lengths along
them are compared with the tolerances `along.ARC` and `along.ARC_SHARE`, and collisions along them
are checked with a body that is one cell smaller.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from wayproof.harness.replay.reasons import (
    commanded,
    driving,
    elsewhere,
    stopping,
    uncertain,
    waiting,
)
from wayproof.harness.replay.reasons.past import Past
from wayproof.harness.replay.reasons.scene import Scene
from wayproof.harness.schema import wayproof_pb2 as pb

Claim = Callable[[Scene, Past, pb.Reason], Iterator[str]]

PREDICATES: dict[str, Claim] = {
    "path_to_goal": driving.path_to_goal,
    "braking_to_goal": driving.braking_to_goal,
    "path_to_corner": driving.path_to_corner,
    "unknown_ahead": driving.driving_ahead,
    "blocked_ahead": driving.driving_ahead,
    "through_unknown": driving.through_unknown,
    "turning_into_path": driving.turning_into_path,
    "stepping_aside": driving.stepping_aside,
    "stepping_to_pose": driving.stepping_to_pose,
    "keeping_course": driving.keeping_course,
    "looking_elsewhere": elsewhere.looking_elsewhere,
    "at_viewpoint": elsewhere.at_viewpoint,
    "backing_up": elsewhere.backing_up,
    "off_trajectory": elsewhere.off_trajectory,
    "returning_to_held": uncertain.returning_to_held,
    "pose_lost": uncertain.pose_lost,
    "goal_uncertain": uncertain.goal_uncertain,
    "escaping_inflation": elsewhere.escaping_inflation,
    "turning_out_of_inflation": elsewhere.turning_out_of_inflation,
    "braking_before_unknown": stopping.braking_ahead,
    "braking_before_blocked": stopping.braking_ahead,
    "path_too_short": stopping.path_too_short,
    "goal_place_moved": stopping.goal_place_moved,
    "coming_to_rest": stopping.coming_to_rest,
    "waiting_before_unknown": waiting.waiting_ahead,
    "waiting_before_blocked": waiting.waiting_ahead,
    "no_path_in_map": waiting.no_path_in_map,
    "no_path_found": waiting.no_path_found,
    "goal_blocked": waiting.goal_blocked,
    "goal_inside_inflation": waiting.goal_inside_inflation,
    "no_room_to_turn": waiting.no_room,
    "no_room_along_path": waiting.no_room,
    "no_way_out": waiting.no_way_out,
    "way_out_blocked": waiting.way_out_blocked,
    "at_goal": stopping.at_goal,
    "deadline_missed": stopping.deadline_missed,
    "commanded": commanded.commanded,
    "commanded_without_proof": commanded.commanded_without_proof,
    "guard_braking": commanded.guard_braking,
}
"""Predicate of each kind of reason."""
