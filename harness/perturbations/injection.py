"""A perturbation at work: on what reaches the stack of a simulated or a recorded robot."""

from __future__ import annotations

import math
from collections.abc import Sequence

from wayproof.harness.perturbations.delivery import Delivery
from wayproof.harness.perturbations.perturbation import (
    LATE,
    UNPERTURBED,
    Perturbation,
    Ranges,
    Report,
)
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.models.pose_model import PoseError


class Injection:
    """The perturbation of one episode, or of one pass through a recording.

    Attributes:
        delivery: Delivery of the messages; None where all arrive as they are sent.
    """

    def __init__(
        self,
        perturbation: Perturbation | None,
        seed: int,
        sensors: Sequence[str],
        period_ns: int,
        *,
        registers: bool,
    ) -> None:
        """Find the sensors that it affects.

        Args:
            perturbation: None changes nothing.
            seed: Seed of the episode.
            sensors: Names of the sensors.
            period_ns: Time between two messages, about, ns.
            registers: Whether the pose is estimated by the sweeps, and so changed with them.
        """
        self._perturbation = perturbation or UNPERTURBED
        self._registers = registers
        self._seed, self._sensors = seed, list(sensors)
        self._affected = self._perturbation.affected(self._sensors)
        self._displacement = self._perturbation.displacement(seed)
        self._changed_beams, self._withheld = 0, list[str]()
        self._active, self._time_ns = True, 0
        self.delivery: Delivery | None = None
        if self._perturbation.changes in LATE:
            self.delivery = Delivery(self._perturbation, seed, period_ns)

    @property
    def delay(self) -> float:
        """Delay added to the present decision, s."""
        return self._perturbation.delay_at(self._seed, self._time_ns) if self._active else 0.0

    def begin(self, time_ns: int) -> None:
        """Begin with the inputs of a decision."""
        self._changed_beams, self._withheld = 0, []
        self._time_ns = time_ns
        self._active = self._perturbation.is_active(time_ns)

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

    def perturbed(self, report: Report) -> Ranges:
        """Return the ranges of a sweep in place of those that its device reports."""
        changed = self._perturbation.report(report)
        self._changed_beams += int((changed != report.ranges_mm).sum())
        return changed

    def message(self, sequence: int, time_ns: int, added: PoseError) -> pb.Perturbation | None:
        """Encode the perturbation of this decision for the log; None if unperturbed.

        Args:
            sequence: Number of the decision.
            time_ns: Its time.
            added: Error added to the pose.
        """
        perturbation = self._perturbation
        if perturbation is UNPERTURBED:
            return None
        streams = perturbation.streams(self._sensors)
        if self._registers and any(name.startswith("sensor/") for name in streams):
            streams = *streams, "pose"
        message = pb.Perturbation(
            sequence=sequence,
            kind=perturbation.kind,
            severity=math.ceil(perturbation.severity),
            exact_severity=perturbation.severity,
            amount=perturbation.amount if self._active else perturbation.nothing,
            unit=perturbation.unit,
            streams=streams,
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
