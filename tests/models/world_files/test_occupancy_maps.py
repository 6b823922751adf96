"""Voxel maps, flat maps and OctoMaps become solids where their cells are occupied."""

import numpy as np
import pytest

from tests.models.world_files.written import ENDS, MAP, PCD_HEAD, imported, write
from wayproof.models.world_files import ImportOptions, WorldFileError
from wayproof.models.world_files.cells import merged_boxes, read_voxels
from wayproof.models.world_files.importer import import_world
from wayproof.models.world_files.occupancy_maps import read_occupancy_grid
from wayproof.models.world_files.octomaps import read_octomap


def test_merged_boxes_fill_exactly_the_occupied_cells():
    rng = np.random.default_rng(1)
    for density in (0.1, 0.5, 0.9):
        occupied = rng.uniform(size=(7, 6, 5)) < density
        filled = np.zeros(occupied.shape, int)
        for low, high in merged_boxes(occupied):
            filled[tuple(slice(a, b) for a, b in zip(low, high, strict=True))] += 1
        np.testing.assert_array_equal(filled, occupied)
    assert merged_boxes(np.ones((4, 3, 2), bool)).tolist() == [[[0, 0, 0], [4, 3, 2]]]


def test_a_voxel_map_stands_on_the_origin(tmp_path):
    path = write(tmp_path, "m.3dmap", "voxel 9 5 4\n4 1 0\n4 2 0\n5 1 0\n5 2 0\n")
    (box,) = imported(path, resolution=0.25).solids
    assert (box.low, box.high) == ((1.0, 0.25, 0.0), (1.5, 0.75, 0.25))
    with pytest.raises(WorldFileError, match=r"m\.3dmap:3: got '9 0 0', expected a cell within"):
        read_voxels(write(tmp_path, "m.3dmap", "voxel 9 5 4\n4 1 0\n9 0 0\n"))


def test_a_flat_map_is_extruded(tmp_path):
    # Two rows of three: the upper left is occupied, the lower right unknown.
    write(
        tmp_path, "m.pgm", b"P5\n# made by hand\n3 2\n255\n" + bytes([0, 254, 254, 254, 254, 205])
    )
    path = write(tmp_path, "m.yaml", MAP.format(yaw=0.0, negate=0))
    world, notes = import_world(path, ImportOptions(height=1.2), **ENDS)
    assert notes == ["1 cells occupied, 1 unknown, taken as occupied"]
    assert [solid.low for solid in world.solids] == [(1.0, 0.5, 0.0), (2.0, 0.0, 0.0)]
    assert world.solids[0].high == (1.5, 1.0, 1.2)
    (alone,) = imported(path, unknown="free").solids
    assert alone.low[:2] == (1.0, 0.5)
    turned = write(tmp_path, "t.yaml", MAP.format(yaw=np.pi / 2, negate=0))
    (box,) = imported(turned, unknown="free").solids
    np.testing.assert_allclose(box.low[:2], (0.0, 0.0), atol=1e-12)  # x = 1 - v, y = u
    negated = write(tmp_path, "n.yaml", MAP.format(yaw=0.0, negate=1))
    assert len(imported(negated, unknown="free").solids) == 2  # bright is occupied now


@pytest.mark.parametrize("negate", [0, 1])
def test_a_raw_map_has_percentages_whatever_negate_says(tmp_path, negate):
    write(tmp_path, "m.pgm", b"P5 6 1 255\n" + bytes([0, 19, 50, 66, 100, 255]))
    text = MAP.format(yaw=0.0, negate=negate) + "mode: raw\n"
    path = write(tmp_path, "m.yaml", text)
    world, notes = import_world(path, ImportOptions(height=1.2, unknown="free"), **ENDS)
    assert notes == ["2 cells occupied, 2 unknown, taken as free"]  # unknown: 50 and 255
    (box,) = world.solids
    assert (box.low[0], box.high[0]) == (2.5, 3.5)


def test_a_png_map_reads_as_its_pgm(tmp_path):
    pillow = pytest.importorskip("PIL.Image")
    levels = np.array([[0, 254, 254], [254, 254, 205]], np.uint8)
    pillow.fromarray(levels).save(tmp_path / "m.png")
    write(tmp_path, "m.pgm", "P2 3 2 255 0 254 254 254 254 205")
    text = MAP.format(yaw=0.0, negate=0)
    worlds = [
        imported(write(tmp_path, f"m{n}.yaml", text.replace("pgm", ending)))
        for n, ending in enumerate(("png", "pgm"))
    ]
    assert worlds[0].solids == worlds[1].solids


