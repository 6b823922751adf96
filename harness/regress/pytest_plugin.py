"""Plugin of pytest: a gate of a study is a test, and a test runs for each seed of an episode.

Each gate of the studies below `--wayproof FOLDER` is a test. Their episodes are kept in
`.wayproof` beside the study file, so a second run asks only for what has changed. A test function
of the marker `wayproof` runs once for each seed, with the log of that episode:

    @pytest.mark.wayproof("warehouse", robot="drone", stack="my_stack.py:MyStack", seeds=5)
    def test_it_arrives(episode):
        assert episode.outcome == "success"
"""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterable, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from wayproof.harness.api.episode import RecordedEpisode
    from wayproof.harness.study.result import StudyResult

KEPT = ".wayproof"
"""Folder with the logs, beside a study file."""

MARKER = "wayproof"

FIELDS = {"name", "robots", "seeds"}
"""Fields by which a TOML file is known for a study."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options."""
    group = parser.getgroup("wayproof")
    group.addoption(
        "--wayproof", metavar="FOLDER", action="append", default=[], type=Path,
        help="run the studies of Wayproof (*.toml) below a folder, each gate as a test",
    )  # fmt: skip
    group.addoption(
        "--wayproof-set", metavar="NAME=VALUE", action="append", default=[],
        help="a field of every study, as stacks=my_stack.py:MyStack; repeatable",
    )  # fmt: skip


def pytest_configure(config: pytest.Config) -> None:
    """Collect the folders of `--wayproof` beside what is collected anyway; name the marker."""
    config.addinivalue_line(
        "markers",
        f"{MARKER}(world, robot=, seeds=, ...): run with the `episode` of each seed, a number of "
        "seeds or a list; the other arguments are those of `wayproof.run`",
    )
    config.args.extend(str(folder) for folder in config.getoption("--wayproof"))


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> pytest.Collector | None:
    """Collect the study files below the folders of `--wayproof`."""
    folders = [folder.resolve() for folder in parent.config.getoption("--wayproof")]
    if file_path.suffix != ".toml" or not any(one in file_path.parents for one in folders):
        return None
    from wayproof.models.toml_text import parse_toml

    try:
        fields = parse_toml(file_path.read_text(encoding="utf-8"))
    except ValueError:  # no TOML: the study says so when it is read
        fields = dict.fromkeys(FIELDS)
    if not fields.keys() >= FIELDS:
        return None
    study: pytest.Collector = StudyTests.from_parent(parent, path=file_path)
    return study


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Run a test of the marker once for each of its seeds."""
    marker = metafunc.definition.get_closest_marker(MARKER)
    if marker is None:
        return
    seeds = marker.kwargs.get("seeds", 1)
    numbers = range(seeds) if isinstance(seeds, int) else list(seeds)
    if "episode" not in metafunc.fixturenames or not numbers:  # it would pass, and nothing ran
        got = "no argument 'episode'" if numbers else "no seeds"
        raise pytest.Collector.CollectError(
            f"marker '{MARKER}' of {metafunc.function.__name__}: {got}, expected at least one seed "
            "and the argument 'episode'"
        )
    metafunc.parametrize("episode", numbers, ids=[f"seed {one}" for one in numbers], indirect=True)


@pytest.fixture
def episode(request: pytest.FixtureRequest, tmp_path: Path) -> RecordedEpisode:
    """Episode of one seed of the marker `wayproof`; a failing test names its log."""
    import wayproof

    marker = request.node.get_closest_marker(MARKER)
    if marker is None:
        pytest.fail(f"fixture 'episode': expected a test of the marker '{MARKER}'", pytrace=False)
    given = {name: value for name, value in marker.kwargs.items() if name != "seeds"}
    log = tmp_path / "episode.mcap"
    try:
        ran = wayproof.run(*marker.args, seed=request.param, log=log, **given)
    except (wayproof.InputError, TypeError) as error:  # a name of the marker, or its value
        pytest.fail(f"marker '{MARKER}': {error}", pytrace=False)
    lines = [f"{ran.outcome} {ran.reason}".strip(), f"next: wayproof explain {log}"]
    request.node.add_report_section("call", "wayproof", "\n".join(lines))
    return ran


class StudyTests(pytest.File):
    """The gates of a study file as tests; its episodes run before the first of them."""

    def collect(self) -> Iterable[pytest.Item]:
        """Yield a test for each gate."""
        from wayproof.harness.errors import InputError

        try:
            gates = self._study.gates
        except InputError as error:
            raise self.CollectError(str(error)) from None
        if not gates:
            raise self.CollectError(f"study '{self.path}': no gates, expected at least one")
        for text in gates:
            yield GateTest.from_parent(self, name=text, gate=text)

    @cached_property
    def _study(self) -> Any:
        from wayproof.harness.study.file import read_study

        given = self.config.getoption("--wayproof-set")
        return read_study(str(self.path), allow_plugins=True, settings=given)

    @cached_property
    def result(self) -> StudyResult:
        """Result of the study: the missing episodes are run, by one process of pytest at a time."""
        from wayproof.harness.study.plan import plan_episodes
        from wayproof.harness.study.processes import ProcessEngine
        from wayproof.harness.study.store import Store
        from wayproof.harness.study.study import run_study

        store = Store(self.path.parent / KEPT / self._study.folder)
        store.folder.mkdir(parents=True, exist_ok=True)
        workers = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
        jobs = max((os.cpu_count() or 1) // workers, 1)
        with (store.folder / ".pytest").open("w") as held:
            fcntl.flock(held, fcntl.LOCK_EX)
            with ProcessEngine(jobs, self._study.bounds) as engine:
                planned = plan_episodes(self._study)
                return run_study(self._study, planned, store, engine, lambda done: None)


class GateTest(pytest.Item):
    """One gate of a study on all arms that it is judged on."""

    def __init__(self, *, gate: str, **of_item: Any) -> None:
        """Keep the text of the gate."""
        super().__init__(**of_item)
        self.gate = gate

    def runtest(self) -> None:
        """Fail unless the gate is held on every arm.

        Raises:
            pytest.fail.Exception: It is not, or an episode did not run.
        """
        from wayproof.harness.errors import InputError
        from wayproof.harness.study.gates import gate_in_words
        from wayproof.harness.study.lost import lost_in_words

        assert isinstance(self.parent, StudyTests)
        try:
            result = self.parent.result
        except InputError as error:
            pytest.fail(str(error), pytrace=False)
        judged = [one for one in result.gates if one.gate == self.gate]
        lines: Sequence[str] = [
            f"{one.verdict}: {gate_in_words(one)}" for one in judged if one.verdict != "held"
        ]
        if result.errors:
            lines = [*lines, f"{result.errors} episodes failed to run, first {result.first_error}"]
        if not judged or result.missing:
            lines = [*lines, "not judged: episodes are missing"]
        if lines:
            pytest.fail("\n".join([*lines, *lost_in_words(result.lost)]), pytrace=False)

    def reportinfo(self) -> tuple[Path, int, str]:
        """Return where the test is: the study file."""
        return self.path, 0, self.name
