"""Types the blocks of a page, in order, in a folder of its own.

`sh` blocks are typed whole. `console` blocks are typed on a small scale: episodes end early, a
study has one seed, and `make` tells what it would do. What is not typed even so stands in `UNTYPED`
with the reason, and is held against the parser of its command.

`python -m tests.docs.typist docs/PAGE.md` writes what a page quotes anew, each line as the printed
one that is most like it; what the page says of it is to be read again.
"""

import contextlib
import difflib
import hashlib
import importlib.util
import io
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import tomllib
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from docs.blocks import HERE, blocks, commands
from tests.sharing import alone
from wayproof.harness.bench.episodes import crossing as bench_crossing
from wayproof.harness.bench.episodes import worlds as bench_worlds
from wayproof.harness.bench.stages import STAGES
from wayproof.harness.cli.main import main, verb_parsers
from wayproof.harness.cli.run import episode_name
from wayproof.harness.config import from_document, override
from wayproof.harness.perturbations import perturbation_from
from wayproof.harness.replay.signature import new_key
from wayproof.harness.study.file import PACKAGED, plan_episodes, read_study
from wayproof.models.robots.custom import parse_spec
from wayproof.models.worlds import WORLDS

ROOT = Path(__file__).parents[2]
PYTHONPATH = os.pathsep.join((str(ROOT / "src"), str(ROOT)))
FOUND = {**os.environ, "PYTHONPATH": PYTHONPATH, "COLUMNS": "80"}
TARGETS = re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(), re.MULTILINE)

UNTYPED = {
    r"\. \.venv/bin/activate": "the tests run in an environment already",
    r"pip install .*": "installs from the network",
}
"""Commands that are held against their parser alone, and why."""

SHORT = 1.0
"""How long an episode lasts on a small scale, s; up to the last decision that a whole block asks
for.
"""

COARSE = 0.2
"""Cells on a small scale, m; of a drone, as a step of the other robot is too small for them."""

EARLY = 5
"""The decision that is asked for on a small scale in place of a later one."""

NOISE = re.compile(
    r"(?<=simulated in )\d+\.\d(?= s)|(?<=; )\d+\.\d(?= s;)|(?<=log )\d+\.\d(?= MB/min)"
    r"|sense [\d.]+, map [\d.]+, costmap [\d.]+, plan [\d.]+"
    r"|\b[0-9a-f]{12,32}\b"
)
"""Wall times, sizes that hold them, and hashes, which are one machine's."""

SMALLER = {
    "threshold": "--episodes 2".split(),
    "calibrate": "--seeds 2 --margins 0.02,0.1 --set episode.time_limit=0.5"
    " --set map.resolution=0.2".split(),
    "demo": "--set episode.time_limit=0.5".split(),
    "falsify": "--budget 3 --window 1 --set goal=[6.0,1.65] --set episode.time_limit=5"
    " --set map.resolution=0.2".split(),
}
"""What else is typed for a verb on a small scale."""

MANY = ("study", "threshold", "calibrate", "falsify")
"""Verbs that start processes: each loads everything, which takes longer than a short episode."""

STAGES_SMALLER = {
    "coverage": "--repeats 2".split(),
    "crossing": "--repeats 1 --rows kept-crossing.jsonl".split(),
    "worlds": "--repeats 1 --rows kept-worlds.jsonl".split(),
    "plan": "--repeats 2".split(),
    "map": "--repeats 1 --only ghosts".split(),
    "robots": "--repeats 1 --only hover".split(),
    "loop": "--repeats 1 --only light".split(),
    "rays": "--repeats 1".split(),
}
"""What else is typed for a stage of `bench`: one episode or problem after those that are kept."""

