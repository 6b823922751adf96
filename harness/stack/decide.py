"""The decision: the first manoeuvre of a list that applies.

The robot follows a *global path*: a path to the goal through space not known to be blocked. It
commits only to the part that the unknown policy lets it traverse, by a trajectory that ends at
rest. Each manoeuvre is a pure function of the situation: it returns a decision where it applies,
and None where it does not.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from wayproof.harness.stack.manoeuvres.arrival import (
    arrive,
    give_up_at_goal,
    give_up_beside_goal,
    wait_at_blocked_goal,
)
from wayproof.harness.stack.manoeuvres.escape import continue_escape, escape_inflation
from wayproof.harness.stack.manoeuvres.following import follow_global_path
from wayproof.harness.stack.manoeuvres.lost_pose import (
    forget_way_back,
    go_back_to_held,
    hold_position,
    record_unheld_trail,
)
from wayproof.harness.stack.manoeuvres.old_evidence import stop_in_seen_space
from wayproof.harness.stack.manoeuvres.recovery import (
    RECOVERIES,
    Wait,
    record_breadcrumb,
)
from wayproof.harness.stack.manoeuvres.stopping import stop_without_path
from wayproof.harness.stack.situation import (
    Situation,
    first_that_applies,
    not_yet_superseded,
    situation_of,
)
from wayproof.harness.stack.state import PathLoss, PlannerState
from wayproof.harness.stack.types import Decided, PlannerInput

MANOEUVRES: tuple[Callable[[Situation], Decided | None], ...] = (
    # First the pose: what follows holds only for a robot that is where it thinks it is.
    hold_position,
    # A goal that is reached ends the mission wherever else the robot could go.
    give_up_at_goal,
    arrive,
    go_back_to_held,
    # Then the evidence: all that follows moves by the map, which must be of now.
    stop_in_seen_space,
    # Then the body: inside the inflation no path leads on, and a way out is not left halfway.
    escape_inflation,
    continue_escape,
    # A goal inside the inflation is as near as it gets; anything else is headed for.
    give_up_beside_goal,
    wait_at_blocked_goal,
    stop_without_path,
    follow_global_path,
)
"""Manoeuvres by precedence; a new one is a function and a line here."""


def decide(input: PlannerInput, state: PlannerState) -> Decided:
    """Choose the next command; the same input and state always give the same result.

    Args:
        input: Planner input of this decision.
        state: Planner state that the last decision left; not written to.

    Returns:
        The command, and the state for the next decision.
    """
    state = record_unheld_trail(record_breadcrumb(state, input), input)
    situation = situation_of(input, forget_way_back(state, input))
    decided = first_that_applies(MANOEUVRES, situation)
    if decided.command.reason.waited_s is not None:
        decided = first_that_applies(RECOVERIES, Wait(situation, decided))
    command, after = decided
    path_loss = None
    if after.route is None:
        path_loss = PathLoss(input.sequence, command.under_way, command.label)
        if state.path_loss is not None and command.reason.since == state.path_loss.sequence:
            path_loss = state.path_loss
    waits = command.reason.waited_s is not None
    after = replace(
        after,
        committed=(*not_yet_superseded(input, state), command.trajectory),
        path_loss=path_loss,
        rest_since_ns=after.rest_since_ns if waits else -1,
    )
    return Decided(command, after)
