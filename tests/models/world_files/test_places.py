"""Free places of a scene: in it, apart, by region; and a wider area where a scene has no room."""

import numpy as np
import pytest

from tests.models.world_files.gazebo_files import box, ground, world, write
from wayproof.models.world_files import ImportOptions, WorldFileError, import_world, read_scene
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


def test_around_a_building_without_room_there_is_some_and_that_is_said(tmp_path):
    walls = [("3 0.2 2", "0 1.5"), ("3 0.2 2", "0 -1.5"), ("0.2 3 2", "1.5 0"),
             ("0.2 3 2", "-1.5 0")]  # fmt: skip
    models = [box(f"wall_{n}", size, f"<pose>{at} 1 0 0 0</pose>")
              for n, (size, at) in enumerate(walls)]  # fmt: skip
    path = write(tmp_path / "r.world", world(ground(), *models))
    found, notes = import_world(path, ImportOptions(robot_radius=0.8))
    assert (np.abs([found.start[:2], found.goal[:2]]).max(axis=1) > 2.0).all()
    assert "little room in the scene itself: 5 m of floor around it too" in notes
    with pytest.raises(WorldFileError, match="no space for a radius"):
        import_world(path, ImportOptions(robot_radius=3.5))


def test_nothing_is_known_around_a_map(tmp_path):
    cells = np.full((30, 30), 254, np.uint8)
    cells[14:16, 14:16] = 0
    (tmp_path / "m.pgm").write_bytes(b"P5\n30 30\n255\n" + cells.tobytes())
    path = write(tmp_path / "m.yaml", "image: m.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n"
                 "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.2\n")  # fmt: skip
    with pytest.raises(WorldFileError, match="no space"):
        import_world(path, ImportOptions(robot_radius=3.0))
