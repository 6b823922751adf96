"""Recorder of an episode: log of every decision, and figures of the result."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from google.protobuf.message import Message
from numpy.typing import NDArray

from wayproof.harness.log.codec.messages import topic_of
from wayproof.harness.log.streams import CONTROL, PRIOR, StreamHashes, own_streams
from wayproof.harness.log.writer import LogWriter
from wayproof.harness.result import Fate, fate_of, figures
from wayproof.harness.scenario.scenario import Scenario
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.sim.injector import PerturbationInjector
from wayproof.harness.sim.simulation import Simulation
from wayproof.harness.sim.snapshot import Stateful, state_message
from wayproof.models.sensors.caster import ROBOT_GROUP


class Recorder:
    """The log of one episode, decision by decision.

    Attributes:
        parts: All that a fork must restore, by name, in this order.
        positions: True positions of the base at each decision, (3,) m.
        fates: What became of each decision.
    """

    def __init__(
        self,
        scenario: Scenario,
        log: LogWriter,
        simulation: Simulation,
        injector: PerturbationInjector,
    ) -> None:
        """Record an episode from its start."""
        self._log, self._simulation, self._injector = log, simulation, injector
        scene = scenario.scene
        sensors = [f"sensor/{caster.mount.name}" for caster in scene.casters]
        self._streams = StreamHashes([*sensors, *own_streams(scenario.config), "world", CONTROL])
        self._streams.update("world", scene.mjcf.encode())
        if scenario.config.prior_map:
            self._streams.update(PRIOR, scenario.config.prior_map)
        self._world = np.flatnonzero(scene.model.geom_group != ROBOT_GROUP)
        self.parts: dict[str, Stateful] = {
            "simulation": simulation.physics,
            "controller": scene.controller,
            "truth": simulation.truth,
            "estimate": simulation.estimate,
            "streams": self._streams,
        }
        if simulation.traffic is not None:
            self.parts["traffic"] = simulation.traffic
        if injector.delivery is not None:
            self.parts["delivery"] = injector.delivery
        if simulation.rolling:
            self.parts["steps"] = simulation.step_poses
        self.positions: list[NDArray[np.float64]] = []
        self._clearances: list[float] = []
        self.fates: list[Fate] = []

    def resume(self, decisions: Sequence[pb.Decision], truths: Sequence[pb.Truth]) -> None:
        """Continue after decisions that are in the log already, each with its truth."""
        self.fates = [fate_of(decision) for decision in decisions]
        self.positions = [np.array(truth.position) for truth in truths]
        self._clearances = [truth.clearance_m for truth in truths]

    def hash_control(self, setpoints: bytes) -> None:
        """Hash the setpoints that the controller followed since the last decision, as a stream."""
        if setpoints:  # nothing at the start of a fork, whose state has it
            self._streams.update(CONTROL, setpoints)

    def record(
        self, inputs: Sequence[tuple[Message, bytes]], decision: pb.Decision, time_ns: int
    ) -> pb.Truth:
        """Write one decision, its inputs, and the simulator's truth.

        Args:
            inputs: Messages with their bytes: sweeps, pose, latency.
            decision: The decision.
            time_ns: Simulated time of all of them.

        Returns:
            The truth.
        """
        sequence = decision.sequence
        self.fates.append(fate_of(decision))
        self._write_state(sequence, time_ns)
        for message, data in inputs:
            topic = topic_of(message)
            self._log.write(topic, message, time_ns, data)
            self._streams.update(topic[1:], data)
        self._log.write("/decision", decision, time_ns)
        self._write_streams(sequence, time_ns)
        return self._write_truth(sequence, time_ns)

    def figures(self) -> dict[str, float]:
        """Sum up the decisions so far, by the names of the result's fields."""
        return figures(self.positions, self._clearances, self.fates)

    def _write_state(self, sequence: int, time_ns: int) -> None:
        """Save the simulator's state, from the second decision on: the first is the start."""
        if sequence > 0:
            message = state_message(self.parts, sequence)
            message.timestamp.FromNanoseconds(time_ns)
            self._log.write("/state", message, time_ns)

    def _write_streams(self, sequence: int, time_ns: int) -> None:
        """Write the hashes of the stack's inputs, and how the perturbation changed them."""
        data = self._simulation.data
        moved = data.geom_xpos[self._world], data.geom_xmat[self._world]
        self._streams.update("world", b"".join(part.tobytes() for part in moved))
        self._log.write("/streams", self._streams.message(sequence, time_ns), time_ns)
        added = self._simulation.estimate.added
        done = self._injector.message(sequence, time_ns, added)
        if done is not None:
            self._log.write("/perturbation", done, time_ns)

    def truth(self, sequence: int, time_ns: int) -> pb.Truth:
        """Return the simulator's truth, where decision `sequence` is made at `time_ns`."""
        simulation, truth = self._simulation, self._simulation.truth
        message = pb.Truth(
            sequence=sequence,
            position=simulation.position.tolist(),
            quaternion=simulation.quaternion.tolist(),
            velocity=simulation.data.qvel[:3].tolist(),
            clearance_m=truth.clearance(simulation.data),
            collisions=truth.collisions,
            hit_by_mover=truth.hits_by_movers,
        )
        for mover in simulation.traffic.states() if simulation.traffic else ():
            message.movers.add(**mover._asdict())
        message.timestamp.FromNanoseconds(time_ns)
        return message

    def _write_truth(self, sequence: int, time_ns: int) -> pb.Truth:
        message = self.truth(sequence, time_ns)
        self.positions.append(self._simulation.position.copy())
        self._clearances.append(message.clearance_m)
        self._log.write("/truth", message, time_ns)
        return message
