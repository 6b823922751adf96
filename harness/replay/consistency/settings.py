"""Checks of content that follows from the config: delays, perturbation, places and goals."""

from __future__ import annotations

import math
from collections.abc import Iterator

from wayproof.harness.decision import Difference
from wayproof.harness.replay.consistency.subject import Subject, added_delay, is_active


def check_delays(subject: Subject) -> Iterator[Difference]:
    """Check that a modelled delay follows from the config, and each decision repeats it."""
    content = subject.content
    for decision, latency in zip(content.decisions, content.latencies, strict=False):
        number = decision.sequence
        config = subject.segment_of(number).config.latency
        if latency.mode != config.mode:
            yield Difference(f"/latency[{number}].mode", latency.mode, config.mode)
            return
        expected = latency.delay_s
        if config.mode == "modelled":
            expected = config.expected + added_delay(subject, number)
        for place, recorded in (("latency", latency.delay_s), ("decision", decision.delay_s)):
            if recorded != expected:
                yield Difference(f"/{place}[{number}].delay_s", f"{recorded!r}", f"{expected!r}")
                return


def check_perturbation(subject: Subject) -> Iterator[Difference]:
    """Check perturbation records by the config; without a perturbation there is none."""
    records = {one.sequence: one for one in subject.content.perturbations}
    for decision in subject.content.decisions:
        number = decision.sequence
        place, record = f"/perturbation[{number}]", records.get(number)
        perturbation = subject.segment_of(number).config.perturbation
        if record is None or perturbation is None:
            if record is not None or perturbation is not None:
                kinds = [one.kind if one else "none" for one in (record, perturbation)]
                yield Difference(place, *kinds)
                return
            continue
        active = is_active(subject, number)
        expected = {
            "kind": perturbation.kind,
            "severity": math.ceil(perturbation.severity),
            "amount": perturbation.amount if active else perturbation.nothing,
            "added_delay_s": added_delay(subject, number),
        }
        for field, value in expected.items():
            if getattr(record, field) != value:
                yield Difference(f"{place}.{field}", str(getattr(record, field)), str(value))
                return


def check_places(subject: Subject) -> Iterator[Difference]:
    """Check that start and goals of the mission are those of the resolved config."""
    for segment in subject.segments:
        config, mission = segment.config, segment.mission
        both = (config.waypoints, mission.waypoints)
        if len(both[0]) != len(both[1]):
            yield Difference("config.waypoints", f"{both[0]}", f"{both[1]}")
        pairs = [("start", config.start, mission.start), ("goal", config.goal, mission.goal)]
        pairs += [("waypoints", *points) for points in zip(*both, strict=False)]
        for name, placed, point in pairs:
            if placed is not None and tuple(placed) != point[: len(placed)]:
                yield Difference(f"config.{name}", str(placed), str(point))


def check_goals(subject: Subject) -> Iterator[Difference]:
    """Check that the goal of each decision is the next one, by the goals reached before."""
    content, reached = subject.content, 0
    for decision, goal in zip(content.decisions, content.goals, strict=False):
        number = decision.sequence
        goals = subject.segment_of(number).mission.goals
        expected = (min(reached, len(goals) - 1), list(goals[min(reached, len(goals) - 1)]))
        if (goal.index, list(goal.position)) != expected:
            got = f"goal {goal.index}, {list(goal.position)}"
            yield Difference(f"/goal[{number}]", got, "goal {}, {}".format(*expected))
            return
        reached += decision.action == "goal"
