"""Read or run the blocks of a page, in order, in a folder of its own.

Reading a block checks its commands against the parsers of their programs, compiles its code, parses
its file. Running it, `sh` blocks run in full and `console` blocks on a small scale: episodes end
early, a study has one seed, and `make` does a dry run. Commands in `UNTYPED` are read only, for the
reason there.

`python -m tests.docs.typist docs/PAGE.md` updates the quoted output of a page; the prose around it
is to be checked by hand.
"""

import contextlib
import hashlib
import importlib.util
import io
import json
import os
import re
import shlex
import shutil
import sys
import tempfile
import tomllib
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

from docs.blocks import FENCED, HERE, blocks, commands
from tests.docs.page_folder import set_up_folder
from tests.docs.programs import (
    ROOT,
    TARGETS,
    compile_here,
    dry_run,
    make_folders,
    run_command,
    run_here,
    run_python,
)
from tests.docs.quotes import check_quote, updated_quote
from tests.docs.small_scale import (
    COARSE,
    EARLY,
    ONCE,
    SHORT,
    SMALLER,
    smaller_study,
    with_options,
)
from tests.sharing import alone
from wayproof.harness.bench import BENCHES
from wayproof.harness.cli.main import parse
from wayproof.harness.cli.run import episode_name
from wayproof.harness.config import BUILTIN
from wayproof.harness.config_document import from_document, override
from wayproof.harness.interface.stacks import STACKS
from wayproof.harness.perturbations import perturbation_from
from wayproof.harness.replay.signature import new_key
from wayproof.harness.study.file import PACKAGED, read_study
from wayproof.harness.study.plan import plan_episodes
from wayproof.models.robots.custom import parse_spec

UNTYPED = {
    r"\. \.venv/bin/activate": "the tests run in an environment already",
    r"pip install .*": "installs from the network",
    r"wayproof import robot my_robot.*": "the reader's own robot",
    r"ray start .*": "starts what outlives the page",
    r"wayproof study .* --engine ray .*": "tests/harness/study/test_cluster.py runs it",
    r"wayproof bench .*": "tests/harness/bench/test_bench.py runs it",
    r"python -m tests.tools.trials.robots.*": "tests/of_tools/test_trials.py runs it",
    r"python -m tests.tools.statistics.*": "tests/of_tools/test_verdicts.py runs it",
    r"wayproof study (barn|dodge) .*": "tests/harness/study/test_imported.py runs it",
    r"wayproof study falsify .*budget=100": "tests/harness/study/test_falsify.py runs it",
    r"wayproof study .* --check-determinism .*": "tests/harness/study/test_determinism.py runs it",
    r"wayproof study calibrate .*": "tests/harness/study/test_calibration.py runs it",
    r"wayproof lab logs/.*": "docs/recordings.md runs the verb in full",
    r"wayproof view .* --movie .*": "tests/harness/viewer/test_movie.py runs it",
    r"wayproof run .* --view .*": "tests/harness/viewer/test_rerun_view.py runs it",
}
"""Commands that are only checked against their parser, and the reason."""

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
            self._write_file(block)

    def read(self, block):
        """Check one block without running it."""
        self.ran += block.kind != "text"
        if block.kind == "python":
            compile(block.text, "page", "exec")
        elif block.kind in READERS:
            self._write_file(block)
        for line in commands_of(block):
            if line.startswith(("cat >", "mkdir")):  # what later blocks presuppose
                self._type_line(line)
            else:
                check_against_parser(shlex.split(line, comments=True))

    def _write_file(self, block):
        """Write the file of a block, and parse it."""
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
        if "--sign" in words:
            key = Path(words[words.index("--sign") + 1])
            if not key.exists():
                new_key(key)
        if not self._whole:
            if verb == "study":
                words = [verb, smaller_study(words[1]), *words[2:]]
            if "--movie" in words:
                words = with_options(words, ["--period", "0.5"])
            for at in (2, words.index("--decision") + 1 if "--decision" in words else len(words)):
                if verb in ("explain", "view") and "".join(words[at : at + 1]).isdecimal():
                    words[at] = str(min(int(words[at]), EARLY))
            words = with_options(words, SMALLER.get(verb, []))
            if verb == "view" and not {"--save", "--png", "--movie"} & set(words):
                words += ["--save", "view.rrd"]  # opens no window
        if verb == "study":
            words = with_options(words, ["--jobs", "1"])
        if verb == "run":
            return self._run(words)
        if {"--png", "--movie"} & set(
            words
        ) and verb == "view":  # needs a driver chosen before the simulator is loaded
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
            shown = rf"(?:explain {re.escape(str(log))}|--decision) (\d+)"
            last = max(map(int, re.findall(shown, self._whole_blocks)), default=0)
            limit = f"episode.time_limit={max(SHORT, 0.1 * last + 0.2):g}"
            words = with_options(words, ["--set", limit])
            flies = parse(words).robot == "drone"
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


def log_of(words):
    """Path of the log of a `run` with these words."""
    options = parse(words)
    if options.log:
        return options.log
    named = {"world": options.world, "robot": options.robot, "seed": options.seed}
    config = override(from_document(named), options.set)
    if options.perturb:
        config = replace(config, perturbation=perturbation_from(options.perturb))
    return options.logs / f"{episode_name(config)}.mcap"


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
        options = parse(rest[: _end(rest)])
        assert rest[0] != "bench" or options.part in BENCHES, words
        assert rest[0] != "run" or log_of(rest), words
        stack = getattr(options, "stack", None) or BUILTIN
        assert not stack.isidentifier() or stack in {BUILTIN, *STACKS, "ros2"}, words
        if rest[0] == "study":
            assert Path(rest[1]).suffix or (PACKAGED / f"{rest[1]}.toml").is_file(), words
    elif program == "make":
        assert rest[0] in TARGETS, words
    elif program == "python":
        scripts = ROOT / rest[0], Path(rest[0])
        found = (
            importlib.util.find_spec(rest[1]) if rest[0] == "-m" else any(map(Path.exists, scripts))
        )
        assert found, words
    else:
        assert program in ("pip", ".", "c++", "export", "ray"), words


def _end(words):
    return words.index(">") if ">" in words else len(words)


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
    """Run a page, and replace its quotes by the present output, each in its own place."""
    text = page.read_text()
    updated, end = "", 0
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        Path("episodes").mkdir()
        typist = Typist(text, Path("episodes").resolve())
        for block, fenced in zip(blocks(text), FENCED.finditer(text), strict=True):
            if block.kind != "text":
                typist.type(block)
                continue
            updated += text[end : fenced.start(2)] + updated_quote(block.text, typist.output)
            end = fenced.end(2)
    page.write_text(updated + text[end:])


if __name__ == "__main__":
    os.environ["COLUMNS"] = "80"
    for name in sys.argv[1:]:
        update_quotes(ROOT / name)
