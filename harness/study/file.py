"""Study files (TOML): variants, seeds, perturbations and gates of a study."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec

from wayproof.harness.config import BUILTIN, CODE, PLUGIN
from wayproof.harness.errors import InputError, unknown_name
from wayproof.harness.perturbations import PERTURBATIONS, perturbation_from
from wayproof.harness.perturbations.perturbation import MAX_SEVERITY
from wayproof.harness.recordings.options import RecordingOptions
from wayproof.harness.scenario.robots import controller_of
from wayproof.harness.study.gate import Gate, SequentialGate, read_gate
from wayproof.harness.study.imported import Imports, import_worlds
from wayproof.harness.study.randomise import check_ranges
from wayproof.harness.worker_pool import Bounds
from wayproof.models.toml_text import parse_toml

PACKAGED = Path(__file__).parent / "packaged"
"""Folder of the packaged studies: `wayproof study NAME`."""


MOST_EPISODES = 100_000
"""Maximum number of episodes of a study; planning them takes seconds and 0.25 GiB."""

MOST_ARMS = 5000
"""Maximum number of combinations of worlds, robots, axes and perturbations."""

MOST_BYTES = 2**20
"""Maximum size of a study file, bytes."""


LEAST_SEVERITY = 0.05
"""Least severity of a falsification."""

Word = bool | int | float | str | None
Value = Word | list[Word | list[Word]] | dict[str, Word | list[Word]]
"""A setting: no date, and nested no deeper than a list of points or a perturbation is."""

Seed = Annotated[int, msgspec.Meta(ge=0, le=2**63 - 1)]

Kind = Literal["grid", "threshold", "calibrate", "falsify"]


class ThresholdOptions(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Bisection of a study of kind `threshold`.

    Attributes:
        episodes: Maximum number of episodes of one seed: 2 at the ends and 9 halvings are 11.
    """

    episodes: Annotated[int, msgspec.Meta(ge=2, le=100)] = 12


