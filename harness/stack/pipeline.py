"""The built-in stack: sweeps and a pose in, a decision out, in four stages.

Nothing here knows the simulator, the wall clock apart from the stage latencies, or any state but
its own: the same inputs give the same decisions, bit by bit.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from wayproof.harness.config import Config
from wayproof.harness.errors import InputError
from wayproof.harness.inputs import Beams, Inputs
from wayproof.harness.mission import Mission
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.behaviour import decide
from wayproof.harness.stack.decision import seal
from wayproof.harness.stack.footprint_mode import decide_by_width
from wayproof.harness.stack.mapping import Mapper
from wayproof.harness.stack.planner_input import InputMaker
from wayproof.harness.stack.record import StageClock, record, record_missed_deadline
from wayproof.harness.stack.spaces import FreeSpaces
from wayproof.harness.stack.types import Choice, Memory, View
from wayproof.planners import Trajectory, hold, state_space_for


class Navigator:
    """Maps, plans and decides for one mission.

    Attributes:
        mapper: The map, its labels and its costmap.
        memory: What the last decision hands to the next.
        chain: Hash over all decisions so far.
    """

    SPACES = FreeSpaces

    def __init__(self, config: Config, mission: Mission, beams: Mapping[str, Beams]) -> None:
        """Start at rest, with an unknown map but for the start area."""
        self._config = config
        self.mapper = Mapper(config, mission, beams)
        self.map, self.labels = self.mapper.map, self.mapper.labels
        self.costmap = self.mapper.costmap
        self._spaces = self.SPACES(config, mission, self.costmap)
        self._inputs = InputMaker(config, mission, self.mapper, self._spaces)
        start = self.mapper.planning_point(np.array(mission.start))
        self.memory = self._draft = Memory(hold(start, 0, mission.start_heading))
        self.chain = ""

    @property
    def trajectory(self) -> Trajectory:
        """The last one committed."""
        return self.memory.trajectory

    def step(self, inputs: Inputs, sense_ms: float = 0.0) -> pb.Decision:
        """Integrate, inflate, decide and record; `commit` then settles whether it was in time.

        Args:
            inputs: The sweeps and the pose of one instant.
            sense_ms: Wall time that the sweeps took to cast, for the record.
        """
        clock = StageClock(sense_ms)
        self.mapper.integrate(inputs)  # log-odds, clamping, decay
        clock.end("map")
        self.mapper.inflate(inputs)  # distances, margin, unknown policy
        version = self.mapper.version()
        clock.end("costmap")
        view = self._inputs.circumscribed(inputs)
        decision = self.costmap.resolve(lambda: self._decide_and_record(inputs, view, version))
        clock.end("plan")
        clock.write(decision.stages, within_plan_s=self.costmap.clearances.spent_s)
        return decision

    def commit(self, decision: pb.Decision, delay_s: float) -> pb.Decision:
        """Settle the decision with the delay that it had, and bind it into the chain.

        Past the deadline it is discarded: the last trajectory stands, and that one ends at rest in
        space that was admitted.
        """
        deadline_s = self._config.latency.deadline
        decision.delay_s, decision.deadline_s = delay_s, deadline_s
        decision.deadline_missed = delay_s > deadline_s
        if decision.deadline_missed:
            record_missed_deadline(decision, self.memory.trajectory)
        else:
            self.memory = self._draft
        seal(decision, self.chain)
        self.chain = decision.chain
        return decision

    def resume(self, memory: Memory, chain: str) -> None:
        """Decide next as one that has this behind it, whatever was decided here."""
        self.memory, self.chain = memory, chain

    def _decide_and_record(self, inputs: Inputs, view: View, version: str) -> pb.Decision:
        choice, self._draft, view = self._decide(view)
        radius = self._spaces.inflation_radius(view.admitted)
        return record(inputs, view, choice, self.mapper, radius, version)

    def _decide(self, view: View) -> tuple[Choice, Memory, View]:
        """The choice, the memory that it leaves, and the view that it was made on."""
        if not self._inputs.elongated:
            return *decide(view, self.memory), view
        return decide_by_width(view, lambda: self._inputs.oriented(view), self.memory)


def build_navigator(config: Config, mission: Mission, beams: Mapping[str, Beams]) -> Navigator:
    """Start a navigator.

    Raises:
        InputError: The map or the costmap cannot be made for this mission with these settings, or
            its body cannot be planned for in the state space.
    """
    planner, flat = config.planner, mission.motion == "ground"
    try:
        state_space_for(planner.state_space, planner.name, flat=flat, discs=bool(mission.discs))
    except ValueError as error:
        raise InputError(f"robot '{config.robot}': {error}") from None
    try:
        return Navigator(config, mission, beams)
    except ValueError as error:
        raise InputError(f"no map for this mission: {error}") from None
    except MemoryError:
        raise InputError(
            f"no memory for the map and its costmap: map.memory_mib is {config.map.memory_mib}, "
            "expected less, or a machine that has more"
        ) from None
