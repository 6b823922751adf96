"""Sensors of the simulated robot: sweeps and pose of one instant, as they reach the stack."""

from __future__ import annotations

import time

from wayproof.harness.input_messages import decode_ranges
from wayproof.harness.inputs import SweepInput
from wayproof.harness.listed_beams import CODEC
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.sim.injector import PerturbationInjector
from wayproof.harness.sim.simulation import Simulation
from wayproof.models.poses import Trail
from wayproof.models.scene import Scene
from wayproof.models.sensors import codecs
from wayproof.models.sensors.caster import Caster


class Sensors:
    """One scene's ray sensors and pose estimate, with the episode's perturbation applied."""

    def __init__(
        self, scene: Scene, simulation: Simulation, injector: PerturbationInjector
    ) -> None:
        """Cast rays into the scene of a simulation."""
        self._scene, self._simulation, self._injector = scene, simulation, injector

    def sense(self, sequence: int, time_ns: int) -> tuple[list[pb.Sweep], pb.Pose, float]:
        """Cast the sweeps that reach the stack, and estimate the pose.

        Args:
            sequence: Number of the decision.
            time_ns: Simulated time.

        Returns:
            Sweeps, pose, and the wall time of the casting, ms.
        """
        self._simulation.place_geometry()
        began = time.perf_counter()
        trail, estimate = self._simulation.trail(), self._simulation.estimate
        self._injector.begin_decision(sequence)
        sent = [self._sweep(one, trail, sequence, time_ns) for one in self._scene.casters]
        sweeps = self._injector.sweeps(sent)
        sense_ms = (time.perf_counter() - began) * 1e3
        estimate.advance(time_ns, trail.positions[-1], trail.quaternions[-1])
        rolling = self._simulation.rolling
        if estimate.registers:
            inputs = [
                SweepInput(sweep.sensor, decode_ranges(sweep), lag=sweep.lag)
                for sweep in sweeps
                if not sweep.age_ns  # it is registered at its own time or not at all
            ]
            estimate.correct(sequence, trail, rolling, inputs)
        pose = estimate.pose(trail, rolling)
        pose.sequence = sequence
        pose.timestamp.FromNanoseconds(time_ns)
        return sweeps, self._injector.pose(pose), sense_ms

    def _sweep(self, caster: Caster, trail: Trail, sequence: int, time_ns: int) -> pb.Sweep:
        table = caster.table
        rows = table.image_rows
        ranges, classes = self._injector.cast(caster, self._simulation.data, trail, sequence)
        message = pb.Sweep(
            sequence=sequence,
            sensor=caster.mount.name,
            rows=rows,
            columns=table.beams // rows,
            codec=CODEC,
            ranges=codecs.encode_image(ranges, rows),
            classes=classes.tobytes(),
        )
        message.timestamp.FromNanoseconds(time_ns)
        return message
