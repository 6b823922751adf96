"""Small hostile files: refused before anything of the size that they ask for is made."""

import re
from dataclasses import replace

import pytest

from tests.tools.soak.child import Ended
from tests.tools.soak.hostile import MOST_MEMORY_MIB, breaches
from tests.tools.soak.hostile_files import FILES, attached, with_mesh
from tests.tools.soak.hostile_logs import SCENES, study_with_log, with_scene
from wayproof.harness.cli.main import main
from wayproof.models.world_files.mjcf_files import check_scene
from wayproof.models.world_files.occupancy_maps import read_occupancy_map
from wayproof.models.world_files.options import ImportOptions
from wayproof.models.world_files.reading import WorldFileError
from wayproof.models.world_files.sdf import read_sdf

SCENE_BOUNDS = {
    "scene: nuser_body 4e8": "nuser_body 4e+08, expected at most 100",
    "scene: nuser_geom 4e8": "nuser_geom 4e+08, expected at most 100",
    "scene: nuserdata 2e9": "nuserdata 2e+09, expected at most 4096",
    "scene: memory 900G": "memory 9.66368e+11, expected at most 1.07374e+09",
    "scene: numeric of 4e8": "size 4e+08, expected at most 200000",
    "scene: ccd_iterations 2e9": "ccd_iterations 2e+09, expected at most 1000",
    "scene: 20,000 bodies in one another": "100 levels",
    "scene: height field 40000 x 40000": "heights of all fields 1.6e+09, expected at most",
    "scene: texture 40000 x 40000": "pixels of all textures 1.6e+09, expected at most",
    "scene: replicate 2000 x 2000 x 100": "copies 200000, expected at most 2000",
    "scene: replicate 1e6 bodies": "copies 2e+06, expected at most 2000",
    "scene: flexcomp 400 x 400 x 400": "count 6.4e+07, expected at most 1000",
    "scene: texture of a PNG of 13000 x 13000": "pixels of all textures 1.69e+08",
    "scene: height field of a PNG of 13000 x 13000": "heights of all fields 1.69e+08",
    "scene: attached model with a mesh outside": "secret.obj' lies outside the scene's folder",
    "scene: attached model that includes a file outside": "'../secret.xml' lies outside",
    "scene: attached model outside": "'../secret.xml' lies outside the scene's folder",
    "scene: 20 files that include the next one twice": "more than 200 files of MJCF",
}


def made(name, folder):
    """The file of that name; what names it stands second in its command."""
    return folder / FILES[name](folder)[1]


@pytest.mark.few(9)
@pytest.mark.parametrize("name", SCENE_BOUNDS)
def test_a_scene_is_refused_before_mujoco_sees_it(name, tmp_path):
    with pytest.raises(WorldFileError, match=re.escape(SCENE_BOUNDS[name])):
        check_scene(made(name, tmp_path))


@pytest.mark.parametrize("name", ["map: PNG of 13000 x 13000", "map: PNG of 16384 x 16384"])
def test_an_image_is_refused_by_its_header(name, tmp_path):
    with pytest.raises(
        WorldFileError, match=r"no PNG image \(Image size \(\d+ pixels\) exceeds limit"
    ):
        read_occupancy_map(made(name, tmp_path), ImportOptions())


def test_models_that_include_the_next_one_twice_are_refused(tmp_path):
    path = made("SDF: 18 models that include the next one twice", tmp_path)
    with pytest.raises(WorldFileError, match="<include>: more than 20 deep, or 2000"):
        read_sdf(path, ImportOptions())


def test_an_attached_model_within_the_folder_is_taken(tmp_path, capsys):
    out = tmp_path / "world.xml"
    path = attached(tmp_path, with_mesh("inside.obj"))
    assert main(["import", str(path), "--out", str(out)]) == 0
    assert "2 solids" in capsys.readouterr().out
    assert out.read_text().count('type="mesh"') == 1


def test_the_report_of_a_hostile_scene_is_one_line(tmp_path, capsys):
    for name, said in (("nuser_body 3e8", "nuser_body"), ("a mesh in a file", "<mesh file=...>")):
        (folder := tmp_path / said[:5].strip("<")).mkdir()
        study = study_with_log(folder, with_scene(SCENES[name], folder / "hostile.mcap"))
        assert main(["report", str(study)]) == 2
        [line] = capsys.readouterr().err.splitlines()
        assert said in line
        assert not list(study.glob("*.html*"))


def test_what_breaches_a_bound_is_found():
    fine = Ended(2, ("one line",), overdue=False, peak_mib=100.0, cpu_s=0.1)
    assert breaches(fine) == []
    for field, value in (
        ("cpu_s", 5.1),
        ("peak_mib", MOST_MEMORY_MIB + 1),
        ("code", 1),
        ("lines", ()),
        ("lines", ("two", "lines")),
    ):
        assert len(breaches(replace(fine, **{field: value}))) == 1
