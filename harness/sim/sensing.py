"""What the simulated robot senses at one instant: sweeps and pose, as they reach the stack."""

from __future__ import annotations

import time

import mujoco

from wayproof.harness.inputs import CODEC
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.sim.injector import PerturbationInjector
from wayproof.harness.sim.simulation import Plant
from wayproof.models.poses import Trail
from wayproof.models.scene import Scene
from wayproof.models.sensors import range_codec
from wayproof.models.sensors.caster import Caster


class Sensors:
    """One scene's ray sensors and pose estimate, with the episode's perturbation applied."""

    def __init__(self, scene: Scene, plant: Plant, injector: PerturbationInjector) -> None:
        """Cast into what `plant` simulates."""
        self._scene, self._plant, self._injector = scene, plant, injector

    def sense(self, sequence: int, time_ns: int) -> tuple[list[pb.Sweep], pb.Pose, float]:
        """Cast the sweeps that arrive and estimate the pose.

        Args:
            sequence: Number of the decision that they are for.
            time_ns: Simulated time.

        Returns:
            Sweeps, pose, and the wall time of the casting, ms.
        """
        mujoco.mj_kinematics(self._scene.model, self._plant.data)
        began = time.perf_counter()
        trail, estimate = self._plant.trail(), self._plant.estimate
        arriving = self._injector.arriving(self._scene.casters, sequence)
        sweeps = [self._sweep(caster, trail, sequence, time_ns) for caster in arriving]
        sense_ms = (time.perf_counter() - began) * 1e3
        estimate.advance(time_ns, trail.positions[-1], trail.quaternions[-1])
        pose = estimate.pose(trail, self._plant.rolling)
        pose.sequence = sequence
        pose.timestamp.FromNanoseconds(time_ns)
        return sweeps, pose, sense_ms

    def _sweep(self, caster: Caster, trail: Trail, sequence: int, time_ns: int) -> pb.Sweep:
        table = caster.table
        rows = len(table.rows) if table.order == "grid" else 1
        ranges, classes = self._injector.cast(caster, self._plant.data, trail, sequence)
        message = pb.Sweep(
            sequence=sequence,
            sensor=caster.mount.name,
            rows=rows,
            columns=table.beams // rows,
            codec=CODEC,
            ranges=range_codec.encode(ranges, rows),
            classes=classes.tobytes(),
        )
        message.timestamp.FromNanoseconds(time_ns)
        return message
