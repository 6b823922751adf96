import ast
import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.estimators.motion_sensors import Body
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.log.reader import open_log
from wayproof.harness.replay.replay import replay
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.sim.pose_estimate import PoseEstimate
from wayproof.harness.stack.footprint import HEADING_TOLERANCE
from wayproof.models.pose_model import PoseError, PoseModel, PoseModelConfig, estimated_trail
from wayproof.models.poses import Trail, rotation_matrices

ROOT = Path(__file__).resolve().parents[2]
PERIOD = 0.01
EXACT = PoseModelConfig(bias_sigma=0.0, yaw_bias_sigma=0.0)


def drive(config, seed, steps=40, length=0.25, turn=0.05):
    """An arc of so many steps; the estimate at its end and the true pose there."""
    model = PoseModel(config, seed, np.zeros(3), 0.0, PERIOD)
    position, heading = np.zeros(3), 0.0
    for _ in range(steps):
        heading += turn
        position = position + length * np.array([math.cos(heading), math.sin(heading), 0.1])
        model.advance(position, heading)
    return model


def test_an_exact_estimator_has_no_error():
    model = drive(EXACT, 3)
    assert model.error == PoseError()
    assert model.position_sigma == model.heading_sigma == 0.0
    assert model.travelled == pytest.approx(40 * 0.25 * math.sqrt(1.01))


def test_a_scale_error_stretches_a_straight_line():
    """One hand-computed case: 10 m straight, scale s: the believed place is s farther along."""
    model = drive(replace(EXACT, scale_sigma=0.1), 5, turn=0.0)
    x, y, z = model.error.shift
    assert abs(x) > 1e-3
    assert (y, z) == pytest.approx((0.0, 0.1 * x), abs=1e-6)
    assert model.position_sigma == pytest.approx(0.1 * 10.0, rel=0.15)  # linear about s = 0


@pytest.mark.parametrize(
    "errors",
    [
        {"random_walk": 0.02, "yaw_random_walk": 0.02},
        {"scale_sigma": 0.02, "yaw_scale_sigma": 0.03},
        {"bias_sigma": 0.03, "yaw_bias_sigma": 0.01, "white_noise": 0.02, "yaw_white_noise": 0.02},
    ],
)
def test_the_stated_standard_deviations_are_those_of_many_runs(errors):
    config = replace(EXACT, correlation_time=0.1, **errors)
    runs = [drive(config, seed) for seed in range(150)]
    shifts = np.array([run.error.shift for run in runs])
    horizontal = math.sqrt(np.linalg.eigvalsh(np.cov(shifts[:, :2].T)).max())
    greatest = max(horizontal, float(shifts[:, 2].std()))
    stated = np.mean([run.position_sigma for run in runs])
    assert stated == pytest.approx(greatest, rel=0.2)
    turns = np.array([run.error.turn for run in runs])
    assert np.mean([run.heading_sigma for run in runs]) == pytest.approx(turns.std(), rel=0.2)


def test_the_bounded_error_forgets_itself_in_its_correlation_time():
    config = replace(EXACT, bias_sigma=0.1, correlation_time=0.2)
    model = PoseModel(config, 1, np.zeros(3), 0.0, PERIOD)
    errors = []
    for _ in range(4000):
        model.advance(np.zeros(3), 0.0)
        errors.append(model.error.shift)
    series = np.array(errors)  # (n, 3), 40 s
    assert series.std() == pytest.approx(0.1, rel=0.1)
    lag = round(0.2 / PERIOD)
    correlation = (series[lag:] * series[:-lag]).mean() / (series**2).mean()
    assert correlation == pytest.approx(math.exp(-1.0), abs=0.12)


@pytest.mark.parametrize(
    ("field", "value"),
    [("rate", 0.0), ("bias_sigma", -1.0), ("random_walk", math.nan), ("yaw_scale_sigma", 2.0)],
)
def test_what_is_no_estimator_is_refused(field, value):
    with pytest.raises(ValueError, match=rf"pose_model\.{field}: got"):
        PoseModelConfig(**{field: value})


def heading_quaternion(angle):
    return np.array([math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2)])


def test_a_believed_trail_is_shifted_and_turned_by_each_its_own_error():
    trail = Trail(np.zeros((2, 3)), np.stack([heading_quaternion(0.3)] * 2), 0.01)
    errors = [PoseError((1.0, 2.0, 3.0), 0.1), PoseError()]
    believed = estimated_trail(trail, errors)
    assert believed.positions.tolist() == [[1.0, 2.0, 3.0], [0.0, 0.0, 0.0]]
    np.testing.assert_allclose(believed.quaternions[0], heading_quaternion(0.4), atol=1e-15)
    assert (believed.quaternions[1] == trail.quaternions[1]).all()


def test_the_error_moves_only_with_new_estimates():
    config = override(
        Config("empty", "drone", 0), ["pose_model.rate=50", "pose_model.white_noise=0.01"]
    )
    body = Body(model=None, data=None, base=0, is_robot=None, legs=False)  # of the lidar's alone
    estimate = PoseEstimate(config, 0.002, 50, np.zeros(3), 0.0, body, {})
    errors = []
    for step in range(40):
        estimate.advance(step * 2_000_000, np.zeros(3), heading_quaternion(0.0))
        errors.append(estimate.error)
    changes = [k for k in range(1, 40) if errors[k] != errors[k - 1]]
    assert changes == [10, 20, 30]


