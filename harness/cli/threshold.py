"""`wayproof threshold`: find the smallest perturbation at which each seed fails."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
from rich.console import Console

from wayproof.harness.cli.engine_options import (
    GOES_ON,
    Watch,
    add_engine,
    check_engine,
    open_engine,
)
from wayproof.harness.cli.verb import LOGS, Document, Verb, add_plugins
from wayproof.harness.errors import InputError, Interrupted

if TYPE_CHECKING:
    from wayproof.harness.study.threshold import Thresholds


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Bisect the severity for each seed of a study; exit code 3 if any seed cannot be run."""
    from wayproof.harness.perturbations import check_kind
    from wayproof.harness.study.file import read_study
    from wayproof.harness.study.store import Store
    from wayproof.harness.study.threshold import MOST_EPISODES, Query, find_thresholds

    check_engine(options)
    written = read_study(options.file, options.allow_plugins)
    kinds = options.perturb or list(written.perturbations)
    if not kinds:
        raise InputError(f"study '{written.name}' has no [perturbations]: expected --perturb KIND")
    for kind in options.perturb or ():
        check_kind(kind, "the bisection finds it")
    most = MOST_EPISODES if options.episodes is None else options.episodes
    if not 2 <= most <= 100:
        raise InputError(f"--episodes {most}: expected 2 to 100")
    name = f"{written.name}-threshold"
    study = msgspec.structs.replace(written, name=name, perturbations={}, gates=[])
    store = Store(options.out or LOGS / name)
    console.print(f"study {name}: at most {most} episodes a seed; logs in {store.folder}")
    with open_engine(options, study.bounds) as engine, Watch(console, None) as watch:
        try:
            thresholds = find_thresholds(study, Query(kinds, most), store, engine, watch.finished)
        except KeyboardInterrupt:
            raise Interrupted(GOES_ON) from None
    for each in thresholds:
        print_thresholds(console, each)
    incomplete = any(each.errors or each.unfinished for each in thresholds)
    return (3 if incomplete else 0), {
        "name": name,
        "folder": str(store.folder),
        "thresholds": [asdict(each) for each in thresholds],
    }


def print_thresholds(console: Console, thresholds: Thresholds) -> None:
    """Print the thresholds of one arm in two lines."""
    from wayproof.harness.study.plan import name_of
    from wayproof.harness.study.threshold import thresholds_in_words

    console.print(name_of(thresholds.arm), style="bold", highlight=False)
    console.print(f"  {thresholds_in_words(thresholds)}", highlight=False, soft_wrap=True)


def _add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "file", metavar="FILE", help="study file (TOML) or name of a packaged study"
    )
    parser.add_argument(
        "--perturb",
        action="append",
        metavar="KIND[:MODE]",
        help="perturbation to bisect, repeatable (default: [perturbations] of the study)",
    )
    parser.add_argument(
        "--episodes",
        type=int,
        metavar="N",
        help="maximum number of episodes for one seed (default: 12)",
    )
    parser.add_argument(
        "--out",
        type=Path,
        metavar="FOLDER",
        help="folder of the logs (default: logs/NAME-threshold)",
    )
    add_engine(parser)
    add_plugins(parser)


VERB = Verb(
    help="find the smallest perturbation at which each seed fails, by bisection",
    add_arguments=_add_arguments,
    run=run,
    example="wayproof threshold pose_drift --episodes 8",
)
