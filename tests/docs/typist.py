"""Run the blocks of a page, in order, in a folder of its own.

`sh` blocks run in full. `console` blocks run on a small scale: episodes end early, a study has one
seed, and `make` does a dry run. Commands in `UNTYPED` do not run, for the reason there; they are
checked against the parser of their program.

`python -m tests.docs.typist docs/PAGE.md` updates the quoted output of a page, each line to the
most similar printed one; the prose around it is to be checked by hand.
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
from tests.harness.interface.cpp import compiler
from tests.sharing import alone
from wayproof.harness.bench.episodes import crossing as bench_crossing
from wayproof.harness.bench.episodes import worlds as bench_worlds
from wayproof.harness.bench.stages import STAGES
from wayproof.harness.cli.main import main, verb_parsers
from wayproof.harness.cli.run import episode_name
from wayproof.harness.config_document import from_document, override
from wayproof.harness.perturbations import perturbation_from
from wayproof.harness.replay.signature import new_key
from wayproof.harness.study.file import PACKAGED, read_study
from wayproof.harness.study.plan import plan_episodes
from wayproof.models.robots.custom import parse_spec
from wayproof.models.worlds import WORLDS

ROOT = Path(__file__).parents[2]
PYTHONPATH = os.pathsep.join((str(ROOT / "src"), str(ROOT)))
FOUND = {**os.environ, "PYTHONPATH": PYTHONPATH, "COLUMNS": "80"}
TARGETS = re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)

UNTYPED = {
    r"\. \.venv/bin/activate": "the tests run in an environment already",
    r"pip install .*": "installs from the network",
    r"wayproof robot check my_robot.*": "the reader's own robot",
    r"wayproof bench loop --only light .*": "tests/harness/bench/micro/test_loop.py runs it",
    r"wayproof bench robots(?! --only).*": "tests/harness/bench/test_stages.py runs it",
    r"wayproof study barn --worlds .*": "tests/harness/bench/published/test_barn.py runs it",
    r"wayproof falsify .*--budget 100": "tests/harness/study/falsify/test_falsify.py runs it",
    r"wayproof bench rays .*": "tests/harness/bench/micro/test_rays.py runs it",
    r"wayproof study .* --check-determinism .*": "tests/harness/study/test_determinism.py runs it",
    r"wayproof calibrate .*": "tests/harness/study/test_calibration.py runs it",
    r"wayproof lab logs/.*": "docs/tutorials/recording.md runs the verb in full",
    r"wayproof picture logs/warehouse-drone-3.*": "docs/get-started.md runs the verb in full",
    r"wayproof picture .* --movie docs/.*": "docs/seeing.md runs it with another log",
    r"wayproof run .* --render .*": "tests/harness/viewer/test_movie.py runs it",
    r"wayproof run .* --view .*": "tests/harness/viewer/test_rerun_view.py runs it",
}
"""Commands that are only checked against their parser, and the reason."""

SHORT = 1.0
"""Duration of an episode on a small scale, s; longer if a full block needs a later decision."""

COARSE = 0.2
"""Cell size on a small scale, m, for a drone; the other robot's steps are too small for it."""

EARLY = 5
"""Decision on a small scale instead of a later one."""

NOISE = re.compile(
    r"(?<=simulated in )\d+\.\d(?= s)|(?<=; )\d+\.\d(?= s;)|(?<=log )\d+\.\d(?= MB/min)"
    r"|sense [\d.]+, map [\d.]+, costmap [\d.]+, plan [\d.]+"
    r"|\b[0-9a-f]{12,32}\b"
)
"""Wall times, sizes that depend on them, and hashes, which vary by machine."""

SMALLER = {
    "threshold": "--episodes 2".split(),
    "demo": "--set episode.time_limit=0.5".split(),
    "falsify": "--budget 3 --window 1 --set goal=[6.0,1.65] --set episode.time_limit=5"
    " --set map.resolution=0.2".split(),
    "shadow": "--end 2".split(),
}
"""Additional options of a verb on a small scale."""

MANY = ("study", "threshold", "falsify")
"""Verbs that start processes, each of which takes longer to load than a short episode."""

ONCE = (*MANY, "bench", "demo")
"""Verbs whose command on a small scale runs once, though several blocks hold it."""

