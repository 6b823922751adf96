"""Colours of reports and plots."""

from __future__ import annotations

TRUE, BELIEVED, LIMIT, CHANCE = "#1f77d0", "#2a9d4a", "#d1232a", "#b7791f"
"""Colours of the truth, of estimates and plans, of limits, and of the last chance."""

ACTIONS = {
    "follow": "#a8d5a8",
    "slow": "#f3df86",
    "stop_and_wait": "#f1a9ae",
    "explore": "#a9c0f2",
    "recover": "#cfaee6",
    "goal": "#5fb878",
    "abort": "#c5424a",
}
"""Colour of each action."""

OTHER_ACTION = "#d5dae1"
"""Colour of an action of another name."""

STAGES = {"sense": "#4c78a8", "map": "#54a24b", "costmap": "#eeca3b", "plan": "#e45756"}
"""Colour of each stage of the latency."""

OBSTACLE, GOAL, LABEL = "#b8bfc8", "#2f855a", "#4a5568"
"""Colours of the true geometry, of the goal, and of failure labels."""


def action_colour(action: str) -> str:
    """Return the colour of an action."""
    return ACTIONS.get(action, OTHER_ACTION)