MAP_ROWS = (
    [
        {
            "part": "speed",
            "resolution_m": 0.1,
            "range_m": 10.0,
            "library": library,
            "mode": "clamped",
            "threads": 1,
            "ms_per_sweep": ms,
            "ms_p99": ms,
            "ratio_vs_pyoctomap": ratio,
            "map_mib": 1.0,
        }
        for library, ms, ratio in (("wayproof", 2.0, 4.0), ("pyoctomap", 8.0, 1.0))
    ]
    + [
        {
            "part": "ghosts",
            "library": "wayproof",
            "clamp_high": clamp,
            "half_life_s": 0.0,
            "unseen_s": 0.0,
            "sweeps_to_free": sweeps,
            "sweeps_by_formula": sweeps,
        }
        for clamp, sweeps in ((0.8, 4), (0.97, 9))
    ]
    + [
        {
            "part": "accuracy",
            "resolution_m": 0.1,
            "library": "wayproof",
            "mode": "clamped",
            "floor_columns_lost": 0.01,
            "false_free": 0.02,
        },
    ]
)
"""A few rows such as `bench map` prints: made up, they go into a folder of their own."""

EPISODE = {"seed": 0, "outcome": "success", "time_s": 9.0, "clearance_m": 0.3, "reason": "at rest"}

CROSSING_ROWS = [
    {"robot": robot, "way": way, "own": 0, "at_rest": 0, "cause": "", **EPISODE}
    for robot in bench_crossing.ROBOTS
    for way in (bench_crossing.ALONE, *bench_crossing.WAYS)
    if (robot, way) != ("drone", bench_crossing.ALONE)
]
WORLD_ROWS = [
    {"world": world, "robot": robot, "spl": 1.0, "struck": 0, **EPISODE}
    for world in WORLDS
    for robot in bench_worlds.ROBOTS
    if (world, robot) != ("empty", "drone")
]
"""Rows of all episodes but one, made up; the one that is missing is run."""

LOG = re.compile(r"logs/([a-z]+)-([a-z]+)-(\d+)\.mcap(\.partial)?")