STAGES_SMALLER = {
    "threshold": "--episodes 2".split(),
    "coverage": "--repeats 2".split(),
    "crossing": "--repeats 1 --rows kept-crossing.jsonl".split(),
    "worlds": "--repeats 1 --rows kept-worlds.jsonl".split(),
    "plan": "--repeats 2".split(),
    "map": "--repeats 1 --only ghosts".split(),
    "robots": "--repeats 1 --only hover".split(),
    "halls": "--repeats 1 --only 20".split(),
}
"""Additional options of a stage of `bench`: one episode or problem after the kept ones."""

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
"""Invented rows in the form of `bench map`, written to a folder of their own."""

EPISODE = {"seed": 0, "outcome": "success", "time_s": 9.0, "clearance_m": 0.3, "reason": "at rest"}

CROSSING_ROWS = [
    {"robot": robot, "way": way, "own": 0, "at_rest": 0, "cause": "", **EPISODE}
    for robot in bench_crossing.ROBOTS
    for way in (bench_crossing.ALONE, *bench_crossing.MAPS)
    if (robot, way) != ("drone", bench_crossing.ALONE)
]
WORLD_ROWS = [
    {"world": world, "robot": robot, "spl": 1.0, "struck": 0, **EPISODE}
    for world in WORLDS
    for robot in bench_worlds.ROBOTS
    if (world, robot) != ("empty", "drone")
]
"""Invented rows of all episodes but one, which is run."""

LOG = re.compile(r"logs/([a-z]+)-([a-z]+)-(\d+)\.mcap(\.partial)?")


class Typist:
    """Runner of the blocks of one page.

    Attributes:
        ran: Number of blocks run or parsed.
        undrawn: Errors of pictures that could not be drawn on this machine.
        output: Text printed by the last block that ran.
    """

    def __init__(self, page, episodes):
        """Set up the current folder; `episodes` is a cache of logs shared by all pages."""
        self.ran = 0
        self.undrawn = []
        self._whole_blocks = "".join(one.text for one in blocks(page) if one.kind == "sh")
        self._episodes = episodes
        self._names = {"__name__": "page"}
        self.output, self._whole = "", True
        set_up_folder()

    def type(self, block):
        """Run one block, and check the quotes of the page against its output."""
        if block.kind == "text":
            assert self._whole, (
                f"quoted after a block that is typed on a small scale:\n{block.text}"
            )
            return check_quote(block.text, self.output)
        if block.kind in ("sh", "console", "yaml"):
            return self._type_commands(block)
        self.ran += 1
        if block.kind == "python":
            with contextlib.redirect_stdout(io.StringIO()) as out:
                exec(compile(block.text, "page", "exec"), self._names)
            self.output, self._whole = out.getvalue(), True
        else:
            path = Path(block.options.get("file", f"page.{block.kind}"))
            path.parent.mkdir(parents=True, exist_ok=True)
            if (ROOT / path).is_file():
                assert (ROOT / path).read_text() == block.text, f"{path} is another"
            path.write_text(block.text)
            READERS[block.kind](path)

    def _type_commands(self, block):
        self.output, self._whole, code, typed = "", block.kind == "sh", 0, False
        expected = int(block.options.get("exit", 0))
        for line in commands_of(block):
            if reason_untyped(line):
                check_against_parser(shlex.split(line, comments=True))
                continue
            code, typed = self._type_line(line), True
            undecided = code == 3 and not self._whole  # one seed decides no gate
            assert undecided or code in (0, 1, expected), f"{line}: exit code {code}\n{self.output}"
        assert not self._whole or code == expected, f"{line}: exit code {code}\n{self.output}"
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
            self._provide(word)
        program, *words = words
        if Path(program).name == "wayproof":
            code, output = self._type_ours(words)
        elif program == "make":
            code, output = dry_run(words)
        elif program == "c++":
            code, output = compile_here(words)
        elif program == "mkdir":
            code, output = make_folders(words)
        elif words[0] == "docs/plot_maps.py":
            code, output = plot_maps(words)
        else:
            assert program == "python", f"cannot type: {line}"
            if any(word.endswith(".soak") for word in words) and not self._whole:
                words += ["--count", "5"]
            if (script := ROOT / words[0]).is_file():
                words[0] = str(script)
            code, output = run_python(words)
        if "no picture here" in output:
            self.undrawn.append(output.strip())
            code = 0
        self.output += output
        if out:
            Path(out).write_text(output)
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
            return run_command(words)
        if verb in ONCE and not self._whole:
            return self._run_once(words)
        return run_here(words)

    def _run_once(self, words):
        """Run a command, or copy what it wrote and printed where another block held it."""
        kept = self._kept(words)
        with alone(kept.with_suffix(".lock")):
            if not kept.exists():
                before = set(Path.cwd().rglob("*"))
                ran = run_here(words)
                written = [path for path in Path.cwd().rglob("*") if path not in before]
                for path in filter(Path.is_file, written):
                    copy = kept / "files" / path.relative_to(Path.cwd())
                    copy.parent.mkdir(parents=True, exist_ok=True)
                    shutil.copy2(path, copy)
                kept.mkdir(exist_ok=True)
                (kept / "ran.json").write_text(json.dumps(ran))
        if (kept / "files").exists():
            shutil.copytree(kept / "files", Path.cwd(), dirs_exist_ok=True)
        return json.loads((kept / "ran.json").read_text())

    def _kept(self, words):
        """Where the outcome of a command is kept: one place for the same words and files."""
        files = [Path(word).read_bytes() for word in words if Path(word).is_file()]
        key = hashlib.sha256(repr((words, files)).encode()).hexdigest()[:16]
        return self._episodes / key

    def _run(self, words):
        """Run one episode, or reuse the one of another block."""
        log = log_of(words)
        if not self._whole:
            shown = rf"(?:explain|picture) {re.escape(str(log))} (\d+)"
            last = max(map(int, re.findall(shown, self._whole_blocks)), default=0)
            limit = f"episode.time_limit={max(SHORT, 0.1 * last + 0.2):g}"
            words = with_options(words, ["--set", limit])
            flies = verb_parsers()["run"].parse_args(words[1:]).robot == "drone"
            words = with_options(words, ["--set", f"map.resolution={COARSE if flies else 0.1}"])
        if "--log" in words:
            at = words.index("--log")
            words = words[:at] + words[at + 2 :]
        kept = self._kept(words).with_suffix(".mcap")
        output = kept.with_suffix(".json")
        with alone(kept.with_suffix(".lock")):
            if not output.exists():
                words = [*words, "--log", str(kept)]
                ran = run_here(words)
                if ran[0] not in (0, 1):
                    return ran
                output.write_text(json.dumps(ran))
        log.parent.mkdir(exist_ok=True)
        shutil.copy(kept, log)
        return json.loads(output.read_text())

    def _provide(self, word):
        """Create a file that a page presupposes: a log by its name, a study before and after."""
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


