"""Reward of an agent, by the simulator's truth."""

from __future__ import annotations

from dataclasses import dataclass

from wayproof.harness.result import Outcome

FAILURES: tuple[Outcome, ...] = ("collision", "fall", "out_of_bounds", "aborted", "error")
"""Outcomes that end an episode as a failure; `timeout` and `stuck` truncate it."""

TRUNCATIONS: tuple[Outcome, ...] = ("timeout", "stuck")
"""Outcomes that follow from the time that has passed, and not from the state."""


@dataclass(frozen=True)
class Reward:
    """Weights of the sum that a step is rewarded with.

    Attributes:
        progress: For each metre that the true straight distance from the goal became shorter.
        second: For each simulated second.
        success: Once, at rest at the goal.
        failure: Once, for a collision, a fall, a place out of bounds, `aborted` or an `error`.
        not_admitted: For each command that the referee did not admit.
    """

    progress: float = 1.0
    second: float = -0.05
    success: float = 10.0
    failure: float = -10.0
    not_admitted: float = 0.0

    def of_step(
        self, *, progress_m: float, elapsed_s: float, admitted: bool, outcome: Outcome | None
    ) -> float:
        """Return the reward of one step.

        Args:
            progress_m: Decrease of the distance from the goal, m.
            elapsed_s: Simulated time of the step, s.
            admitted: Whether the referee admitted the command.
            outcome: Outcome of the episode, if the step ended it.
        """
        total = self.progress * progress_m + self.second * elapsed_s
        if not admitted:
            total += self.not_admitted
        if outcome == "success":
            total += self.success
        elif outcome in FAILURES:
            total += self.failure
        return total
