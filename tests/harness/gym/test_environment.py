"""Environments, end to end: Gymnasium's own checks, and logs like those of any stack on trial."""

import gc
import itertools
import multiprocessing
import pickle
import subprocess
import sys
import threading

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from wayproof import Config, Velocity, build, open_log, override, run_episode
from wayproof.harness.errors import InputError
from wayproof.harness.gym import environment_id
from wayproof.harness.gym.environment import WayproofEnv
from wayproof.harness.gym.exported import save_policy
from wayproof.harness.gym.reward import Reward
from wayproof.harness.interface.command_messages import command_message
from wayproof.harness.interface.policy import PolicyStack
from wayproof.harness.interface.policy_tensors import PolicyObserver
from wayproof.harness.interface.types import Command
from wayproof.harness.replay.audit import audit
from wayproof.harness.replay.closed_loop import simulate_again
from wayproof.harness.replay.consistency import refuse_contradictions
from wayproof.harness.replay.replay import replay
from wayproof.models.robots import ROBOTS
from wayproof.models.worlds import WORLDS

QUICK = ("episode.time_limit=2",)
AHEAD = np.array([0.5, 0.0, 0.0, 0.2], np.float32)


@pytest.fixture
def make():
    """Make environments that are closed in the end."""
    made = []

    def one(world="empty", robot="quadruped", **options):
        made.append(WayproofEnv(world, robot, **{"settings": QUICK, **options}))
        return made[-1]

    yield one
    for env in made:
        env.close()


def to_the_end(env, action=AHEAD):
    """Repeat an action; the rewards, and what the last step returned."""
    rewards = []
    for _ in range(400):
        last = env.step(action)
        rewards.append(last[1])
        if last[2] or last[3]:
            return rewards, last
    raise AssertionError("no end")


def test_every_world_and_robot_has_an_id():
    ids = {
        environment_id(world, robot, flat=flat)
        for world in WORLDS
        for robot in ROBOTS
        for flat in (False, True)
    }
    assert "Wayproof/Warehouse-Quadruped-v0" in ids
    assert ids == {one for one in gymnasium.registry if one.startswith("Wayproof/")}


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("robot", "options"),
    [
        ("quadruped", {"observation": "flat", "render_mode": "rgb_array"}),
        ("drone", {"action": "waypoints", "observation": "sweeps", "guard": True}),
    ],
)
def test_the_checks_of_gymnasium_find_nothing(robot, options):
    """Warnings are errors in all tests."""
    env = gymnasium.make(environment_id("empty", robot), settings=QUICK, **options)
    check_env(env.unwrapped)
    env.close()


def test_the_same_seed_gives_the_same_observations_and_another_one_others(make):
    env = make("cylinders", "drone", observation="sweeps")
    same, again, other = (env.reset(seed=seed)[0] for seed in (1, 1, 2))
    assert all(env.observation_space.contains(one) for one in (same, other))
    assert all((same[name] == again[name]).all() for name in same)
    assert (same["scan"] != other["scan"]).any()


def test_a_log_is_that_of_a_stack_that_commands_the_same(make, tmp_path):
    env = make("cylinders", logs=tmp_path)
    env.reset(seed=2)
    _, (*_, truncated, info) = to_the_end(env)
    assert truncated
    path = tmp_path / "cylinders-quadruped-2.mcap"
    assert info["log"] == str(path)
    mission = open_log(path).mission
    motion = Velocity(0.5 * mission.max_speed, yaw_rate=float(AHEAD[3]) * mission.max_yaw_rate)
    motion = Velocity(motion.forward, 0.0, 0.0, motion.yaw_rate, 0.3)

    class Same:
        def start(self, task):
            pass

        def announce(self):
            pass

        def query(self, observation):
            return command_message(Command(motion), observation.sequence)

        def close(self):
            pass

        def stderr(self):
            return ""

    config = override(Config("cylinders", "quadruped", 2), [*QUICK, "stack.name=same"])
    other = run_episode(build(config), tmp_path / "other.mcap", session=Same())
    assert (other.chain, other.outcome) == (info["chain"], info["outcome"])
    again = replay(path)
    assert again.identical, (again.differences, again.contradictions)
    assert simulate_again(path).identical
    assert {one.rule for one in audit(path).violations} <= {"swept"}
    assert open_log(path).config.stack.name == "gymnasium"


def test_a_collision_terminates_with_its_cause_and_costs(make):
    env = make("cylinders", settings=(), referee=True)
    _, info = env.reset(seed=2)
    start_m = info["truth"]["goal_distance_m"]
    rewards, (_, last, terminated, truncated, info) = to_the_end(env, np.array([1, 0, 0, 0]))
    assert (terminated, truncated) == (True, False)
    assert info["outcome"] == "collision"
    assert info["cause"] == "disregarded_obstacle"
    assert info["truth"]["collisions"] == 1
    assert info["truth"]["clearance_m"] < 0.1
    assert (info["spl"], info["log"]) == (0.0, "")
    assert info["verdict"] in ("unknown", "blocked")
    assert last < -9.0
    own = Reward()
    truth = info["truth"]
    expected = own.progress * (start_m - truth["goal_distance_m"]) + own.second * truth["time_s"]
    assert sum(rewards) == pytest.approx(expected + own.failure)
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(AHEAD)


