"""`wayproof bench loop`: whole episodes beside their bare physics, and the time of each stage.

After each episode the same steps of MuJoCo run again, with the same controller and setpoints and
nothing else, and must end at the same bits. `share_of_physics` is the processor time of that over
the processor time of the whole loop: a ratio of two times on one core, it depends less on the host
than times do.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from statistics import median

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.harness.bench.table import Progress, Row
from wayproof.harness.config_document import from_document, override
from wayproof.harness.episode import arrival_ns
from wayproof.harness.recompute.moments import Moment
from wayproof.harness.result import Result
from wayproof.harness.runner import open_episode
from wayproof.harness.scenario.scenario import Scenario, build
from wayproof.harness.sim.simulation import Simulation
from wayproof.harness.warm_up import warm_up
from wayproof.models.robots import Setpoint
from wayproof.planners import Trajectory

WORLD = "warehouse"
STAGES = ("sense", "map", "costmap", "plan")
ROBOTS = ("quadruped", "drone")
LIGHT = ("sensors.lidar=own", "map.resolution=0.1")
DENSE = ("sensors.lidar=ideal-lidar-dense", "map.resolution=0.05")
LOADS = {"light": LIGHT, "dense": DENSE}
"""Name -> settings: 20,000 rays on cells of 10 cm, and 100,000 on 5 cm."""

SETPOINT = 8
"""Numbers of a setpoint."""

Followed = list[tuple[int, Trajectory]]
"""Trajectories with their time of arrival at the robot, ns; the first is that of the beginning."""


def bench_loop(repeats: int, seed: int, progress: Progress) -> list[Row]:
    """Run episodes of both robots under both loads, `repeats` seeds of each; one row for each.

    A row has the `robot` and the `rays` of all its sweeps of a decision; `reached`, the share of
    episodes that ended in success; `physics`, the share of bare physics with control in the
    processor time of the loop, by the median episode; `real`, simulated seconds a second of the
    loop's processor time, and `bare`, the same of bare physics; the median wall time of casting,
    map, costmap and plan of a decision, ms; the median and 99th percentile of the whole decision.
    """
    rows = []
    for robot in ROBOTS:
        for load, settings in LOADS.items():
            measured = []
            for one in range(seed, seed + repeats):
                progress(f"loop: {robot}, {load}, seed {one}")
                document = {"world": WORLD, "robot": robot, "seed": one}
                measured.append(_measure(build(override(from_document(document), settings))))
            rows.append(_row(robot, measured))
    return rows


Measured = tuple[int, Result, float, float, NDArray[np.float64]]
"""Rays of a decision, result, processor time of the loop and of bare physics, s, and times of the
stages (decisions, stages), ms."""


def _measure(scenario: Scenario) -> Measured:
    warm_up(scenario.config)
    scenario.route_length()  # known from here on
    stages: list[list[float]] = []
    followed: Followed = []
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "episode.mcap"

        def note(moment: Moment) -> None:
            decision = moment.decision
            stages.append([getattr(decision.stages, f"{stage}_ms") for stage in STAGES])
            if not decision.deadline_missed:
                trajectory = opened.navigator.trajectory
                followed.append((arrival_ns(decision, trajectory), trajectory))

        with open_episode(scenario, log, note) as opened:
            followed.append((0, opened.navigator.trajectory))
            began = time.process_time()
            opened.episode.run()
            result = opened.end()
            loop = time.process_time() - began
    bare = bare_seconds(scenario, followed, round(result.sim_time_s * 1e9))
    rays = sum(caster.table.beams for caster in scenario.scene.casters)
    return rays, result, loop, bare, np.array(stages)


def bare_seconds(scenario: Scenario, followed: Followed, end_ns: int) -> float:
    """Return the processor time of an episode's physics and controller alone, s.

    Args:
        scenario: Scenario of the episode.
        followed: Trajectories that its robot followed.
        end_ns: Its end, ns.

    Raises:
        RuntimeError: It ends elsewhere, so it was another motion.
    """
    simulation = Simulation(scenario, followed[0][1])
    simulation.enqueue(followed[1:])
    setpoints = b""
    while simulation.now_ns < end_ns:
        simulation.step(save=False)
        setpoints += simulation.drain_setpoints()
    rows = [Setpoint.of(row) for row in np.frombuffer(setpoints).reshape(-1, SETPOINT)]
    scene, mission = scenario.scene, scenario.mission
    for some in (rows[:1], rows):  # the first compiles what the loop's steps do not need
        data = mujoco.MjData(scene.model)
        scene.controller.reset(data, np.array(mission.start), mission.start_heading)
        began = time.process_time()
        for row in some:
            scene.controller.follow(data, row)
            mujoco.mj_step(scene.model, data)
        seconds = time.process_time() - began
    if data.xpos[scene.base].tolist() != simulation.position.tolist():
        raise RuntimeError("the physics alone ended elsewhere than the episode")
    return seconds


def _row(robot: str, measured: list[Measured]) -> Row:
    table = np.concatenate([one[4] for one in measured])
    decisions = table.sum(axis=1)
    stages = dict(zip(STAGES, np.median(table, axis=0).tolist(), strict=True))
    return {
        "robot": robot,
        "rays": measured[0][0],
        "reached": float(np.mean([one[1].outcome == "success" for one in measured])),
        "physics": median(bare / loop for _, _, loop, bare, _ in measured),
        "real": median(result.sim_time_s / loop for _, result, loop, _, _ in measured),
        "bare": median(result.sim_time_s / bare for _, result, _, bare, _ in measured),
        **stages,
        "ms": float(np.median(decisions)),
        "ms_p99": float(np.percentile(decisions, 99)),
    }
