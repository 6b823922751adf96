"""The stack under test: sweeps and a pose in, a decision out.

One step integrates the sweeps into the map, updates the costmap, decides and records. It knows
nothing of the simulator, and of the wall clock only to report how long each stage took: the same
inputs give the same decisions, bit by bit.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from wayproof.harness.config import Config
from wayproof.harness.decision import chain_hash
from wayproof.harness.inputs import Beams, Inputs
from wayproof.harness.mission import Mission
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.decide import decide
from wayproof.harness.stack.footprint_mode import FootprintDecision, decide_with_footprint
from wayproof.harness.stack.mapping import Mapper
from wayproof.harness.stack.planner_input import FreeSpaceBuilder, PlannerInputBuilder
from wayproof.harness.stack.prediction import Predicted, Predictions
from wayproof.harness.stack.record import StageClock, record, record_missed_deadline
from wayproof.harness.stack.state import PlannerState, for_next_goal
from wayproof.harness.stack.types import PlannerInput
from wayproof.planners import Trajectory, hold


class Navigator:
    """Maps, plans and decides for one mission.

    Attributes:
        mapper: The map, its labels and its costmap.
        state: Planner state after the last committed decision.
        chain: Hash over all decisions so far.
        answer: Logged answer of a stack on trial to the last inputs; the built-in one has none.
        predictions: Predictions of a predictor from outside; None without one, and where they come
            from a log.
    """

    SPACES = FreeSpaceBuilder
    answer: pb.StackCommand | None = None
    predictions: Predictions | None = None

    def __init__(self, config: Config, mission: Mission, beams: Mapping[str, Beams]) -> None:
        """Start at rest, with an unknown map but for the start area."""
        self._config, self._several = config, bool(mission.waypoints)
        self.mapper = Mapper(config, mission, beams)
        self.map, self.labels = self.mapper.map, self.mapper.labels
        self.costmap = self.mapper.costmap
        self._spaces = self.SPACES(config, mission, self.costmap, self.mapper.omnidirectional)
        self._input_builder = PlannerInputBuilder(config, mission, self.mapper, self._spaces)
        start = self.mapper.planning_point(np.array(mission.start))
        self.state = self._draft = PlannerState((hold(start, 0, mission.start_heading),))
        self.chain = ""

    def planner_inputs(self, inputs: Inputs) -> tuple[PlannerInput, PlannerInput]:
        """Return the planner input for the circumscribed footprint, and for the oriented one.

        Of a round body they are the same. They hold until the next update of the costmap.
        """
        circumscribed = self._input_builder.circumscribed(inputs)
        if not self._input_builder.elongated:
            return circumscribed, circumscribed
        return circumscribed, self._input_builder.oriented(circumscribed)

    @property
    def draft(self) -> PlannerState:
        """Planner state after the last decision, committed or not."""
        return self._draft

    @property
    def trajectory(self) -> Trajectory:
        """The last one committed."""
        return self.state.trajectory

    def announce(self) -> None:
        """Say that the next inputs are on their way; a stack on trial may have to wake."""

    def predict(self, sequence: int, time_ns: int) -> Predicted | None:
        """Have the map predicted as it is now, for the inputs of the next decision.

        Args:
            sequence: Number of that decision.
            time_ns: Its simulated time.

        Returns:
            The prediction; None without a predictor from outside, and before the first decision.

        Raises:
            PredictorError: The predictor failed.
        """
        newest = self.mapper.newest
        if self.predictions is None or newest is None:
            return None
        return self.predictions.of(self.map, newest, sequence, time_ns)

    def step(
        self, inputs: Inputs, sense_ms: float = 0.0, answer: pb.StackCommand | None = None
    ) -> pb.Decision:
        """Integrate, update the costmap, decide and record; `commit` then makes it take effect.

        Args:
            inputs: The sweeps and the pose of one instant.
            sense_ms: Wall time that the sweeps took to cast, for the record.
            answer: Logged answer of a stack on trial; the built-in stack decides by itself.
        """
        clock = StageClock(sense_ms)
        self.mapper.integrate(inputs)  # log-odds, clamping, decay
        clock.end("map")
        self.mapper.update_costmap(inputs)  # distances, margin, unknown policy
        version = self.mapper.version()
        clock.end("costmap")
        planner_input = self._input_builder.circumscribed(inputs)
        decision = self._decide_and_record(inputs, planner_input, version)
        clock.end("plan")
        clock.write(decision.stages)
        return decision

    def commit(self, decision: pb.Decision, delay_s: float) -> pb.Decision:
        """Commit the decision with the delay that it had, and add it to the chain.

        Past the deadline it is discarded: the last trajectory stands, and that one ends at rest in
        space that was traversable.
        """
        deadline_s = self._config.latency.deadline
        decision.delay_s, decision.deadline_s = delay_s, deadline_s
        decision.deadline_missed = delay_s > deadline_s
        if decision.deadline_missed:
            record_missed_deadline(decision, self.state.trajectory)
        else:
            self.state = self._draft
            if decision.action == "goal" and self._several:
                self.state = for_next_goal(self._draft)
        self.chain = decision.chain = chain_hash(decision, self.chain)
        return decision

    def load_state(self, state: PlannerState, chain: str) -> None:
        """Continue after the decisions of another navigator: its planner state and chain."""
        self.state, self.chain = state, chain

    def _decide_and_record(
        self, inputs: Inputs, planner_input: PlannerInput, version: str
    ) -> pb.Decision:
        command, self._draft, planner_input = self._decide(planner_input)
        radius = self._spaces.inflation_radius(planner_input.traversable)
        return record(inputs, planner_input, command, self.mapper, radius, version)

    def _decide(self, planner_input: PlannerInput) -> FootprintDecision:
        if not self._input_builder.elongated:
            return FootprintDecision(*decide(planner_input, self.state), planner_input)
        return decide_with_footprint(
            planner_input, lambda: self._input_builder.oriented(planner_input), self.state
        )
