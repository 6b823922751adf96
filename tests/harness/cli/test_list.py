"""`wayproof list NAME`: kinds, names, sections, near names."""

import json
import resource
import subprocess
import sys

import pytest

from wayproof.harness.cli.main import main


def listed(capsys, *words):
    assert main(["list", *words, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_a_section_has_its_settings_alone(capsys):
    found = listed(capsys, "costmap")
    assert list(found) == ["settings"]
    assert all(name.startswith("costmap.") for name in found["settings"])


def test_a_name_of_two_kinds_has_both(capsys):
    assert set(listed(capsys, "pose_drift")) == {"perturbations", "studies"}


def test_a_severity_has_its_amount_and_unit(capsys):
    found = listed(capsys, "pose_jump")["perturbations"]["pose_jump"]
    assert (found["amounts"], found["unit"]) == ([0.03, 0.1, 0.3, 0.8, 1.4], "m")


def test_a_setting_is_printed_with_default_bounds_and_source(capsys):
    assert main(["list", "map.resolution"]) == 0
    shown = capsys.readouterr().out
    for text in ("Edge of a cell, m.", "0.1", "0.01 to 0.5", "maps/config.py"):
        assert text in shown


@pytest.mark.parametrize(
    ("typed", "near"), [("vlp16", "velodyne-vlp16"), ("RRTstar", "rrtstar"), ("Spot", "spot")]
)
def test_a_near_name_is_offered(capsys, typed, near):
    assert main(["list", typed]) == 2
    assert f"unknown name '{typed}'; did you mean '{near}'?" in capsys.readouterr().err


@pytest.mark.parametrize("words", [["list", "--json"], ["run", "--help"], ["--help"]])
def test_listing_and_help_load_nothing_heavy(words):
    code = (
        "import sys\nfrom wayproof.harness.cli.main import main\n"
        "try:\n    main(sys.argv[1:])\nexcept SystemExit:\n    pass\n"
        "heavy = {'numba', 'numpy', 'scipy', 'mujoco', 'ompl'} & set(sys.modules)\n"
        "assert not heavy, heavy"
    )
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, "-c", code, *words], check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert after.ru_utime - before.ru_utime < 1.0  # 0.15 s where nothing else runs