class CalibrateOptions(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Judgement of a study of kind `calibrate`.

    Attributes:
        bound: Share of episodes that may collide.
    """

    bound: Annotated[float, msgspec.Meta(gt=0.0, lt=1.0)] = 0.05


class FalsifyOptions(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Search of a study of kind `falsify`.

    Attributes:
        window: Duration of the perturbation, s.
        greatest: Greatest severity.
        budget: Maximum number of episodes of one search, without the unperturbed one and those that
            shorten the window.
        seed: Seed of the search.
    """

    window: Annotated[float, msgspec.Meta(gt=0.0, le=3600.0)] = 2.0
    greatest: Annotated[float, msgspec.Meta(gt=LEAST_SEVERITY, le=MAX_SEVERITY)] = MAX_SEVERITY
    budget: Annotated[int, msgspec.Meta(ge=1)] = 100
    seed: Seed = 0


class StudyFile(
    msgspec.Struct,
    frozen=True,
    forbid_unknown_fields=True,
    rename={"settings": "set", "imports": "import"},
):
    """A study as written.

    Attributes:
        name: Name of the study and of its folder.
        kind: `grid` runs every combination; `threshold` bisects the severity at which each seed
            fails; `falsify` searches for a failure of each episode; `calibrate` is a grid of one
            axis, whose smallest value with rare collisions it names.
        robots: Names of robots.
        stacks: Navigation stacks, as `stack.name` has them; the built-in one is the reference, or
            else the first. Empty: the one of the settings.
        seeds: Number of seeds, counted from 0, or the seeds.
        worlds: Names of worlds, or files: beside the study file, or by the working folder.
        imports: Import of a folder of worlds, in place of their names.
        recordings: Files or folders of recordings, in place of worlds.
        read: Selection of each recording.
        settings: `section.field` -> value, for every episode; a `perturbation` here acts on the
            unperturbed arms as well.
        randomise: `section.field` -> least and greatest value; each seed has a value of its own,
            the same in all arms. Two whole numbers draw whole ones.
        axes: `section.field` -> values; every combination is a variant, the first is the reference.
        perturbations: `KIND` or `KIND:MODE` -> severities; each episode is paired with the
            unperturbed twin of its seed. `threshold` and `falsify` choose the severities.
        gates: Conditions on metrics, as `success.drop <= 0.05`.
        sequential: Whether the gates may be looked at after any seed, in the order of the seeds,
            and seeds may be added.
        bounds: Limits of one episode.
        threshold: Options of a bisection.
        calibrate: Options of a calibration.
        falsify: Options of a falsification.
    """

    name: str
    robots: list[str]
    seeds: int | list[Seed]
    kind: Kind = "grid"
    worlds: list[str] = []
    imports: Imports | None = None
    recordings: list[str] = []
    read: RecordingOptions = RecordingOptions()
    stacks: list[str] = []
    settings: dict[str, Value] = {}
    randomise: dict[str, list[int | float]] = {}
    axes: dict[str, list[Value]] = {}
    perturbations: dict[str, list[float]] = {}
    gates: list[str] = []
    sequential: bool = False
    bounds: Bounds = Bounds()
    threshold: ThresholdOptions = ThresholdOptions()
    calibrate: CalibrateOptions = CalibrateOptions()
    falsify: FalsifyOptions = FalsifyOptions()

    @property
    def searches(self) -> bool:
        """Whether it chooses severities itself, from unperturbed episodes on."""
        return self.kind in ("threshold", "falsify")

    @property
    def folder(self) -> str:
        """Name of its folder: its name, with the kind behind it."""
        plain = self.kind == "grid" or self.name.endswith(self.kind)
        return self.name if plain else f"{self.name}-{self.kind}"


def read_study(name: str, allow_plugins: bool = False, settings: Sequence[str] = ()) -> StudyFile:
    """Read a study file, or a packaged study by its name.

    Args:
        name: Name of the file or of the packaged study.
        settings: `NAME=VALUE` in place of what is written: a field of the file, as `seeds` or
            `falsify.budget`, or else a setting of every episode.
        allow_plugins: Allow the study to name code of the user, which its episodes import.

    Raises:
        InputError: No such file or study, no TOML, too large, or fields that are missing, unknown
            or wrong; or it names code and may not.
    """
    path = Path(name)
    if not path.suffix and not path.is_file():
        path = PACKAGED / f"{name}.toml"
        if not path.is_file():
            raise unknown_name("study", name, [one.stem for one in PACKAGED.glob("*.toml")])
    try:
        document = _beside(path, parse_toml(_text_of(path, name)))
        for text in settings:
            _set(document, text)
        study = _imported(msgspec.convert(document, StudyFile))
    except OSError as error:
        raise InputError(f"study '{name}': {error.strerror}") from None
    except (ValueError, RecursionError) as error:  # no TOML, no text, or values of another type
        raise InputError(f"study '{name}': {' '.join(str(error).split())[:300]}") from None
    check_study(study)
    if not allow_plugins:
        refuse_code(study)
    return study


def _beside(path: Path, document: dict[str, Any]) -> dict[str, Any]:
    """Take files of worlds and robots that lie beside a study file by its folder."""
    for field in ("worlds", "robots"):
        names = document.get(field)
        if isinstance(names, list):
            document[field] = [
                str(path.parent / name)
                if isinstance(name, str) and "." in name and (path.parent / name).is_file()
                else name
                for name in names
            ]
    return document


def _imported(study: StudyFile) -> StudyFile:
    """Import the worlds of a study that names a folder of them."""
    if study.imports is None:
        return study
    if study.worlds or study.recordings or len(study.robots) != 1:
        raise InputError(f"study '{study.name}': [import] is for one robot and instead of worlds")
    seeds = seeds_of(study)
    worlds, imports = import_worlds(study.imports, study.name, study.robots[0], seeds)
    return msgspec.structs.replace(study, worlds=worlds, imports=imports)


FIELDS = {field.encode_name for field in msgspec.structs.fields(StudyFile)}

LISTS = ("worlds", "robots", "stacks", "recordings")


def _set(document: dict[str, Any], text: str) -> None:
    """Set one value of a document; words with commas stand for a list, or for perturbations.

    Raises:
        InputError: It is none.
    """
    key, equals, written = text.partition("=")
    if not equals:
        raise InputError(f"--set {text}: expected NAME=VALUE")
    try:
        value = msgspec.json.decode(written)
    except msgspec.DecodeError:
        value = written
    field, _, rest = key.partition(".")
    if field not in FIELDS:
        document.setdefault("set", {})[key] = value
    elif rest:
        document.setdefault(field, {})[rest] = value
    elif field in LISTS and isinstance(value, str):
        document[field] = value.split(",")
    elif field == "perturbations" and isinstance(value, str):
        document[field] = {name: [] for name in value.split(",")}
    else:
        document[field] = value


def _text_of(path: Path, name: str) -> str:
    if path.exists() and not path.is_file():
        raise InputError(f"study '{name}': a folder or device, expected a file")
    size = path.stat().st_size
    if size > MOST_BYTES:
        raise InputError(f"study '{name}': {size} bytes, expected at most {MOST_BYTES}")
    return path.read_text(encoding="utf-8")


def check_study(study: StudyFile) -> None:
    """Check the sizes of a study before its episodes are listed.

    Raises:
        InputError: A field is out of its range; the message names it.
    """
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}", study.name):
        raise InputError(
            f"study name '{study.name}': expected letters, digits, '_', '.', '-', at most 64"
        )
    if study.worlds and study.recordings:
        raise InputError(f"study '{study.name}': worlds and recordings, expected one of the two")
    if study.read != RecordingOptions() and not study.recordings:
        raise InputError(f"study '{study.name}': read without recordings, expected both")
    for field in ("recordings" if study.recordings else "worlds", "robots"):
        if not getattr(study, field):
            raise InputError(f"study '{study.name}': {field} is empty, expected at least one")
    if _seed_count(study) < 1:
        raise InputError(f"study '{study.name}': seeds is empty, expected at least one")
    for what, count, most in (
        ("arms", arms_of(study), MOST_ARMS),
        ("episodes", episodes_of(study), MOST_EPISODES),
    ):
        if count > most:
            raise InputError(f"study '{study.name}': {count} {what}, expected at most {most}")
    if study.bounds.wall_s <= 0 or study.bounds.memory_mib < 512:
        raise InputError(
            f"study '{study.name}': bounds of {study.bounds.wall_s:g} s and "
            f"{study.bounds.memory_mib} MiB, expected more than 0 s and at least 512 MiB"
        )
    _check_kind(study)
    if study.recordings and study.randomise:
        raise InputError(
            f"study '{study.name}': [randomise] draws for worlds, and it has recordings"
        )
    check_ranges(study.randomise, [*study.settings, *study.axes])
    for text in study.gates:
        read_gate(text)