def make_folders(words):
    """Make folders as `mkdir -p` does."""
    assert words[0] == "-p", words
    for name in words[1:]:
        Path(name).mkdir(parents=True, exist_ok=True)
    return 0, ""


def set_up_folder():
    """Set up the folder of a page: links to models and examples, and files of other programs."""
    Path("docs").mkdir()
    for folder in ("models", "examples"):
        Path(folder).symlink_to(ROOT / folder)
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
    """Write the rows of an interrupted bench, which continues with the missing one."""
    path.write_text("".join(f"{json.dumps(row)}\n" for row in rows))


def smaller_study(name):
    """A study of one of each, one seed and half a second; the name of its file."""
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
    """Path of the log of a `run` with these words."""
    options = verb_parsers()["run"].parse_args(words[1:])
    if options.log:
        return options.log
    named = {"world": options.world, "robot": options.robot, "seed": options.seed}
    config = override(from_document(named), options.set)
    if options.perturb:
        config = replace(config, perturbation=perturbation_from(options.perturb))
    return options.logs / f"{episode_name(config)}.mcap"


def with_options(words, options):
    """Words with these options and values, replacing options of the same name."""
    words = list(words)
    for name, value in zip(options[::2], options[1::2], strict=True):
        key = f"{value.partition('=')[0]}=" if name == "--set" else ""
        for at in reversed(range(1, len(words) - 1)):
            if words[at] == name and words[at + 1].startswith(key):
                del words[at : at + 2]
        words += [name, value]
    return words


def smaller_world(words):
    """Use the empty world, where the first episode of `falsify` reaches the goal soonest."""
    if words[0] != "falsify":
        return words
    at = words.index("--seed") + 1
    return ["falsify", "empty", *words[2:at], "1", *words[at + 1 :]]


