"""Round trips of a ROS 2 stack: a sweep out, its command back, over and over.

Start a node that answers sweeps, then `python -m tests.tools.ros2_latency --steps 1000`.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import numpy as np

from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.input_messages import beams_from_info
from wayproof.harness.inputs import Inputs, Pose, SweepInput
from wayproof.harness.interface.observations import ObservationBuilder, task_of
from wayproof.harness.interface.ros2.stack import REPEAT_S, Ros2Stack
from wayproof.harness.scenario.scenario import build, sensor_info
from wayproof.planners import hold

RANGE_MM = 3000
"""Range that every beam reports, mm, so that all of them are in the cloud."""


def main() -> None:
    """Print the latency of a step, and how often a sweep had to be sent again."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=1000)
    parser.add_argument("--lidar", default="own", help="device; ideal-lidar-dense: 100,000 beams")
    parser.add_argument("--stack", default="ros2:pace=lockstep")
    options = parser.parse_args()
    latencies = measure(options.stack, options.lidar, options.steps)
    p50, p99 = np.quantile(latencies, (0.5, 0.99)) * 1e3
    again = int((latencies >= REPEAT_S).sum())
    print(
        f"{options.lidar}: {len(latencies)} steps, p50 {p50:.2f} ms, p99 {p99:.2f} ms, most "
        f"{latencies.max() * 1e3:.1f} ms; sent again {again}"
    )


def measure(name: str, lidar: str, steps: int) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Return the wall time of each step but the first, s."""
    settings = [f"sensors.lidar={lidar}", f"stack.name={name}"]
    config = override(Config("empty", "quadruped", 1), settings)
    scenario = build(config)
    infos = {info.name: info for info in map(sensor_info, scenario.scene.casters)}
    beams = {one: beams_from_info(info) for one, info in infos.items()}
    sweeps = tuple(
        SweepInput(one, np.full(info.beams, RANGE_MM, np.uint16), None)
        for one, info in infos.items()
    )
    start = np.array(scenario.mission.start)
    pose = Pose(start, np.array([1.0, 0.0, 0.0, 0.0]), 0.0)
    builder = ObservationBuilder(config, scenario.mission, beams)
    observation = builder.build(
        Inputs(time_ns=0, sequence=0, pose=pose, sweeps=sweeps, digest=""),
        hold(start, 0, 0.0),
        None,
    )
    stack = Ros2Stack(name, wall_s=60.0, starting_s=60.0)
    stack.start(task_of(config, scenario.mission, infos))
    latencies = []
    for sequence in range(steps + 1):
        began = time.perf_counter()
        stack.query(replace(observation, time_ns=sequence * 100_000_000, sequence=sequence))
        latencies.append(time.perf_counter() - began)
    stack.close()
    return np.array(latencies[1:])


if __name__ == "__main__":
    main()