class Typist:
    """One reader of one page.

    Attributes:
        ran: How many blocks were really run or read.
        undrawn: Why pictures that were asked for could not be drawn on this machine.
        told: What the last block that ran has printed.
    """

    def __init__(self, page, episodes):
        """Sit down in this folder; `episodes` holds the logs that any page has asked for."""
        self.ran = 0
        self.undrawn = []
        self._whole_blocks = "".join(one.text for one in blocks(page) if one.kind == "sh")
        self._episodes = episodes
        self._names = {"__name__": "page"}
        self.told, self._whole = "", True
        sit_down()

    def type(self, block):
        """Type one block, and hold what comes of it against the page."""
        if block.kind == "text":
            assert self._whole, (
                f"quoted after a block that is typed on a small scale:\n{block.text}"
            )
            return hold_quote(block.text, self.told)
        if block.kind in ("sh", "console", "yaml"):
            return self._type_commands(block)
        self.ran += 1
        if block.kind == "python":
            with contextlib.redirect_stdout(io.StringIO()) as out:
                exec(compile(block.text, "page", "exec"), self._names)
            self.told, self._whole = out.getvalue(), True
        else:
            path = Path(block.options.get("file", f"page.{block.kind}"))
            path.parent.mkdir(parents=True, exist_ok=True)
            if (ROOT / path).is_file():
                assert (ROOT / path).read_text() == block.text, f"{path} is another"
            path.write_text(block.text)
            READERS[block.kind](path)

    def _type_commands(self, block):
        self.told, self._whole, code, typed = "", block.kind == "sh", 0, False
        expected = int(block.options.get("exit", 0))
        for line in lines_of(block):
            if reason_against(line):
                hold_against_parser(shlex.split(line, comments=True))
                continue
            code, typed = self._type_line(line), True
            undecided = code == 3 and not self._whole  # one seed decides no gate
            assert undecided or code in (0, 1, expected), f"{line}: exit code {code}\n{self.told}"
        assert not self._whole or code == expected, f"{line}: exit code {code}\n{self.told}"
        self.ran += typed

    def _type_line(self, line):
        if HERE.match(line):
            first, _, rest = line.partition("\n")
            Path(first.split()[2]).write_text(rest.removesuffix("END\n"))
            return 0
        if line == "export PYTHONPATH=.":
            sys.path.insert(0, str(Path.cwd()))
            return 0
        words = shlex.split(line, comments=True)
        words, out = (words[:-2], words[-1]) if words[-2:-1] == [">"] else (words, None)
        for word in words:
            self._give(word)
        program, *words = words
        if Path(program).name == "wayproof":
            code, told = self._type_ours(words)
        elif program == "make":
            code, told = dry_run(words)
        elif words[0] == "docs/plot_maps.py":
            code, told = plot_here(words)
        else:
            assert program == "python", f"cannot type: {line}"
            if "--count" in words and not self._whole:
                words += ["--count", "10"]
            if (script := ROOT / words[0]).is_file():
                words[0] = str(script)
            code, told = in_a_process(words)
        if "no picture here" in told:
            self.undrawn.append(told.strip())
            code = 0
        self.told += told
        if out:
            Path(out).write_text(told)
        return code

    def _type_ours(self, words):
        verb = words[0]
        if verb == "sign" and "--key" in words:
            key = Path(words[words.index("--key") + 1])
            if not key.exists():
                new_key(key)
        if not self._whole:
            if verb == "study" and "--worlds" not in words:
                words = [verb, smaller_study(words[1]), *words[2:]]
            if "--worlds" in words:
                words = with_options(words, ["--repeats", "1"])
            if "--check-determinism" in words:
                words = with_options(words, ["--sample", "1"])
            if verb == "bench":
                words = with_options(words, STAGES_SMALLER.get(words[1], []))
            if "--movie" in words:
                words = with_options(words, ["--period", "0.5"])
            if verb == "threshold":
                words = [verb, smaller_study(words[1]), *words[2:]]
            if verb in ("explain", "picture") and words[2:3] and words[2].isdecimal():
                words = [*words[:2], str(min(int(words[2]), EARLY)), *words[3:]]
            words = with_options(smaller_world(words), SMALLER.get(verb, []))
            if verb == "view" and "--save" not in words:
                words += ["--save", "view.rrd"]  # opens no window
        if verb in MANY:
            words = with_options(words, ["--jobs", "1"])
        if verb == "run":
            return self._run(words)
        if verb == "picture":  # needs a driver chosen before the simulator is loaded
            return as_a_command(words)
        return in_here(words)

    def _run(self, words):
        """One episode; the one that has been run for another block is not run again."""
        log = log_of(words)
        if not self._whole:
            asked = rf"(?:explain|picture) {re.escape(str(log))} (\d+)"
            last = max(map(int, re.findall(asked, self._whole_blocks)), default=0)
            limit = f"episode.time_limit={max(SHORT, 0.1 * last + 0.2):g}"
            words = with_options(words, ["--set", limit])
            flies = verb_parsers()["run"].parse_args(words[1:]).robot == "drone"
            words = with_options(words, ["--set", f"map.resolution={COARSE if flies else 0.1}"])
        if "--log" in words:
            at = words.index("--log")
            words = words[:at] + words[at + 2 :]
        files = [Path(word).read_bytes() for word in words if Path(word).is_file()]
        key = hashlib.sha256(repr((words, files)).encode()).hexdigest()[:16]
        kept = self._episodes / f"{key}.mcap"
        told = kept.with_suffix(".json")
        with alone(kept.with_suffix(".lock")):
            if not told.exists():
                words = [*words, "--log", str(kept)]
                ran = as_a_command(words) if "--render" in words else in_here(words)
                if ran[0] not in (0, 1):
                    return ran
                told.write_text(json.dumps(ran))
        log.parent.mkdir(exist_ok=True)
        shutil.copy(kept, log)
        return json.loads(told.read_text())

    def _give(self, word):
        """Make what a page takes for given: a log of its own name, a study before and after."""
        if Path(word).exists():
            return
        if named := LOG.fullmatch(word):
            world, robot, seed, partial = named.groups()
            log = Path(word.removesuffix(".partial"))
            whole, self._whole = self._whole, False
            self._run(["run", world, "--robot", robot, "--seed", seed, "--log", str(log)])
            self._whole = whole
            if partial:
                Path(word).write_bytes(log.read_bytes()[:-100])
        elif word in ("logs/before", "logs/after"):
            shutil.copytree("logs/smoke", word)
        elif word.startswith("docs/") and (ROOT / word).is_file():
            Path(word).parent.mkdir(exist_ok=True)
            shutil.copy(ROOT / word, word)