def dry_run(words):
    """Run make without its commands; check that the modules in them exist."""
    ended = subprocess.run(
        ["make", "-n", *words], cwd=ROOT, capture_output=True, text=True, check=False
    )
    modules = re.findall(r"python -m (\S+)", ended.stdout)
    missing = [name for name in modules if importlib.util.find_spec(name) is None]
    assert not missing, f"make {words}: no module {missing}"
    return ended.returncode, ended.stdout + ended.stderr


def compile_here(words):
    """Compile C++ by this machine's compiler, or by the one of `ziglang`."""
    ended = subprocess.run([*compiler(), *words], capture_output=True, text=True, check=False)
    return ended.returncode, ended.stdout + ended.stderr


def plot_maps(words):
    """Fill the tables and draw the pictures in a copy of the pages."""
    shutil.copy(ROOT / "docs/plot_maps.py", "docs")
    shutil.copy(ROOT / "docs/maps.md", "docs")
    Path(words[1]).write_text(json.dumps({"rows": MAP_ROWS}))
    ended = run_python(words)
    drawn = {"map-speed.svg", "map-ghosts.svg", "map-accuracy.svg"}
    assert drawn <= {path.name for path in Path("docs").iterdir()}, ended
    return ended


def run_here(words):
    """Run wayproof in this process; return its exit code and output."""
    output = io.StringIO()
    with contextlib.redirect_stdout(output), contextlib.redirect_stderr(output):
        code = main(words)
    return code, output.getvalue()


def run_command(words):
    """Run wayproof in a process of its own; return its exit code and output."""
    return run_python(["-m", "wayproof", *words])


def run_python(words):
    """Run Python in a process of its own; return its exit code and output."""
    ended = subprocess.run(
        [sys.executable, *words], env=FOUND, capture_output=True, text=True, check=False
    )
    return ended.returncode, ended.stdout + ended.stderr


def commands_of(block):
    """The commands of a block; in a workflow they follow `run:`."""
    if block.kind == "yaml":
        return re.findall(r"run: (.+)", block.text)
    return commands(block) if block.kind in ("sh", "console") else []


def reason_untyped(line):
    """The reason for not running a command; empty if it runs."""
    typed = "" if HERE.match(line) else " ".join(shlex.split(line, comments=True))
    return next((why for form, why in UNTYPED.items() if re.fullmatch(form, typed)), "")


def check_against_parser(words):
    """Assert that a command is valid: its program, verb, options and files."""
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


def check_quote(quote, output):
    """Assert that each quoted line was printed, in this order; `...` matches anything."""
    left = [blurred(line) for line in output.splitlines()]
    for line in filter(str.strip, quote.splitlines()):
        parts = map(re.escape, blurred(line).split("..."))
        form = re.compile(".*".join(parts))
        at = next((at for at, other in enumerate(left) if form.fullmatch(other)), None)
        assert at is not None, f"the page quotes\n{line}\nbut what was printed is\n{output}"
        left = left[at + 1 :]


def blurred(line):
    """A line without the parts that vary from run to run."""
    return " ".join(NOISE.sub("#", line).split())


def read_toml(path):
    """Parse a study or a robot's spec."""
    if "mjcf" in tomllib.loads(path.read_text()):
        parse_spec(path.read_text())
    else:
        plan_episodes(read_study(str(path)))


READERS = {
    "toml": read_toml,
    "json": lambda path: json.loads(path.read_text()),
    "xml": ElementTree.parse,
}


def update_quotes(page):
    """Run a page, and replace its quotes by the present output."""
    text = page.read_text()
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        Path("episodes").mkdir()
        typist = Typist(text, Path("episodes").resolve())
        for block in blocks(text):
            if block.kind != "text":
                typist.type(block)
                continue
            printed = {blurred(line): line.rstrip() for line in typist.output.splitlines()}
            lines = block.text.splitlines()
            for at, line in enumerate(lines):
                if "..." not in line and blurred(line) not in printed:
                    lines[at] = printed[difflib.get_close_matches(blurred(line), printed, 1, 0)[0]]
            text = text.replace(block.text, "\n".join([*lines, ""]), 1)
    page.write_text(text)


if __name__ == "__main__":
    os.environ["COLUMNS"] = "80"
    for name in sys.argv[1:]:
        update_quotes(ROOT / name)
