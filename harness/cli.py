"""The command `wayproof`: `run`, `replay`, `audit`, `list`, `demo` and `bench`.

Exit codes: 0 as hoped (goal reached, replay identical, no rule broken), 1 not so, 2 bad input.
"""

from __future__ import annotations

import argparse
import errno
import hashlib
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, NoReturn, get_args

import msgspec
from rich.console import Console

from harness.config import Config, from_document, override, setting_names, to_json
from harness.errors import InputError, unknown_name

LOGS = Path("logs")

Document = dict[str, Any]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code."""
    arguments = sys.argv[1:] if arguments is None else list(arguments)
    as_json = "--json" in arguments
    console = Console(quiet=as_json)
    try:
        if arguments and not arguments[0].startswith("-") and arguments[0] not in VERBS:
            raise unknown_name("verb", arguments[0], VERBS)
        options = _parser().parse_args(arguments)
        verb: Callable[[argparse.Namespace, Console], tuple[int, Document]] = options.verb
        code, document = verb(options, console)
    except InputError as error:
        code, document = 2, {"error": str(error)}
        print(f"wayproof: {error}", file=sys.stderr)
    except KeyboardInterrupt:
        code, document = 130, {"error": "interrupted"}
        print("wayproof: interrupted; the log so far is readable as .partial", file=sys.stderr)
    if as_json:
        print(msgspec.json.encode(document).decode())
    return code


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Run one episode."""
    from harness.live import print_verdict

    named = {"world": options.world, "robot": options.robot, "seed": options.seed}
    config = override(from_document(named), options.set)
    for name in ("goal", "start"):
        if getattr(options, name) is not None:
            config = override(config, [f"{name}=[{getattr(options, name)}]"])
    path = options.log or options.logs / f"{episode_name(config)}.mcap"
    result = _run_one(config, path, console)
    print_verdict(console, result)
    return (0 if result.outcome == "success" else 1), asdict(result)


def replay(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Recompute the decisions of one or more logs."""
    from harness.live import print_replay
    from harness.replay import replay as replay_log

    replays = []
    for path in options.log:
        replays.append(replay_log(path, options.allow_plugins))
        print_replay(console, replays[-1])
    documents = [asdict(one) for one in replays]
    code = 0 if all(one.identical for one in replays) else 1
    return code, documents[0] if len(documents) == 1 else {"replays": documents}


def audit(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Check the decisions of one or more logs by slow, independent code."""
    from harness.audit import audit as audit_log
    from harness.live import print_audit

    audits = []
    for path in options.log:
        audits.append(audit_log(path, options.policy, options.allow_plugins))
        print_audit(console, audits[-1])
    documents = [asdict(one) for one in audits]
    code = 1 if any(one.violations for one in audits) else 0
    return code, documents[0] if len(documents) == 1 else {"audits": documents}


def list_registered(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Tell what is registered."""
    from maps import MAPS
    from models.devices import DEVICES
    from models.robots import ROBOTS
    from models.worlds import WORLDS
    from planners import PLANNERS

    document = {
        "worlds": sorted(WORLDS),
        "robots": sorted(ROBOTS),
        "sensors": sorted(DEVICES),
        "maps": sorted(MAPS),
        "planners": sorted(PLANNERS),
        "settings": setting_names(),
    }
    for kind, names in document.items():
        console.print(f"[bold]{kind}[/]: {', '.join(names)}", highlight=False)
    return 0, document


def demo(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Send both robots across one warehouse and replay their logs."""
    from harness.live import print_demo
    from harness.replay import replay as replay_log

    rows = []
    for robot in ("quadruped", "drone"):
        config = from_document({"world": "warehouse", "robot": robot, "seed": options.seed})
        result = _run_one(config, options.logs / f"{episode_name(config)}.mcap", console)
        rows.append((robot, result, replay_log(Path(result.log))))
    print_demo(console, rows)
    good = all(r.outcome == "success" and again.identical for _, r, again in rows)
    document = {"episodes": [{**asdict(r), "replay": asdict(again)} for _, r, again in rows]}
    return (0 if good else 1), document


def bench(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Measure one stage."""
    from harness.bench import print_rows, run_stage

    rows = run_stage(options.stage, options.repeats, options.seed)
    print_rows(console, f"bench {options.stage}, seed {options.seed}", rows)
    return 0, {"rows": rows}


def episode_name(config: Config) -> str:
    """`world-robot-seed`, and eight digits of the config's hash where anything was set."""
    name = f"{config.world}-{config.robot}-{config.seed}"
    if config == Config(config.world, config.robot, config.seed):
        return name
    return f"{name}-{hashlib.sha256(to_json(config)).hexdigest()[:8]}"


def _run_one(config: Config, path: Path, console: Console) -> Any:
    """Build, compile, run with a live line; a disk that fills up is told as such."""
    from harness.episode import run_episode
    from harness.live import LiveLine
    from harness.log import check_folder
    from harness.scenario import build
    from harness.warm_up import warm_up

    scenario = build(config)
    for warning in scenario.warnings:
        print(f"wayproof: warning: {warning}", file=sys.stderr)
    check_folder(path.parent)
    with console.status("compiling kernels (a minute the first time, then cached)"):
        warm_up(config)
    try:
        with LiveLine(console, config.robot) as line:
            return run_episode(scenario, path, line)
    except OSError as error:
        if error.errno not in (errno.ENOSPC, errno.EDQUOT, errno.EIO):
            raise
        raise InputError(f"log '{path}': {error.strerror}; what fitted is in .partial") from None


class _Parser(argparse.ArgumentParser):
    """An argument parser whose errors are our one-line errors."""

    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message} (see '{self.prog} --help')")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="wayproof",
        description="Was the space that the robot entered proven safe, and if not, why did it go?",
    )
    verbs = parser.add_subparsers(title="verbs", required=True, metavar="VERB")
    for add_verb in VERBS.values():
        add_verb(verbs)
    return parser


def _add_run(verbs: Any) -> None:
    parser = verbs.add_parser(
        "run",
        help="run one episode and write its log",
        epilog="example: wayproof run warehouse --robot drone --seed 3 --set map.resolution=0.05",
    )
    parser.add_argument("world", metavar="WORLD", help="see 'wayproof list'")
    parser.add_argument("--robot", required=True, help="see 'wayproof list'")
    parser.add_argument("--seed", required=True, type=int, help="of the world and all randomness")
    parser.add_argument("--goal", metavar="X,Y[,Z]", help="in place of the world's own, m")
    parser.add_argument("--start", metavar="X,Y[,Z]", help="in place of the world's own, m")
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="override a setting, repeatable; names by 'wayproof list'",
    )
    parser.add_argument("--log", type=Path, metavar="FILE", help="the log's name")
    _finish(parser, run, logs=True)