def _check_kind(study: StudyFile) -> None:
    """Check that a study has what its kind needs, and no options of another kind."""
    for kind in ("threshold", "calibrate", "falsify"):
        if kind != study.kind and getattr(study, kind) != type(getattr(study, kind))():
            raise InputError(f"study '{study.name}': [{kind}] in a study of kind {study.kind}")
    if study.kind != "grid" and study.recordings:
        raise InputError(
            f"study '{study.name}': {study.kind} of recordings, expected simulated episodes, "
            "which can fail"
        )
    if study.kind == "calibrate":
        values = [value for some in study.axes.values() for value in some]
        numbers = [value for value in values if isinstance(value, int | float)]
        if len(study.axes) != 1 or len(values) < 2 or values != sorted(numbers):
            raise InputError(
                f"study '{study.name}': a calibration has one axis of at least two rising numbers"
            )
        if study.perturbations:
            raise InputError(
                f"study '{study.name}': [perturbations] of a calibration, expected "
                "`perturbation` in [set]"
            )
    if not study.searches:
        return
    if not study.perturbations:
        raise InputError(
            f"study '{study.name}': no [perturbations] to search, expected --set perturbations=KIND"
        )
    for name in study.perturbations:
        kind, *mode = name.split(":")
        if any(part.replace(".", "", 1).isdigit() for part in mode):
            raise InputError(f"perturbation '{name}': the search chooses the severity")
        perturbation_from(":".join([kind, "1", *mode]))
        if study.kind == "falsify" and not PERTURBATIONS[kind].windowed:
            raise InputError(
                f"perturbation '{name}': acts all the time, expected one that can act within a "
                "window"
            )


