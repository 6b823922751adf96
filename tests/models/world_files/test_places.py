"""Free places of a scene: in it, apart, by region; and a wider area where a scene has no room."""

import numpy as np
import pytest

from tests.models.world_files.test_gazebo import box, ground, world, write
from wayproof.models.world_files import ImportOptions, import_world, read_scene
from wayproof.models.world_files.importer import area_of
from wayproof.models.world_files.places import LEAST_APART, free_space


def room(path, gap):
    """A room of 8 x 8 m, cut by a wall with a door of some width."""
    walls = [("8 0.2 2", "0 4"), ("8 0.2 2", "0 -4"), ("0.2 8 2", "4 0"), ("0.2 8 2", "-4 0")]
    half = (8.0 - gap) / 2.0
    walls += [(f"0.2 {half} 2", f"1 {4.0 - half / 2.0}"), (f"0.2 {half} 2", f"1 {half / 2.0 - 4}")]
    models = [box(f"wall_{n}", size, f"<pose>{at} 1 0 0 0</pose>")
              for n, (size, at) in enumerate(walls)]  # fmt: skip
    return write(path, world(ground(), *models))


def space(path, radius=0.4):
    options = ImportOptions(robot_radius=radius)
    found = read_scene(path, options)
    return free_space(found, *area_of(found), options)


@pytest.mark.parametrize(("gap", "inside"), [(1.4, 1), (0.8, 2)])
def test_places_by_region(tmp_path, gap, inside):
    found = space(room(tmp_path / "r.world", gap))
    within = [place for place in found.places if np.abs(place.point[:2]).max() < 4.0]
    assert len({place.region for place in within}) == inside
    points = np.array([place.point[:2] for place in found.places])
    apart = np.linalg.norm(points[:, None] - points[None], axis=-1)
    assert apart[~np.eye(len(points), dtype=bool)].min() >= LEAST_APART - 1e-9
    for place in found.places:
        cell = tuple(((np.array(place.point[:2]) - found.low) / found.cell).astype(int))
        assert found.free[cell]
        assert place.clear == pytest.approx(found.gaps[cell])
        assert place.clear > 0.4


def test_no_place_for_a_large_robot(tmp_path):
    assert space(room(tmp_path / "r.world", 1.0), radius=9.0).places == []


def test_a_wider_area_where_a_scene_has_no_room(tmp_path):
    path = write(tmp_path / "a.world", world(ground(), box(pose="<pose>0 0 0.5 0 0 0</pose>")))
    found, notes = import_world(path)
    assert found.low[:2] == (-5.5, -5.5)
    assert "little room in the scene itself: 5 m of floor around it too" in notes
    assert np.hypot(*np.subtract(found.start, found.goal)[:2]) > 8.0
