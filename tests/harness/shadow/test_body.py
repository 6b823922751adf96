from pathlib import Path

import pytest

from tests.harness.shadow.conftest import BODY
from wayproof.harness.errors import InputError
from wayproof.harness.shadow.body import find_body
from wayproof.models.robots import custom

EXAMPLES = sorted((Path(custom.__file__).parent / "examples").glob("*.toml"))


def body_of(folder, text):
    path = folder / "body.toml"
    path.write_text(text)
    return find_body(str(path))


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_a_spec_of_a_simulated_robot_is_a_body(path):
    body = find_body(str(path))
    assert body.radius > 0.0
    assert body.identity.startswith(f"{path.stem}@")


@pytest.mark.parametrize(
    ("added", "said"),
    [
        ("disks = [[0.0, 0.2]]", "unknown field 'disks'; did you mean 'discs'\\?"),
        ("wheels = 4", "unknown field 'wheels'"),
        ("limits.step_hight = 0.1", "'limits.step_hight'; did you mean 'limits.step_height'\\?"),
        ("sensors = [{nam = 'lidar'}]", "'sensors.nam'; did you mean 'sensors.name'\\?"),
        ("rotor.lagg = 0.1", "'rotor.lagg'; did you mean 'rotor.lag'\\?"),
        ("limits.step_height = -0.1", "limits.step_height: got -0.1, expected 0 to height"),
        ("limits.step_height = nan", "limits.step_height: got nan, expected 0 to height"),
        ("discs = [[0.0, 0.3]]", "discs: got offset 0 m and radius 0.3 m, expected each within"),
        ("discs = [[-0.3, 0.2]]", "discs: got offset -0.3 m and radius 0.2 m, expected each wit"),
        ("discs = [[0.0, -0.2]]", "discs: got offset 0 m and radius -0.2 m, expected each within"),
        ("discs = [[nan, 0.2]]", "discs: got offset nan m and radius 0.2 m, expected each within"),
        ("discs = [[0.0, 0.01]]", "discs: reach 0.01 m, expected about the radius, 0.25 m"),
    ],
)
def test_a_body_that_is_not_meant_is_refused(tmp_path, added, said):
    text = BODY + "step_height = 0.02\n" if "step_h" not in added else BODY
    if added.startswith("limits."):
        text += added.removeprefix("limits.")
    else:
        text = f"{added}\n{text}"
    with pytest.raises(InputError, match=said):
        body_of(tmp_path, text)


@pytest.mark.parametrize("name", ["radius", "height", "speed", "acceleration", "jerk", "yaw_rate"])
@pytest.mark.parametrize("value", ["-1.0", "nan"])
def test_sizes_and_limits_are_finite_and_above_zero(tmp_path, name, value):
    lines = [f"{name} = {value}" if one.startswith(name) else one for one in BODY.splitlines()]
    with pytest.raises(InputError, match=f"{name}: got {float(value):g}, expected above 0"):
        body_of(tmp_path, "\n".join(lines))


def test_discs_of_a_body_are_kept(tmp_path):
    discs = "discs = [[-0.1, 0.2], [0.1, 0.2]]\n"
    assert body_of(tmp_path, discs + BODY).discs == ((-0.1, 0.2), (0.1, 0.2))