def test_the_log_holds_the_believed_pose_and_the_margin_follows_its_sigma(recorded):
    result = recorded("empty", "quadruped", 1)
    messages = list(read_messages(Path(result.log)))
    poses = {m.sequence: m for m in messages if isinstance(m, pb.Pose)}
    truths = {m.sequence: m for m in messages if isinstance(m, pb.Truth)}
    off = np.array([np.subtract(poses[k].position, truths[k].position) for k in poses])
    assert 0.003 < off.std() < 0.03  # sigma is 0.01
    config = open_log(Path(result.log)).config
    for decision in (m for m in messages if isinstance(m, pb.Decision)):
        assert decision.position == poses[decision.sequence].position
        assert decision.position_sigma == config.pose_model.bias_sigma
        margin = config.costmap.localization_margin + 2 * 0.01
        assert decision.localization_margin_m == margin + 0.245 * HEADING_TOLERANCE  # outmost disc


def test_a_rolling_sweep_is_straightened_by_believed_poses(recorded):
    result = recorded("empty", "drone", 1, "sensors.lidar=velodyne-vlp16", "episode.time_limit=1")
    poses = [m for m in read_messages(Path(result.log)) if isinstance(m, pb.Pose)]
    for pose in poses:
        assert pose.history_positions[-3:] == pose.position
        assert pose.history_quaternions[-4:] == pose.quaternion
        assert pose.history_period_s == pytest.approx(0.01)
    ends = [np.array(pose.history_positions[-3:]) for pose in poses[:-1]]
    starts = [np.array(pose.history_positions[:3]) for pose in poses[1:]]
    # A trail begins where the one before it ended: the same believed pose at the same instant.
    assert np.abs(np.subtract(starts, ends)).max() < 1e-9
    assert replay(Path(result.log)).identical


def test_the_body_tracks_what_it_believes(tmp_path):
    """Believed at the goal, the body truly rests beside it by the estimate's error."""
    settings = ["pose_model.bias_sigma=0.05", "pose_model.correlation_time=1000"]
    settings += ["start=[3.0,3.0]", "goal=[4.5,3.0]"]
    result = run_episode(
        build(override(Config("empty", "quadruped", 1), settings)), tmp_path / "off.mcap"
    )
    messages = list(read_messages(Path(result.log)))
    pose = [m for m in messages if isinstance(m, pb.Pose)][-1]
    truth = [m for m in messages if isinstance(m, pb.Truth)][-1]
    goal = np.array(open_log(Path(result.log)).mission.goal)[:2]
    error = np.subtract(pose.position, truth.position)[:2]
    assert np.linalg.norm(error) > 0.02
    assert np.linalg.norm(np.array(pose.position)[:2] - goal) < 0.06
    assert np.linalg.norm(np.array(truth.position)[:2] + error - goal) < 0.06


@pytest.mark.few(1)
@pytest.mark.parametrize(
    "setting",
    ["pose_model.white_noise=0.01", "pose_model.yaw_bias_sigma=0.2"],
    ids=["jitter", "heading"],
)
def test_a_drone_flies_steadily_on_a_bad_estimate(setting, tmp_path):
    """White error, and a heading that is far off, reach the controller without shaking it."""
    settings = [setting, "pose_model.correlation_time=1000", "episode.time_limit=3"]
    log = tmp_path / "bad.mcap"
    result = run_episode(build(override(Config("empty", "drone", 1), settings)), log)
    assert result.outcome == "timeout", result.reason
    assert "recover" not in {m.action for m in read_messages(log) if isinstance(m, pb.Decision)}
    upright = [
        rotation_matrices(np.array(m.quaternion)[None])[0, 2, 2]
        for m in read_messages(log)
        if isinstance(m, pb.Truth)
    ]
    assert min(upright) > math.cos(0.6)


def test_the_stack_under_test_can_reach_neither_the_truth_nor_the_error_model():
    code = "import sys, wayproof.harness.stack.pipeline; print(*sorted(sys.modules))"
    loaded = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.split()
    assert "wayproof.harness.inputs" in loaded
    hidden = {
        "mujoco",
        "wayproof.models.truth",
        "wayproof.models.robots",
        "wayproof.harness.sim.pose_estimate",
        "wayproof.harness.sim.sensing",
    }
    assert not hidden & set(loaded)


def test_the_stack_names_neither_truth_nor_perturbation():
    files = [*(ROOT / "harness" / "stack").rglob("*.py")]
    assert len(files) > 10
    for file in (*files, ROOT / "harness" / "inputs.py", ROOT / "harness" / "mission.py"):
        tree = ast.parse(file.read_text())
        names = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
        names |= {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
        assert not names & {"Truth", "truth", "Perturbation", "perturbation", "pose_model"}, file


def test_legs_measure_their_own_height():
    """Of what walks only the legs' own error is left along z; the rest is as of what flies."""
    config = PoseModelConfig(random_walk=0.1, white_noise=0.05, scale_sigma=0.1)
    flying, walking = (
        PoseModel(config, 3, np.zeros(3), 0.0, PERIOD, legs=legs) for legs in (False, True)
    )
    errors = []
    for step in range(500):
        for one in (flying, walking):
            one.advance(np.array([0.01 * step, 0.0, 0.02 * step]), 0.0)
        assert walking.error.shift[:2] == flying.error.shift[:2]
        assert walking.error.turn == flying.error.turn
        errors.append((flying.error.shift[2], walking.error.shift[2]))
    of_flying, of_walking = np.abs(errors).max(axis=0)
    assert of_flying > 0.1
    assert of_walking < 5 * config.leg_height_sigma
