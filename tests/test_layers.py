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


ORDER = (
    *("errors", "forked", "schema", "geometry", "perturbations", "renamed", "behaviour_config"),
    *("recording_config", "estimator_config", "prior_config", "prediction_config"),
    *("config", "config_document", "mission", "goals"),
    *("prediction", "listed_beams", "inputs", "input_messages"),
    *("prior.grid", "prior.cells", "estimators", "stack", "interface"),
    *("result", "ending", "outputs", "supervision"),
    *("user_code", "log", "recordings", "prior", "scenario", "recompute", "attribution"),
    *("warm_up", "sim", "episode", "runner"),
    *("replay", "shadow", "lab", "counterfactual", "study.statistics", "trajectory_error"),
    *("trace", "metrics", "clearance", "explain", "viewer", "tables", "map_files"),
    *("gym", "worker_pool", "study", "api", "bench", "cli", "bench.soak"),
)
"""Parts of the harness; each imports only those before it, be it in a function or for types."""


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

    What the facade offers is the harness's, and so is all else beside the folders.
    """
    first, *rest = module.split(".")
    if first != "wayproof":
        return first
    return rest[0] if rest and rest[0] in ALLOWED else "harness"


@pytest.mark.parametrize(
    ("line", "package"),
    [
        ("from wayproof.maps.voxel import voxel_map", "maps"),
        ("from wayproof import planners", "planners"),
        ("from wayproof import run_episode", "harness"),
        ("import wayproof.kernel_cache", "harness"),
        ("import wayproof", "harness"),
        ("import numpy.linalg", "numpy"),
    ],
)
def test_every_spelling_of_an_import_is_seen(tmp_path, line, package):
    (tmp_path / "module.py").write_text(line)
    assert imported_packages(tmp_path / "module.py") == {package}


@pytest.mark.parametrize("package", sorted(ALLOWED))
def test_imports_point_one_way(package):
    sources = list((ROOT / package).rglob("*.py"))
    assert sources
    for source in sources:
        ours = imported_packages(source) & ALLOWED.keys()
        assert ours <= ALLOWED[package], f"{source} imports {sorted(ours - ALLOWED[package])}"


def part_of(module):
    """The longest name in the order that a module of the harness belongs to; None if not ours."""
    name = module.removeprefix("wayproof.harness.")
    inside = [part for part in ORDER if f"{name}.".startswith(f"{part}.")]
    if name != module:
        assert inside, f"{module} has no place in ORDER"
        return max(inside, key=len)
    return None


def module_of(source):
    return ".".join(("wayproof", *source.relative_to(ROOT).with_suffix("").parts))


@pytest.mark.parametrize("part", ORDER)
def test_parts_of_the_harness_import_only_those_before_them(part):
    allowed = {*ORDER[: ORDER.index(part) + 1], None}
    sources = [
        source
        for source in (ROOT / "harness").rglob("*.py")
        if source.parent.name != "harness" or source.stem != "__init__"
        if part_of(module_of(source)) == part
    ]
    assert sources
    for source in sources:
        later = {part_of(name) for name in imported_names(source)} - allowed
        assert not later, f"{source} imports {sorted(later)}"


def test_maps_needs_numpy_and_numba_alone():
    outside = {"numpy", "numba", "llvmlite", "maps"}  # llvmlite is what numba itself stands on
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
