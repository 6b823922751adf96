"""Policies of ONNX files on trial: their tensors, the same chain as their commands, bad ones."""

import hashlib
import json
import math
import os
import sys
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from onnx import TensorProto, helper

from tests.harness.interface import policies
from tests.harness.interface.stacks.hand_made import observation, task
from wayproof import Config, build, open_log, override, run_episode
from wayproof.harness.cli.main import main
from wayproof.harness.errors import InputError
from wayproof.harness.interface.policy import PolicyStack
from wayproof.harness.interface.policy_tensors import (
    ACTION,
    BEARINGS,
    OBSERVATION,
    SCAN_RANGE_M,
    PolicyObserver,
    velocity_of,
)
from wayproof.harness.replay.answers import compare_answers
from wayproof.harness.replay.replay import replay
from wayproof.harness.study.file import read_study


def run(stack, log, robot="quadruped", *settings):
    named = ["episode.time_limit=1", *settings, f"stack.name={stack}"]
    return run_episode(build(override(Config("empty", robot, 1), named)), log)


@pytest.fixture
def policy(tmp_path):
    return policies.saved(tmp_path / "policy.onnx", policies.constant())


def test_a_policy_is_on_trial_as_any_stack(policy, tmp_path):
    threads = threading.active_count()
    result = run(f"policy:{policy}", tmp_path / "a.mcap")
    assert result.outcome == "timeout", result.reason
    log = open_log(Path(result.log))
    assert log.plugins == {f"policy:{policy}": hashlib.sha256(policy.read_bytes()).hexdigest()}
    for decision in log.decisions():
        assert decision.verdict.verdict in ("admitted", "unknown", "blocked")
    assert compare_answers(Path(result.log), f"policy:{policy}").identical
    served = f"exec:{sys.executable} -m wayproof serve policy:{policy}"
    assert run(served, tmp_path / "b.mcap").chain == result.chain
    policy.unlink()
    assert replay(Path(result.log)).identical  # it needs no policy
    assert threading.active_count() == threads


def test_a_changed_policy_is_seen(policy, tmp_path, capsys):
    result = run(f"policy:{policy}", tmp_path / "a.mcap")
    policies.saved(policy, policies.constant((0.4, 0.0, 0.0, 0.2)))
    assert main(["replay", result.log, "--allow-plugins"]) == 0
    assert "has changed since the log was written (SHA-256" in capsys.readouterr().err
    again = compare_answers(Path(result.log), f"policy:{policy}")
    assert (again.first_difference, again.differing) == (0, again.answers)


def test_a_policy_whose_action_is_not_finite_is_broken(tmp_path):
    made = policies.saved(tmp_path / "a.onnx", policies.constant((np.nan, 0.0, 0.0, 0.0)))
    result = run(f"policy:{made}", tmp_path / "a.mcap", "drone")
    assert (result.outcome, result.cause) == ("error", "plugin_failed")
    assert "velocity: got (nan, 0.0, 0.0, 0.0), expected finite numbers" in result.reason
    assert "at decision 0" in result.reason


def test_a_policy_sees_what_the_tensors_say(tmp_path):
    """It answers the bearing of the goal, as a share of pi, which only the goal's tensor has."""
    nodes = [
        helper.make_node("Split", ["goal", "parts"], ["x", "y", "z"], axis=1),
        helper.make_node("Div", ["y", "x"], ["slope"]),
        helper.make_node("Concat", ["zero", "zero", "zero", "slope"], ["action"], axis=1),
    ]
    constants = {"zero": np.zeros((1, 1), np.float32), "parts": np.array([1, 1, 1], np.int64)}
    made = policies.model(nodes, {"goal": ["batch", 3]}, {"action": ["batch", 4]}, constants)
    policy = PolicyStack(policies.saved(tmp_path / "a.onnx", made))
    tensors = {name: np.zeros(space.shape, np.float32) for name, space in OBSERVATION.items()}
    tensors["goal"] = np.array([2.0, 1.0, 0.0], np.float32)
    assert policy.act(tensors).tolist() == [0.0, 0.0, 0.0, 0.5]


SHAPES = "expected a tensor(float) of shape"


def with_doubles():
    """A model whose input is of another type."""
    made = policies.constant()
    made.graph.input[0].type.tensor_type.elem_type = TensorProto.DOUBLE
    made.graph.node[0].input[0] = "cast"
    made.graph.node.insert(0, helper.make_node("Cast", ["sigma"], ["cast"], to=TensorProto.FLOAT))
    return made