def _add_replay(verbs: Any) -> None:
    parser = verbs.add_parser(
        "replay",
        help="recompute every decision of a log and compare bit by bit",
        epilog="example: wayproof replay logs/warehouse-drone-3.mcap",
    )
    parser.add_argument("log", metavar="LOG", type=Path, nargs="+")
    _add_plugins(parser)
    _finish(parser, replay)


def _add_plugins(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--allow-plugins",
        action="store_true",
        help="import the planner that a log names as module:Class",
    )


def _add_audit(verbs: Any) -> None:
    from maps import UnknownPolicy

    parser = verbs.add_parser(
        "audit",
        help="check that every committed path lay in space its map knew to be free",
        epilog="example: wayproof audit logs/warehouse-drone-3.mcap",
    )
    parser.add_argument("log", metavar="LOG", type=Path, nargs="+")
    parser.add_argument(
        "--policy",
        choices=get_args(UnknownPolicy),
        help="hold paths against this unknown policy in place of the log's own",
    )
    _add_plugins(parser)
    _finish(parser, audit)


def _add_list(verbs: Any) -> None:
    parser = verbs.add_parser("list", help="worlds, robots, maps, planners and settings")
    _finish(parser, list_registered)


def _add_demo(verbs: Any) -> None:
    parser = verbs.add_parser("demo", help="both robots across a warehouse, and both logs replayed")
    parser.add_argument("--seed", type=int, default=0)
    _finish(parser, demo, logs=True)


def _add_bench(verbs: Any) -> None:
    parser = verbs.add_parser(
        "bench",
        help="how fast one stage is on this machine, and whether its results are right",
        epilog="example: wayproof bench rays --json",
    )
    parser.add_argument("stage", metavar="STAGE", help="loop, map, plan, rays or robots")
    parser.add_argument(
        "--repeats",
        type=int,
        metavar="N",
        help="sweeps, queries or episodes of each row; by default as many as the stage needs",
    )
    parser.add_argument("--seed", type=int, default=0, help="of the scenes (default: 0)")
    _finish(parser, bench)


def _finish(
    parser: argparse.ArgumentParser,
    verb: Callable[[argparse.Namespace, Console], tuple[int, Document]],
    logs: bool = False,
) -> None:
    if logs:
        parser.add_argument("--logs", type=Path, default=LOGS, metavar="FOLDER", help="log folder")
    parser.add_argument("--json", action="store_true", help="one JSON document on stdout")
    parser.set_defaults(verb=verb)


VERBS: dict[str, Callable[[Any], None]] = {
    "run": _add_run,
    "replay": _add_replay,
    "audit": _add_audit,
    "list": _add_list,
    "demo": _add_demo,
    "bench": _add_bench,
}