def test_the_goal_is_reached_by_an_agent_that_comes_to_rest(make):
    near = "start=[3.0,3.0]", "goal=[4.5,3.0]"
    env = make("empty", "drone", settings=near, action="waypoints", referee=True)
    observation, _ = env.reset(seed=1)
    for _ in range(600):
        share = np.clip(observation["goal"] / 3.0, -1.0, 1.0)
        observation, reward, terminated, _, info = env.step(np.tile(share, (3, 1)))
        if terminated:
            break
    assert info["outcome"] == "success"
    assert 0.7 < info["spl"] <= 1.0
    assert reward > 9.0


@pytest.mark.parametrize(
    ("robot", "options"),
    [
        ("quadruped", {"perturb": "pose_drift:2"}),
        ("drone", {"action": "waypoints", "observation": "sweeps", "perturb": "depth_noise:2"}),
    ],
)
def test_without_referee_the_body_moves_and_senses_bit_by_bit_as_with_it(make, robot, options):
    runs = []
    for referee in (False, True):
        env = make("cylinders", robot, settings=(), referee=referee, **options)
        drawn = np.random.default_rng(1).uniform(-0.4, 0.8, (25, *env.action_space.shape))
        steps = [env.reset(seed=3)]
        for action in drawn.astype(np.float32):
            steps.append(env.step(action))
            if steps[-1][2]:
                break
        runs.append(steps)
    light, whole = runs
    assert len(light) == len(whole) > 15
    for one, other in zip(light, whole, strict=True):
        assert (one[-1]["truth"]["position"] == other[-1]["truth"]["position"]).all()
        for name in one[0].keys() - {"scan"}:
            assert (one[0][name] == other[0][name]).all(), name
        assert one[1:-1] == other[1:-1]
        assert one[0]["scan"].min() == pytest.approx(other[0]["scan"].min(), abs=0.05)
    assert "verdict" not in light[-1][-1]


def test_what_needs_the_referee_gets_it(make):
    for options in ({"reward": Reward(not_admitted=-1.0)}, {"perturb": "latency:2"}):
        env = make("empty", **options)
        env.reset(seed=1)
        assert "verdict" in env.step(AHEAD)[-1]


def test_a_picture_from_above_shows_body_goal_and_returns(make):
    env = make("empty", render_mode="rgb_array")
    env.reset(seed=1)
    first = env.render()
    assert first.shape[2] == 3
    for _ in range(10):
        env.step(AHEAD)
    assert (env.render() != first).any()


def test_a_network_that_is_saved_is_a_policy_of_the_same_actions(make, tmp_path):
    env = make("empty", observation="flat")
    flat, _ = env.reset(seed=1)
    generator = np.random.default_rng(1)
    sizes = (len(flat), 16, 4)
    layers = [
        (generator.normal(size=(out, given)) * 0.1, generator.normal(size=out))
        for given, out in itertools.pairwise(sizes)
    ]
    mean, deviation = generator.normal(size=len(flat)), generator.uniform(1.0, 2.0, len(flat))
    save_policy(tmp_path / "p.onnx", layers, normal=(mean, deviation))
    values = np.clip((flat - mean) / deviation, -10.0, 10.0)
    expected = layers[1][0] @ np.tanh(layers[0][0] @ values + layers[0][1]) + layers[1][1]
    tensors = PolicyObserver(env.task).tensors(env.seen)
    assert PolicyStack(tmp_path / "p.onnx").act(tensors) == pytest.approx(expected, abs=1e-4)
    with pytest.raises(InputError, match="policy"):
        save_policy(tmp_path / "other.onnx", [(np.zeros((3, 3)), np.zeros(3))])
    assert not (tmp_path / "other.onnx").exists()


def test_the_guard_brakes(make):
    env = make("cylinders", settings=("episode.stuck_after=2",), guard=True)
    env.reset(seed=2)
    _, (*_, truncated, info) = to_the_end(env, np.array([1, 0, 0, 0]))
    assert truncated
    assert (info["outcome"], info["cut"]) == ("stuck", True)
    assert info["truth"]["collisions"] == 0


def test_an_action_that_is_not_finite_is_a_broken_stack(make, tmp_path):
    env = make(action="waypoints")
    env.reset(seed=1, options={"log": tmp_path / "a.mcap"})
    env.step(np.zeros(env.action_space.shape, np.float32))
    _, reward, terminated, _, info = env.step(np.full(env.action_space.shape, np.nan))
    assert terminated
    assert (info["outcome"], info["cause"]) == ("error", "plugin_failed")
    assert "expected finite" in info["reason"]
    assert reward < -9.0
    assert replay(tmp_path / "a.mcap").identical