def states(folder, image, mode="trinary", negate=0, **more):
    """Return the states of a row of pixels: `#` occupied, `.` free, `?` unknown."""
    image.save(folder / "m.png", **more)
    text = MAP.format(yaw=0.0, negate=negate).replace("pgm", "png") + f"mode: {mode}\n"
    grid = read_occupancy_grid(write(folder, "m.yaml", text))
    found = zip(grid.occupied[:, 0], grid.free[:, 0], strict=True)
    return "".join("#" if occupied else "." if free else "?" for occupied, free in found)


@pytest.mark.parametrize(
    ("mode", "negate", "expected"),
    [
        ("trinary", 0, "#?#.??"),
        ("scale", 0, "??#.??"),
        ("raw", 0, "??.???"),
        ("trinary", 1, "?#?###"),
        ("scale", 1, "??.#?#"),
    ],
)
def test_no_transparent_pixel_is_free(tmp_path, mode, negate, expected):
    """Black and white without opacity, then with it; white that is hardly clear; Nav2's unknown."""
    pillow = pytest.importorskip("PIL.Image")
    grey = np.array([[0, 255, 0, 255, 255, 205]], np.uint8)
    opacity = np.array([[0, 0, 255, 255, 250, 255]], np.uint8)
    image = pillow.fromarray(np.dstack([grey, grey, grey, opacity]))
    found = states(tmp_path, image, mode, negate)
    assert found == expected
    assert states(tmp_path, pillow.fromarray(np.dstack([grey, opacity])), mode, negate) == found


@pytest.mark.parametrize("mode", ["trinary", "scale", "raw"])
def test_a_transparent_level_of_a_palette_or_of_grey_is_unknown(tmp_path, mode):
    pillow = pytest.importorskip("PIL.Image")
    free = 0 if mode == "raw" else 254
    palette = pillow.fromarray(np.array([[0, 1]], np.uint8), "P")
    palette.putpalette([free] * 6)
    assert states(tmp_path, palette, mode, transparency=1) == ".?"
    levels = np.array([[free, 255 if free else 1]], np.uint8)
    image = pillow.fromarray(levels)
    assert states(tmp_path, image, mode, transparency=int(levels[0, 1])) == ".?"
    deep = pillow.fromarray(levels.astype(np.uint16) * 257)
    assert states(tmp_path, deep, mode, transparency=257 * int(levels[0, 1])) == ".?"
    assert states(tmp_path, deep, mode) == ".."


def test_the_grey_of_a_colour_is_the_mean_of_its_channels(tmp_path):
    pillow = pytest.importorskip("PIL.Image")
    colours = [(254, 254, 0), (0, 255, 0), (255, 0, 0), (0, 255, 255), (250, 250, 250)]
    image = pillow.fromarray(np.array([colours], np.uint8))
    assert states(tmp_path, image) == "?##?."


@pytest.mark.parametrize(
    ("image", "said"),
    [
        (b"P2 2 1 255 0 256\n", "too large for this mode: 256"),
        (b"P2 2 1 100 0 -1\n", "negative"),
        (b"P2 1 1 255 x\n", "no PPM image"),
        (b"P5 9 9 255\n\x00", "no PPM image"),
        (b"P5 8193 8193 255\n\x00", "8193 x 8193 pixels, expected 1 to"),
        (b"P2 1 1 65536 0\n", "maxval must be"),
    ],
)
def test_broken_images_are_refused(tmp_path, image, said):
    write(tmp_path, "m.pgm", image)
    with pytest.raises(WorldFileError, match=said):
        imported(write(tmp_path, "m.yaml", MAP.format(yaw=0.0, negate=0)))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (MAP.format(yaw=0, negate=0.5), r"negate: got '0.5', expected 0, false, no,"),
        ("image: m.pgm\n", "no resolution, origin"),
        (MAP.format(yaw=0, negate=0).replace("0.65", "2"), r"occupied_thresh: got '2'"),
        (MAP.format(yaw=0, negate=0).replace("m.pgm", "../m.pgm"), "lies outside"),
        (MAP.format(yaw=0, negate=0).replace("[1.0", "[1.0, 2"), r"origin: got"),
        ("a: [b\n", "no YAML"),
        ("- a\n", "expected a mapping"),
        (
            MAP.format(yaw=0, negate=0).replace(
                "resolution: 0.5", "a: &a [9, 9]\nresolution: [*a, *a]"
            ),
            "resolution: got ', ', expected",
        ),
        (MAP.format(yaw=0, negate=0) + "mode: row\n", r"mode: got 'row', expected trinary, sc"),
    ],
)
def test_broken_map_files_are_named(tmp_path, text, said):
    write(tmp_path, "m.pgm", b"P5 1 1 255\n\x00")
    with pytest.raises(WorldFileError, match=said):
        imported(write(tmp_path, "m.yaml", text))


