"""`wayproof falsify`: search for a perturbation that makes an episode fail."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.text import Text

from wayproof.harness.cli.engine_options import GOES_ON, Watch, add_engine, open_engine
from wayproof.harness.cli.run import episode_name
from wayproof.harness.cli.verb import LOGS, Document, Verb, add_settings
from wayproof.harness.errors import InputError, Interrupted

if TYPE_CHECKING:
    from wayproof.harness.study.falsify.falsify import Falsification


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Search for a failure; exit code 1 if one was found."""
    from wayproof.harness.clearance import true_clearance_is_bound
    from wayproof.harness.config_document import from_document, override
    from wayproof.harness.perturbations import PERTURBATIONS, check_kind
    from wayproof.harness.scenario.worlds import refuse_other_worlds
    from wayproof.harness.study.falsify.falsify import Task, falsify
    from wayproof.harness.study.falsify.search import NO_RATE
    from wayproof.harness.study.store import Store
    from wayproof.harness.worker_pool import Bounds

    check_kind(options.perturb, "the search chooses it, up to --greatest")
    if not PERTURBATIONS[options.perturb.partition(":")[0]].windowed:
        raise InputError(
            f"--perturb {options.perturb}: got one that acts all the time, expected "
            "one that can act within a window"
        )
    named = {"world": options.world, "robot": options.robot, "seed": options.seed}
    config = override(from_document(named), [*options.set, "record=failures"])
    refuse_other_worlds(config.world, options.set)
    aim = Task(
        config,
        options.perturb,
        options.window,
        options.greatest,
        options.budget,
        options.search_seed,
    )
    store = Store(options.out or LOGS / f"falsify-{episode_name(config)}")
    with open_engine(options, Bounds()) as engine, Watch(console, None) as watch:
        try:
            found = falsify(aim, store, engine, watch.finished)
        except KeyboardInterrupt:
            raise Interrupted(GOES_ON) from None
    print_found(console, found)
    console.print(Text.assemble(("note", "bold"), f": {NO_RATE}"), soft_wrap=True)
    document = {
        **asdict(found),
        "nearest_is_bound": true_clearance_is_bound(found.nearest.robustness),
        "rate": None,
        "note": NO_RATE,
        "folder": str(store.folder),
    }
    return (1 if found.failing else 0), document


def print_found(console: Console, found: Falsification) -> None:
    """Print the failure found and its shortest trigger, or the nearest miss."""
    from wayproof.harness.clearance import true_in_metres

    if found.failing is None:
        console.print(
            f"no failure in {found.episodes} episodes; least clearance "
            f"{true_in_metres(found.nearest.robustness)} with {found.nearest.perturbation}",
            highlight=False,
            soft_wrap=True,
        )
        return
    failure = f" after {found.episodes} episodes: {found.reason}; log {found.log}"
    console.print(Text.assemble((found.outcome, "bold red"), failure), soft_wrap=True)
    if found.shortest is not None and found.shortest.perturbation.window is not None:
        begin, end = found.shortest.perturbation.window
        console.print(
            f"shortest trigger: {begin:g} to {end:g} s, found in {found.cuts} more episodes; "
            f"log {found.shortest_log}\n  --set 'perturbation={found.setting}'",
            highlight=False,
            soft_wrap=True,
        )


def _add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("world", metavar="WORLD", help="name ('wayproof list') or world file")
    parser.add_argument("--robot", required=True, help="name ('wayproof list') or spec file")
    parser.add_argument("--seed", required=True, type=int, help="seed of the episode")
    parser.add_argument(
        "--perturb", required=True, metavar="KIND[:MODE]", help="perturbation to apply"
    )
    parser.add_argument(
        "--window",
        type=float,
        default=2.0,
        metavar="S",
        help="duration of the perturbation, s (default: 2)",
    )
    parser.add_argument(
        "--greatest",
        type=float,
        default=5.0,
        metavar="SEVERITY",
        help="greatest severity (default: 5)",
    )
    parser.add_argument(
        "--budget",
        type=int,
        default=100,
        metavar="N",
        help="maximum number of episodes (default: 100)",
    )
    parser.add_argument(
        "--search-seed", type=int, default=0, metavar="N", help="seed of the search (default: 0)"
    )
    add_settings(parser)
    parser.add_argument(
        "--out",
        type=Path,
        metavar="FOLDER",
        help="folder of the logs (default: logs/falsify-WORLD-ROBOT-SEED)",
    )
    add_engine(parser)


VERB = Verb(
    help="search for the time and strength at which a perturbation makes an episode fail",
    add_arguments=_add_arguments,
    run=run,
    example="wayproof falsify warehouse --robot drone --seed 3 --perturb pose_jump --budget 100",
)
