"""Follow the Gap on points about the robot (Sezer and Gokasan 2012); numpy alone, no ROS."""

import math

import numpy as np

BEARINGS = 180  # directions around the body that are kept apart
REACH = 4.0  # m, range within which returns count
LENGTH = 0.60  # m, radius about the body and a margin
WIDTH = 0.40  # m, half its width and a margin: it goes along its axis
KEEP = 0.5  # cost of a turn away from the last course, as a share of one away from the goal
AHEAD = 1.5  # s, time in which the free range ahead would be driven; it sets the speed
MAX_SPEED, MAX_YAW_RATE = 1.0, 1.0  # m/s, rad/s
ARRIVED = 0.12  # m

CENTRES = (np.arange(BEARINGS) + 0.5) * (2.0 * math.pi / BEARINGS) - math.pi


class Gap:
    """Steers into the free direction nearest to the goal's; keeps its course between two alike."""

    def __init__(self):
        """Start without a course."""
        self.course = None  # rad, world

    def step(self, points, goal, heading):
        """Forward speed, m/s, and yaw rate, rad/s.

        Args:
            points: (n, 2) obstacles, m, body frame.
            goal: (2,) m, body frame.
            heading: rad, world.
        """
        away = math.hypot(*goal)
        if away <= ARRIVED:
            return 0.0, 0.0
        free = free_ranges(points)
        course = heading if self.course is None else self.course
        cost = turns(math.atan2(goal[1], goal[0])) + KEEP * turns(course - heading)
        cost += 4.0 * np.maximum(1.0 - free / min(REACH, max(away, 1.0)), 0.0)
        best = int(np.argmin(cost))
        bearing, room = float(CENTRES[best]), float(free[best])
        self.course = heading + bearing
        yaw_rate = max(-MAX_YAW_RATE, min(MAX_YAW_RATE, 2.0 * bearing))
        if abs(bearing) > 0.5:
            return 0.0, yaw_rate
        return min(MAX_SPEED, room / AHEAD, away), yaw_rate


def free_ranges(points):
    """Free range of the body's centre in each direction, (BEARINGS,) m."""
    distances = np.hypot(points[:, 0], points[:, 1])
    angles = np.arctan2(points[:, 1], points[:, 0])
    bins = ((angles + math.pi) * (BEARINGS / (2.0 * math.pi))).astype(int) % BEARINGS
    nearest = np.full(BEARINGS, np.inf)
    np.minimum.at(nearest, bins, distances)
    free = np.full(BEARINGS, REACH)
    for i in np.flatnonzero(nearest < REACH):
        half = math.asin(min(1.0, WIDTH / max(nearest[i], WIDTH)))
        spread = math.ceil(half * BEARINGS / (2.0 * math.pi))
        covered = (i + np.arange(-spread, spread + 1)) % BEARINGS
        free[covered] = np.minimum(free[covered], max(nearest[i] - LENGTH, 0.0))
    return free


def turns(bearing):
    """Angle from each direction to a bearing, (BEARINGS,) rad."""
    return np.abs((CENTRES - bearing + math.pi) % (2.0 * math.pi) - math.pi)
