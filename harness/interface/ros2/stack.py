"""A stack of ROS 2 nodes on trial: observations out as topics, velocity commands in."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import NamedTuple, TypeVar

from wayproof.harness.errors import InputError
from wayproof.harness.interface.command_messages import CommandError, command_message
from wayproof.harness.interface.errors import StackError
from wayproof.harness.interface.ros2.discovery import mismatch
from wayproof.harness.interface.ros2.inputs import Inputs, Received
from wayproof.harness.interface.ros2.node import Node
from wayproof.harness.interface.ros2.options import parse
from wayproof.harness.interface.ros2.outputs import PAST_NS, Outputs
from wayproof.harness.interface.ros2.pace import (
    FIRST_NS,
    Unexpected,
    answer_to,
    made_after,
    ticks_up_to,
)
from wayproof.harness.interface.types import Command, Observation, Task
from wayproof.harness.schema import stack_pb2 as sb
from wayproof.maps import Costmap

T = TypeVar("T")

REPEAT_S = 1.0
"""Wall time after which an unanswered message is sent again, s: a node that has just been found, or
that subscribes with best effort, can lose one."""

GOAL_REPEAT_S = 5.0
"""Wall time after which an unanswered goal is sent again, s: Nav2 starts over with each."""

CHECKED_EACH = 20
"""Observations between two looks at all other endpoints of the domain."""

LOOK_S = 0.05
"""Wall time between two looks at whether the publisher of commands is still there, s."""


class Answer(NamedTuple):
    """A command and when it came; none where a controller period passed in silence.

    Attributes:
        received: The command.
        time_ns: ROS time when it was received, ns.
    """

    received: Received | None
    time_ns: int


class Ros2Stack:
    """A stack behind ROS 2 topics, for which simulated time waits.

    The wall clock ends an episode whose stack does not answer, and decides nothing else.
    """

    def __init__(self, name: str, wall_s: float, starting_s: float) -> None:
        """Join the domain, and wait for a publisher of commands.

        Args:
            name: Name of the stack, with the options.
            wall_s: Wall time for each answer, s.
            starting_s: Wall time for the publisher to come, s.

        Raises:
            InputError: There is none, or it publishes something else.
        """
        self._who, self._wall_s = f"stack '{name}'", wall_s
        self._options = parse(name)
        self._node = Node(self._options.domain)
        self._inputs = Inputs(self._node, self._options, self._who)
        self._lockstep = self._options.pace == "lockstep"
        self._offset_ns: int | None = FIRST_NS if self._lockstep else None  # of ROS time
        self._tick_ns = 0  # end of the last controller period, ROS time
        self._source: int | None = None  # handle of the publisher of the commands
        self._outputs: Outputs | None = None
        self._costmap: Costmap | None = None
        self._reached = 0  # goals before the one that was sent
        try:
            self._await_publisher(starting_s)
        except InputError:
            self.close()
            raise

    def start(self, task: Task) -> None:
        """Announce the topics of the robot's sensors; send the mountings and the goal.

        Raises:
            InputError: A command would take effect before its controller period is over.
        """
        period_s = self._period_ns * 1e-9
        if not self._lockstep and period_s > task.delay_s + 1e-9:
            raise InputError(
                f"{self._who}: a command is made up to {period_s:g} s after its sweep "
                f"(controller_frequency), and takes effect {task.delay_s:g} s after it (latency.*),"
                " expected no earlier than it is made"
            )
        self._task = task
        self._outputs = Outputs(self._node, self._options, task)
        self._outputs.send_mountings(FIRST_NS)
        self._outputs.send_goal(FIRST_NS)
        if self._offset_ns is not None:
            self._outputs.send_task(self._offset_ns)

    def show(self, costmap: Costmap) -> None:
        """Publish the referee's map and costmap, and their updates, from now on."""
        self._costmap = costmap

    def announce(self) -> None:
        """Do nothing: the nodes wait for topics."""

    def query(self, observation: Observation) -> sb.Command:
        """Return the command that answers an observation.

        Raises:
            StackError: None came in time, or what came is none.
        """
        assert self._outputs is not None
        if self._offset_ns is None:
            self._offset_ns = self._await_first_command(observation, self._outputs)
            self._outputs.send_task(self._offset_ns)
        stamp_ns = observation.time_ns + self._offset_ns
        if observation.sequence % CHECKED_EACH == 0 and (wrong := self._mismatch()):
            raise StackError(self._who, f"cannot be reached: {wrong}")
        if observation.goals_reached > self._reached:
            self._reached = observation.goals_reached
            self._outputs.send_goal(stamp_ns, self._reached)
            if topic := self._outputs.not_taken(self._wall_s):  # before the sweeps are sent
                raise self._hung(f"had not received all of {topic}")
        if self._costmap is not None:
            self._outputs.send_grids(self._costmap, observation.time_ns, stamp_ns)
        await_answer = self._in_lockstep if self._lockstep else self._in_controller_periods
        return self._command(observation, await_answer(observation, stamp_ns, self._outputs))

    def close(self) -> None:
        """Leave the domain."""
        self._outputs = self._costmap = None
        for name in ("_inputs", "_node"):
            self.__dict__.pop(name, None)

    def stderr(self) -> str:
        """Return nothing: the nodes have terminals of their own."""
        return ""

    @property
    def _period_ns(self) -> int:
        return round(1e9 / self._options.controller_frequency)

    def _await_publisher(self, starting_s: float) -> None:
        began = time.monotonic()
        while not self._inputs.publishers:
            waited_s = time.monotonic() - began
            if waited_s > REPEAT_S and (wrong := self._mismatch()):
                raise InputError(f"{self._who}: {wrong}")
            if waited_s > starting_s:
                raise InputError(
                    f"{self._who}: nothing published {self._inputs.topic} "
                    f"(geometry_msgs/msg/TwistStamped or Twist) in domain "
                    f"{self._options.domain} within {starting_s:g} s"
                )
            self._node.wait(LOOK_S)

    def _await_first_command(self, observation: Observation, outputs: Outputs) -> int:
        """Send the first observation at the pace of the wall clock until a command comes.

        ROS time runs on meanwhile, as nodes with timers need it; simulated time does not. The
        first command shows the pace: whether it has the stamp of a sweep.

        Returns:
            ROS time of simulated time 0, ns.
        """
        period_ns = round(self._task.period_s * 1e9)
        began = goal_sent = time.monotonic()
        stamp_ns, stamps = FIRST_NS, set[int]()
        while True:
            outputs.send_observation(observation, stamp_ns)
            outputs.send_clock(stamp_ns)
            stamps.add(stamp_ns)
            until = time.monotonic() + self._task.period_s
            if commands := self._wait(lambda commands: commands, until):
                break
            stamp_ns += period_ns
            if time.monotonic() - goal_sent > GOAL_REPEAT_S:
                goal_sent = time.monotonic()
                outputs.send_goal(stamp_ns)
            self._give_up_after(began, "had sent no command")
        if self._options.pace == "auto":
            self._lockstep = commands[0].stamp_ns in stamps
        self._tick_ns = stamp_ns
        return stamp_ns + period_ns - observation.time_ns

    def _in_lockstep(self, observation: Observation, stamp_ns: int, outputs: Outputs) -> Answer:
        """Send the sweeps, again where they are not answered, and wait for their stamp."""
        began = time.monotonic()
        while True:
            outputs.send_clock(stamp_ns)
            outputs.send_observation(observation, stamp_ns)
            until = time.monotonic() + REPEAT_S
            try:
                received = self._wait(lambda commands: answer_to(stamp_ns, commands), until)
            except Unexpected as got:
                raise StackError(
                    self._who,
                    f"answered with {got}, expected the sweep's, {stamp_ns * 1e-9:.9f} s; of a "
                    "controller with a timer of its own the pace is ros2:pace=controller",
                ) from None
            if received is not None:
                return Answer(received, stamp_ns)
            self._give_up_after(began, f"had not answered the sweep of {stamp_ns * 1e-9:.9f} s")
            if observation.sequence == 0:
                outputs.send_goal(stamp_ns)

    def _in_controller_periods(
        self, observation: Observation, stamp_ns: int, outputs: Outputs
    ) -> Answer:
        """Pass the periods before the sweeps, send them, and take the command of the next period.

        The clock waits for a command at the end of each period, so that a timer fires exactly once
        in it, and for the sweeps to be received before it continues.
        """
        for tick_ns in ticks_up_to(stamp_ns, self._tick_ns, self._period_ns):
            self._pass_period(tick_ns, outputs)
        outputs.send_observation(observation, stamp_ns)
        if topic := outputs.not_taken(self._wall_s):
            raise self._hung(f"had not received all of {topic}")
        received = self._pass_period(self._tick_ns + self._period_ns, outputs)
        return Answer(received, self._tick_ns)

    def _pass_period(self, tick_ns: int, outputs: Outputs) -> Received | None:
        """Advance the clock to the end of a period, and wait for a command that was made in it."""
        silence_s = self._options.silence
        before_ns, ticked_ns, began = self._tick_ns + PAST_NS, time.time_ns(), time.monotonic()
        while True:
            outputs.send_clock(tick_ns)
            until = time.monotonic() + min(REPEAT_S, silence_s or REPEAT_S)
            received = self._wait(
                lambda commands: made_after(before_ns, ticked_ns, commands), until
            )
            if received is not None or 0.0 < silence_s <= time.monotonic() - began:
                self._tick_ns = tick_ns
                return received
            self._give_up_after(
                began,
                f"had sent no command in a controller period of {self._period_ns * 1e-9:g} s "
                "(controller_frequency)",
            )

    def _wait(self, find: Callable[[list[Received]], T | None], until: float) -> T | None:
        """Wait until a command is found; None at a time of `time.monotonic`."""
        while True:
            commands = self._inputs.commands()
            self._check_source(commands)
            if found := find(commands):
                return found
            left = until - time.monotonic()
            if left <= 0.0:
                return None
            self._node.wait(min(left, LOOK_S))

    def _check_source(self, commands: list[Received]) -> None:
        """Refuse commands of a second publisher, and note when the first one is gone."""
        topic, present = self._inputs.topic, self._inputs.publishers
        for one in commands:
            if self._source is None:
                self._source = one.publisher
            if one.publisher != self._source:
                was = "two publishers" if self._source in present else "a node that was restarted"
                raise StackError(self._who, f"sent {topic} from {was}, expected one and the same")
        if not commands and self._source is not None and self._source not in present:
            raise StackError(self._who, f"ended: the publisher of {topic} is gone")

    def _give_up_after(self, began: float, what: str) -> None:
        if wrong := self._mismatch():
            raise StackError(self._who, f"cannot be reached: {wrong}")
        if not self._inputs.publishers:
            topic = self._inputs.topic
            raise StackError(self._who, f"ended: the publisher of {topic} is gone")
        if time.monotonic() - began > self._wall_s:
            raise self._hung(what)

    def _hung(self, what: str) -> StackError:
        line = f"{what} after {self._wall_s:g} s (plugins.wall_s)"
        return StackError(self._who, line)

    def _mismatch(self) -> str:
        publishers = [] if self._outputs is None else self._outputs.publishers.values()
        return mismatch(
            self._node.publications(),
            self._node.subscriptions(),
            publishers,
            self._inputs.subscriptions,
        )

    def _command(self, observation: Observation, answer: Answer) -> sb.Command:
        """Return the received command as it is logged, with its simulated time."""
        assert self._offset_ns is not None
        received = answer.received
        scalars = {"ros2.received_s": (answer.time_ns - self._offset_ns) * 1e-9}
        if received is None:
            scalars["ros2.silent"] = 1.0
        elif received.stamp_ns is not None:
            scalars["ros2.stamp_s"] = (received.stamp_ns - self._offset_ns) * 1e-9
        command = Command(
            None if received is None else received.velocity,
            scalars=scalars,
            planned_path=self._inputs.plan(),
            costmap=self._inputs.costmap(),
        )
        try:
            return command_message(command, observation.sequence)
        except CommandError as error:
            raise StackError(self._who, f"sent a command with {error}") from None
