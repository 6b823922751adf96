"""`wayproof calibrate`: find the smallest setting that meets a bound, and its cost."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table

from wayproof.harness.cli.engine_options import Watch, add_engine, check_engine, open_engine
from wayproof.harness.cli.verb import LOGS, Document, Verb, add_settings
from wayproof.harness.errors import InputError, unknown_name

if TYPE_CHECKING:
    from wayproof.harness.statistics.exact import Interval
    from wayproof.harness.study.calibration import MarginResult

CALIBRATED = ("margin",)
"""Names of the settings that can be calibrated."""


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Find the smallest margin; exit code 1 if none keeps the bound, 3 if an episode cannot run."""
    from wayproof.harness.study.calibration import MARGINS, calibrate_margin, margin_study
    from wayproof.harness.study.store import Store

    check_engine(options)
    if options.what not in CALIBRATED:
        raise unknown_name("calibration", options.what, CALIBRATED)
    study = margin_study(
        options.world,
        options.robot,
        options.seeds,
        options.drift,
        _numbers(options.margins) if options.margins else MARGINS,
        dict(_setting(text) for text in options.set),
    )
    store = Store(options.out or LOGS / study.name)
    episodes = options.seeds * len(study.axes["costmap.localization_margin"])
    console.print(f"study {study.name}: {episodes} episodes; logs in {store.folder}")
    with open_engine(options, study.bounds) as engine, Watch(console, None) as watch:
        result = calibrate_margin(
            study, options.drift, options.bound, store, engine, watch.finished
        )
    print_margin(console, result)
    code = 0 if result.margin is not None else 1
    if result.errors:
        code = 3
        console.print(f"{result.errors} episodes failed to run, first {result.first_error}")
    return code, {**asdict(result), "folder": str(store.folder)}


def print_margin(console: Console, result: MarginResult) -> None:
    """Print a row for each margin, then the smallest margin."""
    table = Table(title=f"drift {result.drift:g} m/m, bound {result.bound:g}", title_justify="left")
    for heading in ("margin m", "episodes", "collided", "fitted", "success", "time s"):
        table.add_column(heading, justify="right")
    table.add_column("success price", justify="right")
    table.add_column("time price s", justify="right")
    for one in result.rungs:
        table.add_row(
            f"{one.margin:g}",
            str(one.episodes),
            _interval(one.collided),
            f"{one.monotone:.2f}",
            _interval(one.success),
            f"{one.time:.1f}",
            _interval(one.success_price, "+.2f"),
            _interval(one.time_price, "+.1f"),
        )
    console.print(table)
    smallest = "no margin that was tried" if result.margin is None else f"{result.margin:g} m"
    high = "none tried is shown to" if result.high is None else f"{result.high:g} m"
    low = "every one tried is shown to break it" if result.low is None else f"{result.low:g} m"
    console.print(
        f"smallest margin that keeps the bound: {smallest} (not shown to break it from: {low}; "
        f"shown to keep it from: {high}; {result.seeds_to_show} seeds without a collision would "
        "show it)",
        highlight=False,
        soft_wrap=True,
    )


def _interval(one: Interval, form: str = ".2f") -> str:
    from wayproof.harness.study.gates import interval_in_words

    return interval_in_words(one, form)


def _numbers(text: str) -> list[float]:
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise InputError(f"--margins {text}: expected numbers with commas between them") from None


def _setting(text: str) -> tuple[str, Any]:
    """Parse a setting as in a study file; the study checks that it exists."""
    import json

    name, separator, value = text.partition("=")
    if not separator:
        raise InputError(f"--set {text}: expected section.field=value")
    try:
        return name, json.loads(value)
    except ValueError:
        return name, value


def _add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "what", metavar="WHAT", help=f"setting to calibrate: {', '.join(CALIBRATED)}"
    )
    parser.add_argument("world", metavar="WORLD", help="name ('wayproof list') or world file")
    parser.add_argument("--robot", required=True, help="name ('wayproof list') or spec file")
    parser.add_argument(
        "--drift",
        type=float,
        required=True,
        metavar="M/M",
        help="drift of the pose estimate, unknown to the stack, metres per metre",
    )
    parser.add_argument(
        "--bound",
        type=float,
        default=0.05,
        metavar="SHARE",
        help="share of episodes that may collide (default: 0.05)",
    )
    parser.add_argument(
        "--seeds",
        type=int,
        default=50,
        metavar="N",
        help="number of seeds of each margin (default: 50)",
    )
    parser.add_argument(
        "--margins",
        metavar="M,M,...",
        help="margins to try, m (default: 0.02,0.05,0.1,0.15,0.2,0.3)",
    )
    add_settings(parser)
    parser.add_argument(
        "--out",
        type=Path,
        metavar="FOLDER",
        help="folder of the logs (default: logs/margin-WORLD-ROBOT)",
    )
    add_engine(parser)


VERB = Verb(
    help="find the smallest localization margin that keeps collisions rare, and its cost",
    add_arguments=_add_arguments,
    run=run,
    example="wayproof calibrate margin warehouse --robot drone --drift 0.02 --bound 0.05",
)
