"""Run the stack through a recording into a log."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from google.protobuf.message import Message
from numpy.typing import NDArray

from wayproof.harness.config_document import to_json
from wayproof.harness.errors import InputError
from wayproof.harness.input_messages import inputs_from_messages, serialized
from wayproof.harness.interface.build import live_navigator
from wayproof.harness.interface.predictors.live import predictions_for
from wayproof.harness.log.codec.messages import topic_of
from wayproof.harness.log.streams import PRIOR, StreamHashes, own_streams
from wayproof.harness.log.writer import LogWriter, hold_log
from wayproof.harness.outputs import Draft
from wayproof.harness.recordings.recording import Recording
from wayproof.harness.result import RECORDED, recorded_figures
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.shadow.batches import Batch, batches
from wayproof.harness.shadow.inputs import InputWriter
from wayproof.harness.shadow.perturb import RecordedPerturbation
from wayproof.harness.shadow.prepare import Prepared
from wayproof.harness.stack.pipeline import Navigator

Array = NDArray[np.float64]

SCENE = "<!-- a recording: there is no scene -->\n"
"""Scene of a recording's log, instead of the flattened MJCF."""

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
        predictions_for(config, mission, prepared.recorded.decision_period) as (
            navigator.predictions,
            _,
        ),
        log_path if isinstance(log_path, Draft) else hold_log(log_path) as draft,
    ):
        with LogWriter(draft, to_json(config), mission.to_json(), SCENE) as log:
            for info in prepared.infos:
                log.write(f"/sensor/{info.name}/info", info, 0)
            run = ShadowRun(prepared, navigator, log)
            period_ns = round(prepared.recorded.decision_period * 1e9)
            for batch in batches(recording.sweeps(), period_ns, prepared.way.has_gap):
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
        if prepared.config.prior_map:
            self._streams.update(PRIOR, prepared.config.prior_map)
        self._perturbation = RecordedPerturbation(prepared.config, prepared.infos)
        self._inputs = InputWriter(prepared, self._perturbation)
        self.decisions: list[pb.Decision] = []
        self.motions: list[pb.RecordedMotion] = []

    def decide(self, batch: Batch) -> pb.Decision:
        """Integrate one batch, decide and log."""
        sequence, began = len(self.decisions), time.perf_counter()
        given = self._inputs.write(batch, sequence)
        pose, goal, motion = given.pose, given.goal, given.motion
        sense_ms = (time.perf_counter() - began) * 1e3
        predicted = self._navigator.predict(sequence, batch.time_ns)
        prediction = None if predicted is None else predicted.message
        messages = [*given.sweeps, pose, goal, *([] if prediction is None else [prediction])]
        written = [serialized(message) for message in messages]
        inputs = inputs_from_messages(pose, given.sweeps, written, goal, prediction)
        decision = self._navigator.step(inputs, sense_ms)
        if predicted is not None:
            decision.stages.predict_ms = predicted.took_ms
        latency = self._latency(decision, batch.time_ns)
        self._navigator.commit(decision, latency.delay_s)
        self._record([*zip(messages, written, strict=True)], latency, motion, decision)
        return decision

    def result(self, faults: dict[str, int]) -> dict[str, str]:
        """Return the result for the log.

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

    def _latency(self, decision: pb.Decision, time_ns: int) -> pb.Latency:
        config = self._prepared.config.latency
        message = pb.Latency(sequence=decision.sequence, mode="modelled", delay_s=config.expected)
        message.delay_s += self._perturbation.delay
        message.timestamp.FromNanoseconds(time_ns)
        return message

    def _record(
        self,
        inputs: list[tuple[Message, bytes]],
        latency: pb.Latency,
        motion: pb.RecordedMotion,
        decision: pb.Decision,
    ) -> None:
        """Write the decision, its inputs, and the robot's motion."""
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
        if (
            done := self._perturbation.message(sequence, time_ns, self._perturbation.added)
        ) is not None:
            self._log.write(topic_of(done), done, time_ns)
        self.decisions.append(decision)
        self.motions.append(motion)
