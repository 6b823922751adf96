"""Stepping out of the inflation comes nearer neither to the unknown nor to an obstacle."""

import pytest

from tests.harness.stack.make_input import at_rest, make_input, make_states
from wayproof.harness.stack.decide import decide

START = (2.05, 2.05)
LANE = [(0.0, 2.6, 0.0, 2.0), (0.0, 2.6, 2.3, 4.0)]
"""What is unknown on both sides of the robot."""

PILLAR = (2.3, 2.4, 2.1, 2.2)


@pytest.mark.parametrize(
    ("pillars", "action", "kind"),
    [([], "recover", "escaping_inflation"), ([PILLAR], "stop_and_wait", "way_out_blocked")],
)
def test_a_way_out_does_not_brush_an_obstacle(pillars, action, kind):
    """It stands in a lane, a cell from what is unknown; the way out leads past the pillar."""
    input = make_input(make_states(unknown=LANE, occupied=pillars), position=START)
    command, _ = decide(input, at_rest(START))
    assert (command.action, command.label, command.reason.kind) == (action, "start_blocked", kind)