def arms_of(study: StudyFile) -> int:
    """Return the number of combinations of worlds, robots, stacks, axes and perturbations."""
    variants = len(stacks_of(study)) * math.prod(len(values) for values in study.axes.values())
    levels = study.perturbations.values()
    perturbed = 1 + (len(levels) if study.searches else sum(map(len, levels)))
    places = len(study.worlds) + len(study.recordings)
    return places * len(study.robots) * variants * perturbed


def levels_of(study: StudyFile) -> dict[str, list[float]]:
    """Return the severities of each perturbation that are planned; none where they are searched."""
    return {} if study.searches else study.perturbations


def gates_of(study: StudyFile) -> list[Gate]:
    """Return the gates; none of a search, whose unperturbed episodes alone are planned."""
    kind = SequentialGate if study.sequential else Gate
    return [] if study.searches else [read_gate(text, kind) for text in study.gates]


def episodes_of(study: StudyFile) -> int:
    """Return the number of episodes; a seed given twice counts twice."""
    return arms_of(study) * _seed_count(study)


def _seed_count(study: StudyFile) -> int:
    return study.seeds if isinstance(study.seeds, int) else len(study.seeds)


def refuse_code(study: StudyFile) -> None:
    """Refuse a study that names code of the user, before any of it is imported.

    Raises:
        InputError: It does; the message names the setting or the robot's file.
    """
    for key, value in settings_and_values(study):
        if key == "robot_file" or (key in CODE and PLUGIN in str(value)):
            raise InputError(
                f"study '{study.name}' sets {key} to '{str(value)[:80]}', which is code outside "
                "Wayproof; expected --allow-plugins to load it"
            )
    for robot in () if study.recordings else study.robots:
        controller = controller_of(robot)
        if PLUGIN in controller:
            raise InputError(
                f"study '{study.name}': robot '{robot}' has the controller '{controller[:80]}', "
                "which is code outside Wayproof; expected --allow-plugins to load it"
            )


def settings_and_values(study: StudyFile) -> Iterator[tuple[str, Any]]:
    """Yield every setting with each of its values."""
    yield from study.settings.items()
    for key, values in study.axes.items():
        for value in values:
            yield key, value
    for stack in study.stacks:
        yield "stack.name", stack


def stacks_of(study: StudyFile) -> list[str]:
    """Return the stacks without repetition, the reference first; one empty name without stacks."""
    named = list(dict.fromkeys(study.stacks))
    return sorted(named, key=lambda name: name != BUILTIN) or [""]


def seeds_of(study: StudyFile) -> list[int]:
    """Return the seeds without repetition, in the order given."""
    seeds = range(study.seeds) if isinstance(study.seeds, int) else study.seeds
    return list(dict.fromkeys(seeds))


def files_of(study: StudyFile) -> list[str]:
    """Return the names of worlds, robots, planners and stacks, which may be files."""
    simulated = () if study.recordings else (*study.worlds, *study.robots)
    return [*simulated, *(str(one) for key, one in settings_and_values(study) if key in CODE)]