@pytest.mark.parametrize(
    ("made", "text"),
    [
        (policies.constant(image=[1, 3]), "got inputs image; expected some of scan, goal"),
        (policies.constant(scan=[1, 36]), "'scan' is a tensor(float) of shape (1, 36)"),
        (policies.constant(scan=[72]), f"of shape (72); {SHAPES} (1, 72)"),
        (policies.constant(name="twist"), "got outputs twist; expected one named 'action'"),
        (policies.constant((0.5, 0.1), shape=(1, 2)), f"(1, 2); {SHAPES} (1, 4)"),
        (policies.of_varying_shape(), "'action' has shape (0, 4) when it is run"),
        (with_doubles(), "sigma' is a tensor(double)"),
        (None, "no such file, expected an ONNX model"),
        (b"", "cannot be loaded"),
        (b"import os", "cannot be loaded"),
        (policies.constant().SerializeToString()[:80], "cannot be loaded"),
    ],
)  # fmt: skip
def test_what_is_no_policy_is_one_line(tmp_path, capsys, made, text):
    path, log = tmp_path / "a.onnx", tmp_path / "log.mcap"
    if made is not None:
        path.write_bytes(made if isinstance(made, bytes) else made.SerializeToString())
    stack = ["--stack", f"policy:{path}", "--log", str(log)]
    assert main(["run", "empty", "--robot", "drone", "--seed", "1", *stack]) == 2
    printed = capsys.readouterr().err
    assert text in printed
    assert len(printed.strip().splitlines()) == 1
    assert not log.exists()


@pytest.mark.parametrize("place", ["inside", "above", "absolute", "link", "working"])
def test_weights_in_other_files_are_refused_wherever_they_are(tmp_path, monkeypatch, place):
    folder = tmp_path / "model"
    folder.mkdir()
    monkeypatch.chdir(tmp_path)
    weights = np.array(policies.AHEAD, np.float32).tobytes()
    for file in (folder / "w.bin", tmp_path / "w.bin"):
        file.write_bytes(weights)
    os.symlink(tmp_path / "w.bin", folder / "link.bin")
    location = {
        "inside": "w.bin", "above": "../w.bin", "absolute": str(tmp_path / "w.bin"),
        "link": "link.bin", "working": "w.bin",
    }[place]  # fmt: skip
    if place == "working":
        (folder / "w.bin").unlink()
    made = policies.with_external_weights(policies.constant(), location)
    path = policies.saved(folder / "a.onnx", made)
    with pytest.raises(InputError, match="has weights in other files, expected all in one"):
        PolicyStack(path)


def test_a_study_names_a_policy_only_with_permission(policy, tmp_path):
    text = {
        "name": "policies", "worlds": ["empty"], "robots": ["drone"], "seeds": [1, 2],
        "stacks": ["builtin", f"policy:{policy}"],
    }  # fmt: skip
    file = tmp_path / "study.toml"
    lines = [f"{key} = {json.dumps(value)}" for key, value in text.items()]
    file.write_text("\n".join(lines) + "\n")
    with pytest.raises(InputError, match="--allow-plugins"):
        read_study(str(file))
    assert read_study(str(file), allow_plugins=True)


def test_goal_and_velocities_are_in_the_frame_of_the_body():
    given = task(goal=(5.0, 2.0))
    seen = observation(given, [(1.0, 1.5, 0.2)], heading=math.pi / 2, speed=1.0)
    seen = replace(
        seen, position=np.array([1.0, 0.0, 0.3]), yaw_rate=0.4, position_sigma=0.2,
        heading_sigma=0.1,
    )  # fmt: skip
    tensors = PolicyObserver(given).tensors(seen)
    for name, space in OBSERVATION.items():
        assert (tensors[name].shape, tensors[name].dtype) == (space.shape, np.float32)
        assert ((tensors[name] >= space.low) & (tensors[name] <= space.high)).all()
    assert tensors["goal"] == pytest.approx([2.0, -4.0, 0.0], abs=1e-6)
    assert tensors["velocity"] == pytest.approx([1.0, 0.0, 0.0, 0.4], abs=1e-6)
    assert tensors["reference"] == pytest.approx([1.0, 0.0, 0.0, 0.0], abs=1e-6)
    assert tensors["sigma"] == pytest.approx([0.2, 0.1])
    assert np.flatnonzero(tensors["scan"] < SCAN_RANGE_M).tolist() in ([0], [BEARINGS - 1])


def test_what_is_beyond_the_bounds_is_clipped():
    given = task(goal=(5000.0, 0.0))
    tensors = PolicyObserver(given).tensors(replace(observation(given), position_sigma=1e6))
    assert (tensors["goal"][0], tensors["sigma"][0]) == (100.0, 100.0)


def test_an_action_is_a_share_of_the_limits():
    mission = task("drone").mission
    velocity = velocity_of(np.array([0.5, -0.25, 0.1, -2.0]), mission)
    assert (velocity.forward, velocity.left, velocity.up) == (1.0, -0.5, 0.2)
    assert velocity.yaw_rate == -1.0
    walking = velocity_of(np.array([1.0, 0.04, 1.0, -0.04]), task().mission)
    assert (walking.forward, walking.left, walking.up, walking.yaw_rate) == (1.0, 0.0, 0.0, 0.0)
    assert math.isnan(velocity_of(np.array([np.nan, 0.0, 0.0, 0.0]), mission).forward)
    assert ACTION.shape == (4,)
