"""Sensors, scenes and rays for tests of casters, and what MuJoCo meets on them."""

import mujoco
import numpy as np

from wayproof.models.rays import cut_grid, cut_scattered
from wayproof.models.sensors.beams import directions as beams_of
from wayproof.models.sensors.caster import MujocoCaster
from wayproof.models.sensors.devices import DepthCamera, Device, SpinningLidar, evenly

ALL = np.ones(mujoco.mjNGROUP, np.uint8)


def lidar(rings: int, azimuths: int, low: float, high: float, range: float) -> Device:
    elevations = evenly(low, high, rings)
    kept = {"range": range, "rate": 10.0, "no_return_is_free": True, "source": "test"}
    return SpinningLidar(elevations=elevations, azimuths=azimuths, **kept)


def camera(height: int, width: int, horizontal: float, vertical: float, range: float) -> Device:
    return DepthCamera(
        height=height,
        width=width,
        field_of_view_horizontal=horizontal,
        field_of_view_vertical=vertical,
        range=range,
        rate=10.0,
        no_return_is_free=True,
        measures="range",
        source="test",
    )


LIDAR = lidar(21, 130, -0.9, 0.9, range=8.0)
SHAPES = ("sphere", "capsule", "ellipsoid", "cylinder", "box")


def directions_of(sensor):
    return beams_of(sensor.beam_table(), 0)


def own_hits(model, data, directions, range, origin, R):
    pattern = cut_scattered(directions)
    return MujocoCaster(model, ALL, range).cast(data, pattern, origin[None], R[None])


def pattern_of(sensor, indices=None):
    table = sensor.beam_table()
    rows, columns = len(table.rows), len(table.columns)
    return cut_grid(directions_of(sensor), rows, columns, indices)


def posed(worldbody, head=""):
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco>{head}<worldbody>{worldbody}</worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return model, data


def random_rotation(rng):
    quaternion = rng.normal(size=4)
    R = np.empty(9)
    mujoco.mju_quat2Mat(R, quaternion / np.linalg.norm(quaternion))
    return R.reshape(3, 3)


def by_mj_ray(model, data, origin, directions, limit, groups=ALL):
    distance, ids = np.full(len(directions), -1.0), np.full(len(directions), -1, np.int32)
    geom = np.zeros(1, np.int32)
    for beam, direction in enumerate(directions):
        found = mujoco.mj_ray(model, data, origin, direction, groups, 1, -1, geom)
        if 0.0 <= found <= limit:
            distance[beam], ids[beam] = found, geom[0]
    return distance, ids


def random_geoms(rng, count, spread=4.0, sizes=None):
    """MJCF of mixed primitives about the origin, any rotation; sizes between two, any scale."""
    lines = ['<geom name="floor" type="plane" size="0 0 1" pos="0 0 -1.5"/>']
    for index in range(count):
        size = np.exp(rng.uniform(*np.log(sizes), 3)) if sizes else rng.uniform(0.1, 0.7, 3)
        numbers = [rng.uniform(-spread, spread, 3), rng.normal(size=4), size]
        position, quaternion, size = (" ".join(map(repr, n.tolist())) for n in numbers)
        shape = (*SHAPES, "plane")[index % 6]
        lines.append(
            f'<geom name="g{index}" type="{shape}" pos="{position}" quat="{quaternion}" '
            f'size="{size}"/>'
        )
    return "\n".join(lines)


def random_directions(rng, count):
    v = rng.normal(size=(count, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


X = np.array([[1.0, 0.0, 0.0]])
