"""The triangles that peers cast rays at are the scene's own."""

import math
import sys

import mujoco
import numpy as np
import pytest
import trimesh

from wayproof.harness.bench.micro.ray_peers import FAR, installed_peers, triangles
from wayproof.harness.bench.raycast.scenes import field_terrain
from wayproof.harness.errors import InputError

VOLUMES = {
    "sphere": ("0.5", 4 / 3 * math.pi * 0.5**3),
    "ellipsoid": ("0.2 0.4 0.5", 4 / 3 * math.pi * 0.2 * 0.4 * 0.5),
    "box": ("0.2 0.4 0.5", 8 * 0.2 * 0.4 * 0.5),
    "cylinder": ("0.3 0.5", math.pi * 0.3**2),
    "capsule": ("0.3 0.5", math.pi * 0.3**2 + 4 / 3 * math.pi * 0.3**3),
}


def posed(mjcf):
    model = mujoco.MjModel.from_xml_string(mjcf)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return model, data


@pytest.mark.parametrize("shape", VOLUMES)
def test_a_shape_is_tessellated_about_its_place(shape):
    size, volume = VOLUMES[shape]
    geom = f'<geom type="{shape}" size="{size}" pos="1 2 3" euler="20 30 40"/>'
    vertices, faces, owners = triangles(*posed(f"<mujoco><worldbody>{geom}</worldbody></mujoco>"))
    solid = trimesh.Trimesh(vertices, faces, process=False)
    assert solid.volume == pytest.approx(volume, rel=0.01)
    np.testing.assert_allclose(solid.center_mass, [1.0, 2.0, 3.0], atol=1e-6)
    assert (owners == 0).all()


def test_a_floor_is_a_great_square_and_each_face_knows_its_geom():
    ground = '<geom type="plane" size="0 0 1"/><geom type="box" size="1 1 1"/>'
    vertices, _, owners = triangles(*posed(f"<mujoco><worldbody>{ground}</worldbody></mujoco>"))
    assert vertices[:4].min() == -FAR
    assert (vertices[:4, 2] == 0.0).all()
    assert owners.tolist() == [0] * 2 + [1] * 12


def test_a_height_field_is_cut_as_mujoco_cuts_it():
    """Straight down from anywhere, the triangles' height is where mj_ray hits."""
    model, data = posed(field_terrain(21, seed=1))
    vertices, faces, _ = triangles(model, data)
    rng, geom = np.random.default_rng(0), np.zeros(1, np.int32)
    for _ in range(50):
        x, y = rng.uniform(-19.0, 19.0, 2)
        above = np.array([x, y, 5.0])
        distance = mujoco.mj_ray(model, data, above, np.array([0, 0, -1.0]), None, 1, -1, geom)
        corners = vertices[faces]  # (f, 3, 3)
        shares = trimesh.triangles.points_to_barycentric(
            corners * (1, 1, 0), np.tile([x, y, 0.0], (len(faces), 1))
        )
        inside = (shares >= -1e-9).all(axis=1)
        heights = (shares[inside] * corners[inside, :, 2]).sum(axis=1)
        np.testing.assert_allclose(heights, 5.0 - distance, atol=1e-6)


def test_a_peer_that_lacks_a_library_of_the_system_is_named(tmp_path, monkeypatch):
    lacking = "import ctypes\ntry:\n    ctypes.CDLL('libnone.so.0')\nexcept OSError as error:\n"
    (tmp_path / "open3d.py").write_text(lacking + "    raise ImportError(str(error)) from error\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "open3d", raising=False)
    with pytest.raises(InputError, match=r"^open3d: installed, .*libnone\.so\.0.*expected what it"):
        installed_peers()
