"""Policies for unknown space on one recorded way: the share admitted under each."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import get_args

from wayproof.harness.shadow.assess import assess
from wayproof.harness.shadow.summary import summarize
from wayproof.maps import UnknownPolicy


@dataclass(frozen=True)
class Policy:
    """The recorded way under one policy.

    Attributes:
        policy: `costmap.unknown_policy`.
        admitted_share: Share of the way that was admitted when it was entered; None without a way.
        driven_m: Length of the way, m.
        refused_m: Length that was not admitted by reason, m.
    """

    policy: UnknownPolicy
    admitted_share: float | None
    driven_m: float
    refused_m: dict[str, float]


def policies_of(log: Path) -> list[Policy]:
    """Judge the way of a recording's log under each policy.

    Raises:
        InputError: It is no log of a recording, or is damaged.
    """
    judged = []
    for policy in get_args(UnknownPolicy):
        summary = summarize(assess(log, unknown_policy=policy))
        judged.append(Policy(policy, summary.admitted_share, summary.driven_m, summary.refused_m))
    return judged
