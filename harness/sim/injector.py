"""Injection of an episode's perturbation between the simulator and the stack."""

from __future__ import annotations

import math

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.harness.config import Config
from wayproof.harness.perturbations import UNPERTURBED, Report
from wayproof.harness.perturbations.delivery import Delivery
from wayproof.harness.perturbations.perturbation import LATE
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.models.classes import UNKNOWN_CLASS
from wayproof.models.pose_model import PoseError
from wayproof.models.poses import Trail
from wayproof.models.robots.robot import ROBOT_PREFIX
from wayproof.models.scene import Scene
from wayproof.models.sensors.beams import DROPPED, NO_RETURN
from wayproof.models.sensors.caster import Caster


class PerturbationInjector:
    """One episode's perturbation, or none, applied to one scene's sensors and delays.

    Attributes:
        delivery: Delivery of the messages; None where all arrive as they are sent.
    """

    def __init__(self, config: Config, scene: Scene) -> None:
        """Find the sensors that it affects."""
        self._perturbation = config.perturbation or UNPERTURBED
        self._seed = config.seed
        self._labelled = config.sensors.semantics
        self._registers = config.estimate.kind == "lidar"
        self._model = scene.model
        self._sensors = [caster.mount.name for caster in scene.casters]
        self._affected = self._perturbation.affected(self._sensors)
        self._withheld: list[str] = []
        self._displacement = self._perturbation.displacement(config.seed)
        self._changed_beams = 0
        self._rate = scene.casters[0].mount.device.rate  # decisions follow the first sensor
        self._active, self._time_ns = True, 0
        self.delivery: Delivery | None = None
        if self._perturbation.changes in LATE:
            period_ns = round(1e9 / self._rate)
            self.delivery = Delivery(self._perturbation, config.seed, period_ns)

    @property
    def delay(self) -> float:
        """Delay added to the present decision, s."""
        return self._perturbation.delay_at(self._seed, self._time_ns) if self._active else 0.0

    @property
    def _streams(self) -> tuple[str, ...]:
        """Input streams that the perturbation changes; of the lidar's pose with its sweeps."""
        own = self._perturbation.streams(self._sensors)
        sensed = any(name.startswith("sensor/") for name in own)
        return (*own, "pose") if sensed and self._registers else own

    def begin(self, sequence: int) -> None:
        """Begin with the inputs of a decision."""
        self._changed_beams, self._withheld = 0, []
        self._time_ns = round(sequence / self._rate * 1e9)
        self._active = self._perturbation.is_active(self._time_ns)

    def sweeps(self, sent: list[pb.Sweep]) -> list[pb.Sweep]:
        """Return the sweeps that reach the stack in place of those that were sent."""
        if self.delivery is None:
            return sent
        came, withheld = self.delivery.take_sweeps(sent, self._affected)
        self._withheld += withheld
        return came

    def pose(self, sent: pb.Pose) -> pb.Pose:
        """Return the pose that reaches the stack in place of one that was sent."""
        if self.delivery is None or not self._perturbation.delays_pose:
            return sent
        return self.delivery.take("pose", sent) or sent

    def cast(
        self, caster: Caster, data: mujoco.MjData, trail: Trail, sequence: int
    ) -> tuple[NDArray[np.uint16], NDArray[np.uint8]]:  # (n,) mm, (n,) or (0,) classes
        """Cast one sweep as the stack gets it.

        Args:
            caster: Caster of the sensor.
            data: State of MuJoCo.
            trail: True poses of the base.
            sequence: Number of the decision.

        Returns:
            Ranges (n,), mm, and classes (n,), or (0,) without `sensors.semantics`; a beam whose
            echo is lost has no class.
        """
        if not self._active or caster.mount.name not in self._affected:
            return self._measured(caster, data, trail, sequence)
        if self._displacement is not None:
            # Until the next kinematics; nothing else in the episode reads a sensor's site.
            site = self._model.site(ROBOT_PREFIX + caster.mount.site).id
            self._displacement.move_site(data.site_xpos[site], data.site_xmat[site])
            trail = self._displacement.move_trail(trail, *caster.mounting)
        ranges, classes = self._measured(caster, data, trail, sequence)
        mount, table = caster.mount, caster.table
        report = Report(mount.name, mount.device, table, ranges, self._seed, sequence)
        perturbed = self._perturbation.report(report).astype(np.uint16)
        self._changed_beams += int((perturbed != ranges).sum())
        if len(classes):
            silent = (perturbed == DROPPED) | (perturbed == NO_RETURN)
            classes = np.where(silent, np.uint8(UNKNOWN_CLASS), classes)
        return perturbed, classes

    def _measured(
        self, caster: Caster, data: mujoco.MjData, trail: Trail, sequence: int
    ) -> tuple[NDArray[np.uint16], NDArray[np.uint8]]:
        """Return ranges as the device reports them, and classes where `sensors.semantics` is on."""
        if self._labelled:
            return caster.cast_labelled(data, trail, self._seed, sequence)
        return caster.cast(data, trail, self._seed, sequence), np.empty(0, np.uint8)

    def message(self, sequence: int, time_ns: int, added: PoseError) -> pb.Perturbation | None:
        """Encode the perturbation of this decision for the log; None if unperturbed.

        Args:
            sequence: Number of the decision.
            time_ns: Simulated time.
            added: Error added to the pose.
        """
        perturbation = self._perturbation
        if perturbation is UNPERTURBED:
            return None
        message = pb.Perturbation(
            sequence=sequence,
            kind=perturbation.kind,
            severity=math.ceil(perturbation.severity),
            exact_severity=perturbation.severity,
            amount=perturbation.amount if self._active else perturbation.nothing,
            unit=perturbation.unit,
            streams=self._streams,
            pose_shift=added.shift,
            pose_turn=added.turn,
            changed_beams=self._changed_beams,
            withheld=self._withheld,
            added_delay_s=self.delay,
            evidence_age_s=0.0 if self.delivery is None else self.delivery.evidence_age_s,
        )
        if self._displacement is not None and self._active:
            message.displaced_position.extend(self._displacement.position.tolist())
            message.displaced_quaternion.extend(self._displacement.quaternion.tolist())
        message.timestamp.FromNanoseconds(time_ns)
        return message
