"""Injection of an episode's perturbation between the simulator and the stack."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.harness.config import Config
from wayproof.harness.perturbations import Report
from wayproof.harness.perturbations.injection import Injection
from wayproof.models.classes import UNKNOWN_CLASS
from wayproof.models.poses import Trail
from wayproof.models.robots.robot import ROBOT_PREFIX
from wayproof.models.scene import Scene
from wayproof.models.sensors.beams import DROPPED, NO_RETURN
from wayproof.models.sensors.caster import Caster


class PerturbationInjector(Injection):
    """One episode's perturbation, or none, applied to one scene's sensors and delays."""

    def __init__(self, config: Config, scene: Scene) -> None:
        """Find the sensors that it affects."""
        self._rate = scene.casters[0].mount.device.rate  # decisions follow the first sensor
        super().__init__(
            config.perturbation,
            config.seed,
            [caster.mount.name for caster in scene.casters],
            round(1e9 / self._rate),
            registers=config.estimate.kind == "lidar",
        )
        self._labelled = config.sensors.semantics
        self._model = scene.model

    def begin_decision(self, sequence: int) -> None:
        """Begin with the inputs of a decision."""
        self.begin(round(sequence / self._rate * 1e9))

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
        perturbed = self.perturbed(report).astype(np.uint16)
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
