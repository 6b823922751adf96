import json

import mujoco
import numpy as np
import pytest

from harness.bench_rays import SAMPLE, SCENES, disagreement, within
from harness.cli import main
from models.rays.scenes import clutter

FIELDS = [
    "scene",
    "geoms",
    "engine",
    "threads",
    "rays",
    "mray_per_s",
    "ratio_vs_multiray",
    "max_error_m",
    "id_mismatches",
]


@pytest.fixture(scope="module")
def rows():
    from harness.bench import run_stage

    return run_stage("rays", sweeps=1, seed=3)


def test_the_command_prints_rows_and_nothing_else(capsys):
    assert main(["bench", "rays", "--sweeps", "1", "--json"]) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    rows = json.loads(captured.out)["rows"]
    assert [list(row) for row in rows] == [FIELDS] * (3 * len(SCENES))


def test_every_engine_is_on_every_scene(rows):
    got = [(row["scene"], row["geoms"], row["engine"], row["threads"]) for row in rows]
    engines = ("tile", "mj_multiRay", "mj_ray")
    assert got == [(s.name, s.geoms, engine, 1) for s in SCENES for engine in engines]
    assert {row["rays"] for row in rows} == {100_000, 320 * 240, SAMPLE}


def test_engines_agree(rows):
    for row in rows:
        assert 0.0 <= row["max_error_m"] <= 1e-9, row
        assert row["id_mismatches"] == 0, row


def test_ratios_are_those_of_the_rates(rows):
    for i in range(0, len(rows), 3):
        multi = rows[i + 1]["mray_per_s"]
        for row in rows[i : i + 3]:
            assert row["mray_per_s"] > 0.0
            assert row["ratio_vs_multiray"] == pytest.approx(row["mray_per_s"] / multi)


def test_without_json_a_table(capsys):
    assert main(["bench", "rays", "--sweeps", "1"]) == 0
    printed = capsys.readouterr().out
    assert "bench rays, seed 0" in printed
    assert printed.count("mj_multiRay") == len(SCENES)
    assert "…" not in printed


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["bench", "ray"], "unknown stage 'ray'; did you mean 'rays'? (available: rays)"),
        (["bench", "nothing"], "unknown stage 'nothing' (available: rays)"),
        (["bench"], "the following arguments are required: STAGE"),
        (["bench", "rays", "--sweeps", "0"], "sweeps: got 0, expected 1 to 1000"),
        (["bench", "rays", "--seed", "-1"], "seed: got -1"),
    ],
)
def test_bad_words_are_refused_in_one_line(capsys, arguments, said):
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert said in captured.err


def test_disagreement_by_hand():
    got = np.array([1.0, -1.0, 3.0]), np.array([4, -1, 6], np.int32)
    expected = np.array([1.5, -1.0, 3.0]), np.array([4, -1, 7], np.int32)
    assert disagreement(got, expected) == (0.5, 1)


def test_hits_beyond_range_become_misses():
    distance, ids = within((np.array([2.0, 2.5, -1.0]), np.array([3, 4, -1], np.int32)), 2.0)
    assert distance.tolist() == [2.0, -1.0, -1.0]
    assert ids.tolist() == [3, -1, -1]


def test_clutter_has_the_asked_geoms_and_movers():
    model = mujoco.MjModel.from_xml_string(clutter(23, moving=7, seed=5))
    assert (model.ngeom, model.nmocap) == (24, 7)
    kinds, counts = np.unique(model.geom_type[1:], return_counts=True)
    assert len(kinds) == 5
    assert sorted(counts) == [4, 4, 5, 5, 5]
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    assert np.hypot(*data.geom_xpos[1:, :2].T).min() >= 2.0
    assert (model.geom_bodyid[:17] == 0).all()  # the floor and what stands, in the world body
    assert (model.body_mocapid[model.geom_bodyid[17:]] >= 0).all()


def test_clutter_is_its_seeds_alone():
    assert clutter(9, seed=1) == clutter(9, seed=1)
    assert clutter(9, seed=1) != clutter(9, seed=2)


def test_no_more_movers_than_geoms():
    with pytest.raises(ValueError, match="moving: got 3, expected 0 to 2"):
        clutter(2, moving=3)
