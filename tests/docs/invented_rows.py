"""Invented rows of benchmarks, so that pages that show them measure nothing."""

from wayproof.harness.bench.episodes import crossing as bench_crossing
from wayproof.harness.bench.episodes import worlds as bench_worlds
from wayproof.models.worlds import WORLDS

MAP_ROWS = (
    [
        {
            "part": "speed",
            "resolution_m": 0.1,
            "range_m": 10.0,
            "library": library,
            "mode": "clamped",
            "threads": 1,
            "ms_per_sweep": ms,
            "ms_p99": ms,
            "ratio_vs_pyoctomap": ratio,
            "map_mib": 1.0,
        }
        for library, ms, ratio in (("wayproof", 2.0, 4.0), ("pyoctomap", 8.0, 1.0))
    ]
    + [
        {
            "part": "ghosts",
            "library": "wayproof",
            "clamp_high": clamp,
            "half_life_s": 0.0,
            "unseen_s": 0.0,
            "sweeps_to_free": sweeps,
            "sweeps_by_formula": sweeps,
        }
        for clamp, sweeps in ((0.8, 4), (0.97, 9))
    ]
    + [
        {
            "part": "accuracy",
            "resolution_m": 0.1,
            "library": "wayproof",
            "mode": "clamped",
            "floor_columns_lost": 0.01,
            "false_free": 0.02,
        },
    ]
)
"""Invented rows in the form of `bench map`, written to a folder of their own."""

EPISODE = {"seed": 0, "outcome": "success", "time_s": 9.0, "clearance_m": 0.3, "reason": "at rest"}

CROSSING_ROWS = [
    {"robot": robot, "way": way, "own": 0, "at_rest": 0, "cause": "", **EPISODE}
    for robot in bench_crossing.ROBOTS
    for way in (bench_crossing.ALONE, *bench_crossing.MAPS)
    if (robot, way) != ("drone", bench_crossing.ALONE)
]
WORLD_ROWS = [
    {"world": world, "robot": robot, "spl": 1.0, "struck": 0, **EPISODE}
    for world in WORLDS
    for robot in bench_worlds.ROBOTS
    if (world, robot) != ("empty", "drone")
]
"""Invented rows of all episodes but one, which is run."""