def test_an_episode_that_is_left_is_a_whole_log(make, tmp_path):
    threads = threading.active_count()
    env = make()
    for way in ("reset", "closed"):
        path = tmp_path / f"{way}.mcap"
        env.reset(seed=1, options={"log": path})
        for _ in range(3):
            env.step(AHEAD)
        env.reset(seed=2) if way == "reset" else env.close()
        assert open_log(path).result["reason"] == f"the environment was {way}"
        refuse_contradictions(open_log(path), hint="")
        assert replay(path).decisions == 3
    assert threading.active_count() == threads
    assert not list(tmp_path.glob("*.partial"))


def test_options_are_those_of_the_command_line(make, tmp_path):
    env = make()
    _, info = env.reset(seed=3, options={"world": "corridor", "perturb": "pose_drift:3"})
    assert (info["world"], info["seed"]) == ("corridor", 3)
    log = tmp_path / "a.mcap"
    options = {"difficulty": 0.1, "perturb": "depth_noise:2", "log": str(log)}
    env.reset(seed=3, options=options)
    env.close()
    config = open_log(log).config
    assert (config.difficulty, config.perturbation.kind) == (0.1, "depth_noise")


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"options": {"wrold": "empty"}}, "unknown option of reset 'wrold'; did you mean 'world'"),
        ({"options": {"world": "emty"}}, "unknown world 'emty'; did you mean 'empty'"),
        ({"options": {"perturb": "pose"}}, "unknown perturbation 'pose'"),
        ({"options": {"difficulty": 2}}, "difficulty: got 2, expected"),
        ({"seed": -1}, "Seed must be greater or equal to zero"),
    ],
)
def test_bad_input_is_one_line_and_the_next_reset_works(make, options, text):
    env = make()
    with pytest.raises((InputError, gymnasium.error.Error), match=text):
        env.reset(**options)
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(AHEAD)
    env.reset(seed=1)
    with pytest.raises(InputError, match=r"action: got shape \(2,\), expected \(4,\)"):
        env.step(np.zeros(2))


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"action": "torque"}, "action: got 'torque', expected one of velocity, waypoints"),
        ({"observation": "map"}, "observation: got 'map', expected one of scan, flat, sweeps"),
        ({"settings": ("map.resoltion=1",)}, "unknown setting 'map.resoltion'"),
        ({"robot": "dron"}, "unknown robot 'dron'"),
        ({"render_mode": "human"}, "render_mode: got 'human', expected 'rgb_array'"),
    ],
)
def test_an_environment_that_cannot_be_is_refused(make, options, text):
    with pytest.raises(InputError, match=text):
        make(**options)


def test_a_pickled_environment_is_a_new_one_of_the_same_arguments(make, tmp_path):
    env = make("corridor", "drone", action="waypoints", logs=tmp_path)
    env.reset(seed=1)
    copy = pickle.loads(pickle.dumps(env))
    assert copy.action_space == env.action_space
    _, info = copy.reset(seed=2)
    assert (info["world"], info["robot"]) == ("corridor", "drone")
    copy.close()


@pytest.mark.large
def test_environments_are_vectorized():
    envs = gymnasium.make_vec(
        environment_id("empty", "drone"), 2, vectorization_mode="async", settings=QUICK
    )
    observations, infos = envs.reset(seed=5)
    assert observations["scan"].shape == (2, 72)
    assert infos["seed"].tolist() == [5, 6]
    ended = np.zeros(2, bool)
    for _ in range(25):
        observations, _, _, truncated, infos = envs.step(np.zeros((2, 4), np.float32))
        ended |= truncated
    assert ended.all()
    envs.close()
    assert not multiprocessing.active_children()


def test_an_agent_may_change_what_it_observes(make):
    """The last observation of an episode is the one before, and in the space all the same."""
    env = make("empty", "drone", settings=("episode.time_limit=0.5",))
    arrays, _ = env.reset(seed=1)
    ended = False
    while not ended:
        for array in arrays.values():
            array -= 50.0
        arrays, _, terminated, truncated, _ = env.step(AHEAD)
        ended = terminated or truncated
    assert env.observation_space.contains(arrays)


UNCLOSED = """
import pickle
import numpy as np
from wayproof.harness.gym.environment import WayproofEnv
from wayproof.harness.gym.exported import save_policy
env = WayproofEnv("empty", "drone")
again = pickle.loads(pickle.dumps(env))
for one in env, again:
    one.reset(seed=1)
    one.step(np.zeros(4, np.float32))
"""


def test_a_program_that_closes_no_environment_ends_silently():
    ended = subprocess.run([sys.executable, "-c", UNCLOSED], capture_output=True, check=True)
    assert ended.stderr == b""


def test_an_environment_that_nobody_closed_leaves_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    threads = threading.active_count()
    env = WayproofEnv("empty", "drone", settings=QUICK)
    env.reset(seed=1)
    env.step(AHEAD)
    del env
    gc.collect()
    assert threading.active_count() == threads
    assert not list(tmp_path.iterdir())
