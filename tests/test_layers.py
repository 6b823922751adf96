"""The direction of imports: harness -> planners -> maps, harness -> models, and no other way."""

import ast
from pathlib import Path

import pytest

from wayproof import harness, maps, models, planners

ROOT = Path(__file__).resolve().parents[1]
ALLOWED = {
    "maps": {"maps"},
    "models": {"models"},
    "planners": {"planners", "maps"},
    "harness": {"harness", "planners", "maps", "models"},
}
GROUND = {"bounds", "kernel_cache", "kernel_compiler", "plugin"}
"""Modules beside these folders that each may import."""

LAYERS = {
    "words": ("errors", "geometry", "schema", "statistics", "supervision"),
    "sections": (
        *("behaviour_config", "estimator_config", "prediction_config", "prior_config"),
        *("recording_config", "perturbations", "trajectory_error"),
    ),
    "records": (
        "decision",
        "forked",
        "listed_beams",
        "mission",
        "outputs",
        "prediction",
        "result",
        "worker_pool",
    ),
    "config": ("config", "clearance", "goals", "estimators"),
    "inputs": ("inputs",),
    "filters": ("filters",),
    "messages": ("config_document", "ending", "input_messages", "prior"),
    "stack": ("stack",),
    "interface": ("interface",),
    "user code": ("user_code",),
    "log": ("log",),
    "judge": ("judge",),
    "sources": ("recordings", "scenario", "tables", "trace"),
    "simulation": ("metrics", "recompute", "sim", "warm_up"),
    "loop": ("attribution", "episode"),
    "runs": ("explain", "runner"),
    "replay": ("gym", "replay"),
    "checks": ("counterfactual", "shadow"),
    "studies": ("lab", "study", "viewer"),
    "facade": ("api", "map_files"),
    "regression": ("regress",),
    "benchmarks": ("bench",),
    "command line": ("cli",),
}
"""Parts of the harness; each imports only those of layers above its own, in a function as well."""

SOURCES = sorted((ROOT / "harness").rglob("*.py"))

LAYER_OF = {part: number for number, parts in enumerate(LAYERS.values()) for part in parts}


def imported_names(source: Path) -> set[str]:
    """Full names of all that a file imports, at any depth of its code."""
    names = set()
    for node in ast.walk(ast.parse(source.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{source}: relative import"
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def imported_packages(source: Path) -> set[str]:
    return {package_of(name) for name in imported_names(source)}


def package_of(module):
    """The folder of a module of ours, or the top-level package of another.

    What the facade offers is the harness's, and so is all else beside the folders but the ground.
    """
    first, *rest = module.split(".")
    if first != "wayproof":
        return first
    return rest[0] if rest and rest[0] in ALLOWED.keys() | GROUND else "harness"


@pytest.mark.parametrize(
    ("line", "package"),
    [
        ("from wayproof.maps.voxel import voxel_map", "maps"),
        ("from wayproof import planners", "planners"),
        ("from wayproof import run_episode", "harness"),
        ("import wayproof.kernel_cache", "kernel_cache"),
        ("import wayproof", "harness"),
        ("import numpy.linalg", "numpy"),
    ],
)
def test_every_spelling_of_an_import_is_seen(tmp_path, line, package):
    (tmp_path / "module.py").write_text(line)
    assert imported_packages(tmp_path / "module.py") == {package}


@pytest.mark.parametrize("module", sorted(GROUND))
def test_the_ground_imports_no_folder(module):
    source = ROOT / "src" / "wayproof" / f"{module}.py"
    assert not imported_packages(source) & ALLOWED.keys()


@pytest.mark.parametrize("package", sorted(ALLOWED))
def test_imports_point_one_way(package):
    sources = list((ROOT / package).rglob("*.py"))
    assert sources
    for source in sources:
        ours = imported_packages(source) & ALLOWED.keys()
        assert ours <= ALLOWED[package], f"{source} imports {sorted(ours - ALLOWED[package])}"


def part_of(module):
    """The folder or file of the harness that a module belongs to; None if it is outside."""
    match module.split("."):
        case ["wayproof", "harness", part, *_]:
            return part
    return None


def test_parts_of_the_harness_import_only_those_of_layers_above():
    parts = {path.relative_to(ROOT / "harness").parts[0] for path in SOURCES}
    assert {part.removesuffix(".py") for part in parts} - {"__init__"} == LAYER_OF.keys()
    for source in SOURCES:
        part = source.relative_to(ROOT / "harness").with_suffix("").parts[0]
        if part == "__init__":
            continue
        imported = {part_of(name) for name in imported_names(source)} - {part, None}
        later = {one for one in imported if LAYER_OF[one] >= LAYER_OF[part]}
        assert not later, f"{source} imports {sorted(later)}"


def test_maps_needs_numpy_and_numba_alone():
    outside = {"numpy", "numba", "maps", "bounds", "kernel_compiler"}
    for source in (ROOT / "maps").rglob("*.py"):
        foreign = imported_packages(source) - outside - set(stdlib())
        assert not foreign, f"{source} imports {sorted(foreign)}"


def stdlib():
    import sys

    return sys.stdlib_module_names


def test_replaying_a_log_loads_neither_the_simulator_nor_the_viewer():
    import subprocess
    import sys

    code = (
        "import sys, wayproof.harness.replay.replay\n"
        "print([name for name in ('mujoco', 'rerun') if name in sys.modules])"
    )
    printed = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert printed.stdout.strip() == "[]"


def test_the_packages_are_those_of_this_checkout():
    for package in (harness, maps, models, planners):
        assert Path(package.__file__).resolve().parent.parent == ROOT


def test_the_facade_loads_a_name_when_it_is_used():
    import subprocess
    import sys

    code = (
        "import sys, wayproof\n"
        "assert not {'numpy', 'numba', 'mujoco'} & set(sys.modules)\n"
        "assert all(callable(getattr(wayproof, name)) for name in wayproof.__all__)\n"
        "assert sorted(wayproof.WHERE) == sorted(wayproof.__all__)\n"
        "wayproof.nothing"
    )
    ended = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert ended.stderr.splitlines()[-1].endswith("module 'wayproof' has no attribute 'nothing'")


def test_a_folder_of_the_root_is_no_package_by_itself():
    import subprocess
    import sys

    code = "import maps"
    ended = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert "expected 'import wayproof.maps'" in ended.stderr