def sit_down():
    """What lies in the folder of somebody who types: the clone's models, files of others."""
    Path("docs").mkdir()
    Path("models").symlink_to(ROOT / "models")
    pillar = (
        "<model name='p'><static>1</static><pose>-3.5 7 0 0 0 0</pose><link name='l'><collision"
        " name='c'><geometry><cylinder><radius>0.075</radius><length>1</length></cylinder>"
        "</geometry></collision></link></model>"
    )
    world = f"<sdf version='1.6'><world name='default'>{pillar}</world></sdf>"
    Path("world_1.world").write_text(world)
    Path("DIR").mkdir()
    Path("DIR/world_1.world").write_text(world)
    np.save("DIR/path_1.npy", np.array([[16, j] for j in range(31)]))
    Path("DIR/easy_0.csv").write_text("s, 8, 0, 4, 1, 0, 0, 0, 1.5, 1.5, 1.5")
    Path("FILE.3dmap").write_text("voxel 6 6 6\n3 3 3\n")
    problems = "0 0 0 4 2 1 5.14626437 1.0\n0 0 0 5 0 0 5.0 1.0\n"
    Path("FILE.3dscen").write_text(f"version 1\nFILE.3dmap\n{problems}")
    keep_rows(Path("kept-crossing.jsonl"), CROSSING_ROWS)
    keep_rows(Path("kept-worlds.jsonl"), WORLD_ROWS)


def keep_rows(path, rows):
    """What a bench that was ended has left; it goes on with the row that is missing."""
    path.write_text("".join(f"{json.dumps(row)}\n" for row in rows))


def smaller_study(name):
    """A study of one of each, one seed and half a second; as a file, whose name is told."""
    path = Path(name) if Path(name).is_file() else PACKAGED / f"{name}.toml"
    study = tomllib.loads(path.read_text())
    worlds = ["empty" if world in WORLDS else world for world in study["worlds"][:1]]
    robots = ["drone"] if "drone" in study["robots"] else study["robots"][:1]
    study |= {"worlds": worlds, "robots": robots, "seeds": 1}
    settings = {**study.pop("set", {}), "episode.time_limit": 0.5}
    if robots == ["drone"]:
        settings["map.resolution"] = COARSE
    tables = {"set": settings}
    for table in ("axes", "perturbations"):
        tables[table] = {key: values[:2] for key, values in [*study.pop(table, {}).items()][:1]}
    tables["perturbations"] = {key: one[:1] for key, one in tables["perturbations"].items()}
    lines = [f"{key} = {json.dumps(value)}" for key, value in study.items()]
    for table, entries in tables.items():
        lines += [f"[{table}]", *(f'"{key}" = {json.dumps(v)}' for key, v in entries.items())]
    small = Path(f"small-{path.name}")
    small.write_text("\n".join(lines))
    return str(small)


def log_of(words):
    """Where the log of a `run` with these words lies."""
    options = verb_parsers()["run"].parse_args(words[1:])
    if options.log:
        return options.log
    named = {"world": options.world, "robot": options.robot, "seed": options.seed}
    config = override(from_document(named), options.set)
    if options.perturb:
        config = replace(config, perturbation=perturbation_from(options.perturb))
    return options.logs / f"{episode_name(config)}.mcap"


def with_options(words, options):
    """Words with these options, each with its value, in place of any of the same name."""
    words = list(words)
    for name, value in zip(options[::2], options[1::2], strict=True):
        key = f"{value.partition('=')[0]}=" if name == "--set" else ""
        for at in reversed(range(1, len(words) - 1)):
            if words[at] == name and words[at + 1].startswith(key):
                del words[at : at + 2]
        words += [name, value]
    return words


def smaller_world(words):
    """The empty world; a search begins with an episode that reaches the goal: soonest there."""
    if words[0] == "calibrate":
        return [*words[:2], "empty", *words[3:]]
    if words[0] != "falsify":
        return words
    at = words.index("--seed") + 1
    return ["falsify", "empty", *words[2:at], "1", *words[at + 1 :]]


def dry_run(words):
    """Have make tell what it would do; what it would run is there."""
    ended = subprocess.run(
        ["make", "-n", *words], cwd=ROOT, capture_output=True, text=True, check=False
    )
    modules = re.findall(r"python -m (\S+)", ended.stdout)
    missing = [name for name in modules if importlib.util.find_spec(name) is None]
    assert not missing, f"make {words}: no module {missing}"
    return ended.returncode, ended.stdout + ended.stderr


