"""Commands of the docs on a small scale: short episodes, coarse maps, one seed."""

import json
import tomllib
from pathlib import Path

from wayproof.harness.study.file import PACKAGED
from wayproof.models.worlds import WORLDS

SHORT = 1.0
"""Duration of an episode on a small scale, s; longer if a full block needs a later decision."""

COARSE = 0.2
"""Cell size on a small scale, m, for a drone; the other robot's steps are too small for it."""

EARLY = 5
"""Decision on a small scale instead of a later one."""

SMALLER = {
    "shadow": "--end 2".split(),
}
"""Additional options of a verb on a small scale."""

ONCE = ("study", "bench")
"""Verbs whose command on a small scale runs once, though several blocks hold it."""


def smaller_study(name):
    """A study of one of each, one seed and half a second; the name of its file."""
    path = Path(name) if Path(name).is_file() else PACKAGED / f"{name}.toml"
    study = tomllib.loads(path.read_text())
    worlds = ["empty" if world in WORLDS else world for world in study["worlds"][:1]]
    robots = ["drone"] if "drone" in study["robots"] else study["robots"][:1]
    study |= {"worlds": worlds, "robots": robots, "seeds": 1}
    options = {
        kind: study.pop(kind) for kind in ("threshold", "calibrate", "falsify") if kind in study
    }
    settings = {**study.pop("set", {}), "episode.time_limit": 0.5}
    if robots == ["drone"]:
        settings["map.resolution"] = COARSE
    tables = {"set": settings, **options}
    for table in ("axes", "perturbations"):
        tables[table] = {key: values[:2] for key, values in [*study.pop(table, {}).items()][:1]}
    tables["perturbations"] = {key: one[:1] for key, one in tables["perturbations"].items()}
    lines = [f"{key} = {json.dumps(value)}" for key, value in study.items()]
    for table, entries in tables.items():
        lines += [f"[{table}]", *(f'"{key}" = {json.dumps(v)}' for key, v in entries.items())]
    small = Path(f"small-{path.name}")
    small.write_text("\n".join(lines))
    return str(small)


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
