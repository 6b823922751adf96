"""What a person sees of a running episode: one live line, then a verdict."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rich.console import Console
from rich.live import Live
from rich.table import Table
from rich.text import Text

from harness.audit import Audit
from harness.episode import Result
from harness.replay import Replay
from harness.schema import wayproof_pb2 as pb

ACTION_STYLES = {
    "follow": "green",
    "explore": "cyan",
    "slow": "yellow",
    "stop_and_wait": "red",
    "recover": "magenta",
    "goal": "bold green",
    "abort": "bold red",
}

SHOWN_VIOLATIONS = 10


class LiveLine:
    """One line, rewritten at each decision; a context manager."""

    def __init__(self, console: Console, title: str) -> None:
        """Name the episode that the line tells of."""
        self._title = title
        self._console = console
        self._live = Live(console=console, refresh_per_second=10)

    def __call__(self, decision: pb.Decision, truth: pb.Truth) -> None:
        """Show a decision; the line appears with the first."""
        self._live.start()
        stages = decision.stages
        latency = stages.sense_ms + stages.map_ms + stages.costmap_ms + stages.plan_ms
        speed = float(np.linalg.norm(truth.velocity))
        self._live.update(
            Text.assemble(
                (f"{self._title} ", "bold"),
                f"{decision.timestamp.ToNanoseconds() * 1e-9:5.1f} s {speed:4.2f} m/s ",
                (f"{decision.action:<13}", ACTION_STYLES[decision.action]),
                f" map {decision.map_version[:8]} {latency:4.0f} ms",
                f" {decision.path_length_m:5.1f} m to go",
                no_wrap=True,
                overflow="ellipsis",
            )
        )

    def __enter__(self) -> LiveLine:
        """Nothing to show before the first decision."""
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the last state of the line standing."""
        if not self._live.is_started:
            return
        self._live.stop()
        if not self._console.is_terminal:  # there the last state is printed without its newline
            self._console.line()


def print_verdict(console: Console, result: Result) -> None:
    """One episode's verdict in two lines."""
    style = "bold green" if result.outcome == "success" else "bold red"
    console.print(
        Text.assemble(
            (result.outcome, style),
            f": {result.reason}; {result.sim_time_s:.1f} s simulated in {result.wall_time_s:.1f} s,"
            f" {result.decisions} decisions, {result.collisions} collisions,"
            f" least clearance {result.min_clearance_m:.2f} m",
        ),
        soft_wrap=True,
    )
    console.print(f"log: {result.log}  chain: {result.chain}", soft_wrap=True, highlight=False)


def print_audit(console: Console, audited: Audit) -> None:
    """One audit's verdict in a line, and what broke which rule."""
    count = len(audited.violations)
    verdict = (f"{count} violations", "bold red") if count else ("no violation", "bold green")
    text = Text.assemble(
        verdict,
        f" of '{audited.policy}' in {audited.decisions} decisions: {audited.swept} paths swept, "
        f"{audited.stops} late stops, {audited.recoveries} recoveries; {audited.log}",
    )
    console.print(text, soft_wrap=True)
    for violation in audited.violations[:SHOWN_VIOLATIONS]:
        console.print(f"  {violation.sequence}: {violation.rule}: {violation.text}", soft_wrap=True)
    if count > SHOWN_VIOLATIONS:
        console.print(f"  and {count - SHOWN_VIOLATIONS} more", soft_wrap=True)


def print_replay(console: Console, replayed: Replay) -> None:
    """One replay's verdict in a line."""
    if replayed.identical:
        text = Text.assemble(
            ("identical", "bold green"), f": {replayed.decisions} of {replayed.decisions} decisions"
        )
    else:
        first = "none" if replayed.first_difference is None else str(replayed.first_difference)
        text = Text.assemble(
            ("differs", "bold red"),
            f": {replayed.differing} of {replayed.decisions} decisions,"
            f" first {first} in {', '.join(replayed.fields) or 'the chain'}",
        )
    text.append(f"; {replayed.wall_time_s:.1f} s; chain {replayed.chain}; {replayed.log}")
    console.print(text, soft_wrap=True)


def print_demo(console: Console, rows: Sequence[tuple[str, Result, Replay]]) -> None:
    """Verdicts of several episodes and of their replays."""
    table = Table(title="Verdicts: warehouse", title_justify="left")
    for heading in ("robot", "outcome", "time", "x real", "decisions", "clearance", "replay"):
        table.add_column(heading, justify="left" if heading in ("robot", "outcome") else "right")
    for title, result, replayed in rows:
        table.add_row(
            title,
            result.outcome,
            f"{result.sim_time_s:.1f} s",
            f"{result.sim_time_s / result.wall_time_s:.1f}",
            str(result.decisions),
            f"{result.min_clearance_m:.2f} m",
            "identical" if replayed.identical else "differs",
        )
    console.print(table)
    for _, result, _ in rows:
        console.print(f"log: {result.log}", soft_wrap=True, highlight=False)
