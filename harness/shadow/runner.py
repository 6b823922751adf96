"""Run the stack through a recording into a log."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from google.protobuf.message import Message
from numpy.typing import NDArray

from wayproof.harness.config import to_json
from wayproof.harness.errors import InputError
from wayproof.harness.inputs import inputs_from_messages, serialized
from wayproof.harness.interface.build import live_navigator
from wayproof.harness.log.copy import topic_of
from wayproof.harness.log.streams import StreamHashes, own_streams
from wayproof.harness.log.writer import LogWriter, hold_log
from wayproof.harness.outputs import Draft
from wayproof.harness.recordings.recording import Recording
from wayproof.harness.result import RECORDED, recorded_figures
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.shadow.batches import Batch, batches
from wayproof.harness.shadow.perturb import RecordedPerturbation
from wayproof.harness.shadow.prepare import Prepared, lifted
from wayproof.harness.shadow.sweeps import greatest_age
from wayproof.harness.shadow.way import RecordedPose
from wayproof.harness.stack.pipeline import Navigator
from wayproof.models.poses import Trail

Array = NDArray[np.float64]

SCENE = "<!-- a recording: there is no scene -->\n"
"""In the place of the flattened MJCF."""

TRAIL_PERIOD_NS = 10_000_000
"""Time between two poses of a trail, ns."""

MOST_TRAIL = 256
"""Maximum number of poses in a trail."""

Observer = Callable[[pb.Decision, pb.RecordedMotion], None]


def run_recording(
    recording: Recording,
    prepared: Prepared,
    log_path: Path | Draft,
    observe: Observer | None = None,
) -> Path:
    """Decide at each batch of sweeps, and write the log.

    Args:
        recording: Open.
        prepared: Settings, mission and sensors.
        log_path: Final name of the log, or a draft that holds it.
        observe: Called after each decision, for display.

    Returns:
        Path of the log.

    Raises:
        InputError: No map can be made, the recording is damaged, or the log cannot be written.
    """
    config, mission = prepared.config, prepared.mission
    infos = {info.name: info for info in prepared.infos}
    with (
        live_navigator(config, mission, infos) as (navigator, _),
        log_path if isinstance(log_path, Draft) else hold_log(log_path) as draft,
    ):
        with LogWriter(draft, to_json(config), mission.to_json(), SCENE) as log:
            for info in prepared.infos:
                log.write(f"/sensor/{info.name}/info", info, 0)
            run = ShadowRun(prepared, navigator, log)
            period_ns = round(prepared.recorded.decision_period * 1e9)
            for batch in batches(recording.sweeps(), period_ns):
                decision = run.decide(batch)
                if observe is not None:
                    observe(decision, run.motions[-1])
            log.finish(run.result(recording.faults))
        draft.publish()
        return draft.path


class ShadowRun:
    """One pass of the stack through a recording."""

    def __init__(self, prepared: Prepared, navigator: Navigator, log: LogWriter) -> None:
        """Start before the first decision."""
        self._prepared, self._navigator, self._log = prepared, navigator, log
        sensors = [f"sensor/{info.name}" for info in prepared.infos]
        self._streams = StreamHashes([*sensors, *own_streams(prepared.config)])
        self._perturbation = RecordedPerturbation(prepared.config, prepared.infos)
        self._before: RecordedPose | None = None
        self._before_ns = 0
        self.decisions: list[pb.Decision] = []
        self.motions: list[pb.RecordedMotion] = []

    def decide(self, batch: Batch) -> pb.Decision:
        """Integrate one batch, decide and log."""
        sequence, began = len(self.decisions), time.perf_counter()
        motion = self._motion(batch.time_ns, sequence)
        sweeps = self._perturbation.sweeps(self._sweeps(batch, sequence), batch.time_ns, sequence)
        pose = self._pose(sweeps, motion, batch.time_ns, sequence)
        goal = pb.Goal(sequence=sequence, position=self._prepared.way.goal(batch.time_ns).tolist())
        goal.timestamp.FromNanoseconds(batch.time_ns)
        messages = (*sweeps, pose, goal)
        written = [serialized(message) for message in messages]
        inputs = inputs_from_messages(pose, sweeps, written, goal)
        sense_ms = (time.perf_counter() - began) * 1e3
        decision = self._navigator.step(inputs, sense_ms)
        latency = self._latency(decision, batch.time_ns)
        self._navigator.commit(decision, latency.delay_s)
        self._record([*zip(messages, written, strict=True)], latency, motion, decision)
        return decision

    def result(self, faults: dict[str, int]) -> dict[str, str]:
        """The result for the log.

        Raises:
            InputError: There was nothing to decide on.
        """
        if not self.decisions:
            raise InputError("recording: no sweep with a pose in it")
        figures = recorded_figures(self.decisions, self.motions)
        texts = {name: str(value) for name, value in figures.items()}
        counted = ", ".join(f"{count} {what}" for what, count in faults.items())
        reason = f"end of the recording; faults: {counted or 'none'}"
        return {"outcome": RECORDED, "reason": reason, **texts}

    def _sweeps(self, batch: Batch, sequence: int) -> list[pb.Sweep]:
        prepared = self._prepared
        return [
            prepared.writers[sweep.sensor].write(
                sweep, lifted(sweep.T_body_sensor, prepared.lift), batch.time_ns, sequence
            )
            for sweep in batch.sweeps
            if sweep.sensor in prepared.writers
        ]

    def _motion(self, time_ns: int, sequence: int) -> pb.RecordedMotion:
        """What the robot did since the decision before."""
        way, pose = self._prepared.way, self._prepared.way.pose(time_ns)
        begin_ns = self._before_ns if self._before is not None else time_ns
        poses = way.between(begin_ns, time_ns)
        if self._before is not None:
            poses[0] = self._before.row
        poses[-1] = pose.row
        velocity = np.zeros(3)
        if time_ns > begin_ns:
            velocity = (poses[-1, :3] - poses[0, :3]) / ((time_ns - begin_ns) * 1e-9)
        message = pb.RecordedMotion(
            sequence=sequence,
            position=pose.position.tolist(),
            quaternion=pose.quaternion.tolist(),
            velocity=velocity.tolist(),
            way=poses.ravel().tolist(),
        )
        message.timestamp.FromNanoseconds(time_ns)
        self._before, self._before_ns = pose, time_ns
        return message

    def _pose(
        self, sweeps: Sequence[pb.Sweep], motion: pb.RecordedMotion, time_ns: int, sequence: int
    ) -> pb.Pose:
        """The pose that the stack is given, with a trail where beams are older."""
        message = pb.Pose(
            sequence=sequence,
            position=motion.position,
            quaternion=motion.quaternion,
            position_sigma=self._prepared.recorded.position_sigma,
        )
        message.timestamp.FromNanoseconds(time_ns)
        if (age := greatest_age(sweeps)) > 0:
            trail = self._trail(time_ns, age)
            message.history_positions.extend(trail.positions.ravel().tolist())
            message.history_quaternions.extend(trail.quaternions.ravel().tolist())
            message.history_period_s = trail.period
        self._perturbation.pose(message, motion, time_ns)
        return message

    def _trail(self, time_ns: int, age_ns: int) -> Trail:
        """Poses up to a time, from at least an age before it on."""
        period_ns = max(TRAIL_PERIOD_NS, -(-age_ns // (MOST_TRAIL - 1)))
        steps = np.arange(-(-age_ns // period_ns), -1, -1, dtype=np.int64)
        times = np.maximum(time_ns - steps * period_ns, 0)
        return Trail(*self._prepared.way.at(times), period_ns * 1e-9)

    def _latency(self, decision: pb.Decision, time_ns: int) -> pb.Latency:
        config = self._prepared.config.latency
        message = pb.Latency(sequence=decision.sequence, mode="modelled", delay_s=config.expected)
        message.delay_s += self._perturbation.delay(time_ns)
        message.timestamp.FromNanoseconds(time_ns)
        return message

    def _record(
        self,
        inputs: list[tuple[Message, bytes]],
        latency: pb.Latency,
        motion: pb.RecordedMotion,
        decision: pb.Decision,
    ) -> None:
        """Write the decision, what it was made on, and what the robot did."""
        sequence, time_ns = decision.sequence, motion.timestamp.ToNanoseconds()
        messages = [*inputs, (latency, serialized(latency))]
        if (answer := self._navigator.answer) is not None:
            messages.append((answer, serialized(answer)))
        for message, data in messages:
            topic = topic_of(message)
            self._log.write(topic, message, time_ns, data)
            self._streams.update(topic[1:], data)
        self._log.write(topic_of(motion), motion, time_ns)
        self._log.write("/decision", decision, time_ns)
        self._log.write("/streams", self._streams.message(sequence, time_ns), time_ns)
        if (done := self._perturbation.message(sequence, time_ns)) is not None:
            self._log.write(topic_of(done), done, time_ns)
        self.decisions.append(decision)
        self.motions.append(motion)