def octomap(tmp_path, ending):
    """Write a room of OctoMap's own, by its library, and return its occupied cells."""
    pyoctomap = pytest.importorskip("pyoctomap")
    tree = pyoctomap.OcTree(0.1)
    rng = np.random.default_rng(4)
    for place in rng.integers(-20, 20, (400, 3)):
        tree.updateNode(((place + 0.5) * 0.1).tolist(), bool(rng.random() < 0.6))
    for cell in np.stack(np.meshgrid(*3 * [np.arange(4)]), axis=-1).reshape(-1, 3):  # is pruned
        tree.updateNode(((cell + 40.5) * 0.1).tolist(), True)
    tree.updateInnerOccupancy()
    path = tmp_path / f"m{ending}"
    if ending == ".bt":
        assert tree.writeBinary(str(path))
    else:
        path.write_bytes(tree.write())
    cells = set()
    for leaf in tree.begin_leafs():
        if tree.isNodeOccupied(leaf):
            side = round(leaf.getSize() / 0.1)
            low = np.rint(np.array(leaf.getCoordinate()) / 0.1 - side / 2.0).astype(int)
            cells |= {tuple(low + step) for step in np.ndindex(side, side, side)}
    return path, cells


@pytest.mark.parametrize("ending", [".bt", ".ot"])
def test_an_octomap_gives_the_cells_that_its_library_says_are_occupied(tmp_path, ending):
    path, expected = octomap(tmp_path, ending)
    found = set()
    for box in read_octomap(path, ImportOptions()).parts:
        low, high = (np.rint(corner / 0.1).astype(int) for corner in box.bounds)
        found |= {tuple(low + step) for step in np.ndindex(*(high - low))}
    assert found == expected
    with pytest.raises(WorldFileError, match="expected a file that begins with '# Octomap"):
        imported(write(tmp_path, f"n{ending}", b"AcTree"))
    with pytest.raises(WorldFileError, match="ends within its tree"):
        imported(write(tmp_path, f"cut{ending}", path.read_bytes()[:-40]))


@pytest.mark.parametrize("up", ["0", "0.6"])
def test_infinite_walls_enclose_what_they_face(tmp_path, up):
    """Nothing is chosen behind a plane, where MuJoCo has the solid side of it."""
    walls = "".join(
        f"<geom name='w{n}' type='plane' size='5 5 1' pos='{at}' zaxis='{normal}'/>"
        for n, (at, normal) in enumerate((
            ("-5 0 0", f"1 0 {up}"), ("5 0 0", f"-1 0 {up}"), ("0 -4 0", f"0 1 {up}"),
            ("0 4 0", f"0 -1 {up}"),
        ))
    )  # fmt: skip
    floor = "<geom name='floor' type='plane' size='9 9 1'/>"
    text = f"<mujoco><worldbody>{floor}{walls}<geom size='.2' pos='0 0 .2'/></worldbody></mujoco>"
    world, _ = import_world(write(tmp_path, "a.xml", text))
    assert (np.abs([world.start[:2], world.goal[:2]]) < (5.0, 4.0)).all()
    assert np.hypot(*np.subtract(world.goal, world.start)[:2]) > 6.0
    for x, y in ((-5.6, 0.0), (5.6, 0.0), (0.0, -4.6), (0.0, 4.6), (-5.6, -4.6)):  # in the area
        assert any(box.distance([[x, y, 0.1]])[0] == 0.0 for box in world.solids)


def test_cells_up_to_the_floor_are_the_floor(tmp_path):
    """A few cells of a scanned floor below 0, too few to find it by, and a post."""
    points = [(x, y, -0.05) for x in (0.05, 0.15, 0.25) for y in (0.05, 0.15)]
    points += [(5.05, 0.05, z) for z in (-0.05, 0.05, 0.15)]
    rows = "".join("{} {} {} 7\n".format(*point) for point in points)
    head = PCD_HEAD + f"POINTS {len(points)}\nDATA ascii\n"
    world = imported(write(tmp_path, "c.pcd", head + rows))
    assert [(box.low[2], box.high[2]) for box in world.solids] == [(0.0, pytest.approx(0.2))]
