"""Messages of one decision, gathered from a log in file order."""

from __future__ import annotations

from dataclasses import dataclass, field

from google.protobuf.message import Message

from wayproof.harness.errors import InputError
from wayproof.harness.schema import wayproof_pb2 as pb

FIELDS: dict[type[Message], str] = {
    pb.Pose: "pose",
    pb.Latency: "latency",
    pb.Goal: "goal",
    pb.Prediction: "prediction",
    pb.StackCommand: "answer",
    pb.RecordedMotion: "motion",
    pb.State: "state",
}
"""Field of `DecisionMessages` by type of message; sweeps are gathered in a list."""

MOST_SWEEPS = 256
"""Maximum number of sweeps between two decisions."""


@dataclass
class DecisionMessages:
    """Messages of a log that precede one decision.

    Attributes:
        pose: Estimated pose; of the decision before where the log lacks one.
        latency: Delay, likewise.
        sweeps: Sweeps in the order in which they are integrated.
        goal: Goal of this decision; None of the mission's.
        prediction: Prediction of a predictor from outside, if there is one.
        answer: Answer of a stack on trial, if there is one.
        motion: Motion of a recording's robot up to the decision; None of an episode.
        state: State of the simulator, if it was kept.
    """

    pose: pb.Pose = field(default_factory=pb.Pose)
    latency: pb.Latency = field(default_factory=pb.Latency)
    sweeps: list[pb.Sweep] = field(default_factory=list)
    goal: pb.Goal | None = None
    prediction: pb.Prediction | None = None
    answer: pb.StackCommand | None = None
    motion: pb.RecordedMotion | None = None
    state: pb.State | None = None

    def take(self, message: Message) -> bool:
        """Keep a message, and return whether it is one of those that precede a decision."""
        if isinstance(message, pb.Sweep):
            if len(self.sweeps) == MOST_SWEEPS:
                raise InputError(f"log: over {MOST_SWEEPS} sweeps for one decision")
            self.sweeps.append(message)
            return True
        name = FIELDS.get(type(message))
        if name is not None:
            setattr(self, name, message)
        return name is not None

    def next(self) -> DecisionMessages:
        """Return the messages of the next decision, none gathered yet."""
        return DecisionMessages(pose=self.pose, latency=self.latency)