def plot_here(words):
    """Fill tables and draw pictures in this folder's copy of the pages."""
    shutil.copy(ROOT / "docs/plot_maps.py", "docs")
    shutil.copy(ROOT / "docs/maps.md", "docs")
    Path(words[1]).write_text(json.dumps({"rows": MAP_ROWS}))
    ended = in_a_process(words)
    drawn = {"map-speed.svg", "map-ghosts.svg", "map-accuracy.svg"}
    assert drawn <= {path.name for path in Path("docs").iterdir()}, ended
    return ended


def in_here(words):
    """Run our command in this process; returns its exit code and what it printed."""
    told = io.StringIO()
    with contextlib.redirect_stdout(told), contextlib.redirect_stderr(told):
        code = main(words)
    return code, told.getvalue()


def as_a_command(words):
    """Run our command in a process of its own."""
    return in_a_process(["-m", "wayproof", *words])


def in_a_process(words):
    """Run Python in one of its own; returns its exit code and what it printed."""
    ended = subprocess.run(
        [sys.executable, *words], env=FOUND, capture_output=True, text=True, check=False
    )
    return ended.returncode, ended.stdout + ended.stderr


def lines_of(block):
    """The commands of a block that has some; a workflow's are behind `run:`."""
    if block.kind == "yaml":
        return re.findall(r"run: (.+)", block.text)
    return commands(block) if block.kind in ("sh", "console") else []


def reason_against(line):
    """Why a command is not typed; empty if it is."""
    typed = "" if HERE.match(line) else " ".join(shlex.split(line, comments=True))
    return next((why for form, why in UNTYPED.items() if re.fullmatch(form, typed)), "")


def hold_against_parser(words):
    """Whether a command could be typed: its program, its verb, its options, its files."""
    program, *rest = words
    if Path(program).name == "wayproof":
        options = verb_parsers()[rest[0]].parse_args(rest[1 : _end(rest)])
        assert rest[0] != "bench" or options.stage in STAGES, words
    elif program == "make":
        assert rest[0] in TARGETS, words
    elif program == "python":
        found = importlib.util.find_spec(rest[1]) if rest[0] == "-m" else (ROOT / rest[0]).exists()
        assert found, words
    else:
        assert program in ("pip", "."), words


def _end(words):
    return words.index(">") if ">" in words else len(words)


def hold_quote(quote, told):
    """Each quoted line was printed, in this order; `...` stands for anything."""
    left = [blurred(line) for line in told.splitlines()]
    for line in filter(str.strip, quote.splitlines()):
        parts = map(re.escape, blurred(line).split("..."))
        form = re.compile(".*".join(parts))
        at = next((at for at, other in enumerate(left) if form.fullmatch(other)), None)
        assert at is not None, f"the page quotes\n{line}\nbut what was printed is\n{told}"
        left = left[at + 1 :]


def blurred(line):
    """A line without what is one run's own."""
    return " ".join(NOISE.sub("#", line).split())


def read_toml(path):
    """Read a study or a robot's spec."""
    if "mjcf" in tomllib.loads(path.read_text()):
        parse_spec(path.read_text())
    else:
        plan_episodes(read_study(str(path)))


READERS = {
    "toml": read_toml,
    "json": lambda path: json.loads(path.read_text()),
    "xml": ElementTree.parse,
}


def quote_anew(page):
    """Type a page, and put what is printed now in place of what it quotes."""
    text = page.read_text()
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        Path("episodes").mkdir()
        typist = Typist(text, Path("episodes").resolve())
        for block in blocks(text):
            if block.kind != "text":
                typist.type(block)
                continue
            printed = {blurred(line): line.rstrip() for line in typist.told.splitlines()}
            lines = block.text.splitlines()
            for at, line in enumerate(lines):
                if "..." not in line and blurred(line) not in printed:
                    lines[at] = printed[difflib.get_close_matches(blurred(line), printed, 1, 0)[0]]
            text = text.replace(block.text, "\n".join([*lines, ""]), 1)
    page.write_text(text)


if __name__ == "__main__":
    os.environ["COLUMNS"] = "80"
    for name in sys.argv[1:]:
        quote_anew(ROOT / name)
