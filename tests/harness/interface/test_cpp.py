"""The C++ example: compiled, on trial, replayed without it, and broken."""

import subprocess
from pathlib import Path

import numpy as np
import pytest

from tests.harness.interface.cpp import ROOT, compile_cpp
from wayproof import Config, build, open_log, override, run_episode
from wayproof.harness.interface.command_messages import command_message
from wayproof.harness.interface.observation_messages import (
    observation_message,
    task_message,
)
from wayproof.harness.interface.observations import ObservationBuilder, task_of
from wayproof.harness.interface.types import Command, Waypoints
from wayproof.harness.replay.answers import compare_answers, sensors_of
from wayproof.harness.replay.replay import replay
from wayproof.harness.schema import stack_pb2 as sb
from wayproof.planners import hold


@pytest.fixture(scope="module")
def stack(tmp_path_factory):
    source = ROOT / "examples/cpp/stack.cpp"
    return compile_cpp(source, tmp_path_factory.mktemp("cpp") / "stack")


@pytest.fixture(scope="module")
def probe(tmp_path_factory):
    source = Path(__file__).with_name("probe.cpp")
    return compile_cpp(source, tmp_path_factory.mktemp("cpp") / "probe", "-O0")


def trial(log, stack, world="empty", robot="quadruped", seed=1, *settings):
    config = override(Config(world, robot, seed), [*settings, f"stack.name={stack}"])
    return run_episode(build(config), log)


def framed(*messages):
    parts = [message if isinstance(message, bytes) else message.SerializeToString()
             for message in messages]  # fmt: skip
    return b"".join(len(part).to_bytes(4, "little") + part for part in parts)


def answers(output):
    found = []
    while output:
        size = int.from_bytes(output[:4], "little")
        found.append(sb.FromStack.FromString(output[4 : 4 + size]))
        output = output[4 + size :]
    return found


def talk(program, data):
    ended = subprocess.run([program], input=data, capture_output=True, timeout=20, check=False)
    return ended.returncode, answers(ended.stdout)


def test_the_example_goes_around_obstacles_and_replays_without_it(tmp_path, stack):
    program = tmp_path / "mine"
    program.write_bytes(stack.read_bytes())
    program.chmod(0o755)
    quick = ("cylinders", "quadruped", 2, "episode.time_limit=5")
    first = trial(tmp_path / "a.mcap", f"exec:{program}", *quick)
    assert (first.outcome, first.collisions) == ("timeout", 0)
    assert first.path_length_m > 2.0
    assert compare_answers(Path(first.log), f"exec:{program}").identical
    program.unlink()
    again = replay(Path(first.log))
    assert again.identical, (again.differences, again.contradictions)


@pytest.mark.parametrize(
    ("robot", "settings", "error_m"),
    [
        # rolling, and other directions in each sweep
        ("quadruped", ["sensors.lidar=livox-mid360"], 0.03),
        ("drone", ["sensors.depth=intel-realsense-d435"], 1e-3),  # depths, rounded to 1 mm
    ],
)
def test_the_header_reads_and_writes_every_field_it_knows(
    tmp_path, probe, robot, settings, error_m
):
    log = tmp_path / "a.mcap"
    trial(log, f"exec:{probe}", "cylinders", robot, 3, "episode.time_limit=0.5", *settings)
    opened = open_log(log)
    task = task_of(opened.config, opened.mission, sensors_of(opened))
    builder = ObservationBuilder(opened.config, opened.mission, opened.beams)
    rest = hold(np.array(task.mission.start), 0, 0.0)
    count = 0
    for record in opened.records():
        observation = builder.build(record.inputs, rest, None)
        points = np.vstack([sweep.points for sweep in observation.sweeps])
        got = sb.Command.FromString(record.answer.command)
        assert got.scalars["count"] == len(points) > 500
        middle = np.array([got.scalars[axis] for axis in "xyz"]) / len(points)
        assert np.abs(middle - points.mean(axis=0)).max() < (
            error_m if count else 1e-3
        )  # at rest at first
        assert (got.scalars["seed"], got.scalars["below_zero"]) == (float(task.seed), -1.5)
        assert got.scalars["time_s"] == pytest.approx(record.inputs.time_ns * 1e-9)
        at = np.array(got.planned_path).reshape(2, 3)[0]
        expected = Command(
            Waypoints(np.array([at + np.array([0.1, 0.0, 0.0]), task.mission.goal]), 0.4),
            action="follow",
            label="none",
            reason="followed" if count else "first",
            planned_path=np.array([at, task.mission.goal]),
            map_version="none",
            scalars=dict(got.scalars),
        )
        assert got == command_message(expected, count)
        count += 1
    assert count > 4


def test_an_exception_is_an_error_of_the_episode(tmp_path, probe):
    result = trial(tmp_path / "a.mcap", f"exec:{probe} throws", "empty", "drone")
    assert (result.outcome, result.cause) == ("error", "plugin_failed")
    assert "failed: no map at decision 3" in result.reason


@pytest.fixture
def messages(recorded):
    """A task and an observation, as they are sent."""
    opened = open_log(Path(recorded("empty", "drone", 1).log))
    task = task_of(opened.config, opened.mission, sensors_of(opened))
    builder = ObservationBuilder(opened.config, opened.mission, opened.beams)
    rest = hold(np.array(task.mission.start), 0, 0.0)
    observation = builder.build(next(opened.records()).inputs, rest, None)
    return task_message(task), observation_message(observation, task)


def test_fields_of_a_later_version_are_skipped(probe, messages):
    task, observation = messages
    unknown = b"\xf8\x3f\x07\xf9\x3f" + bytes(8) + b"\xfa\x3f\x02ab\xfd\x3f" + bytes(4)  # 1023
    wrapped = [sb.ToStack(hello=sb.Hello(version=1)), sb.ToStack(task=task)]
    plain = framed(*wrapped, sb.ToStack(observation=observation), sb.ToStack(close=sb.Close()))
    code, expected = talk(probe, plain)
    assert code == 0
    assert [one.WhichOneof("kind") for one in expected] == ["hello", "command"]
    assert (expected[0].hello.version, expected[0].hello.name) == (1, "probe 1.0")
    later = observation.SerializeToString() + unknown
    inner = sb.ToStack(observation=sb.Observation.FromString(later))
    assert unknown in inner.SerializeToString()
    data = framed(*wrapped, inner.SerializeToString() + unknown, unknown)
    assert talk(probe, data) == (0, expected)


def test_what_is_no_message_is_answered_with_a_failure(probe, messages):
    task, observation = messages
    start = [sb.ToStack(hello=sb.Hello(version=1)), sb.ToStack(task=task)]
    whole = sb.ToStack(observation=observation).SerializeToString()
    few = sb.Observation.FromString(observation.SerializeToString())
    few.sweeps[0].ranges_mm = few.sweeps[0].ranges_mm[2:]
    for data, text in (
        (framed(*start, whole[:-5]), "a message that ends early"),
        (framed(*start, b"\x7b"), "a field of an unknown type"),
        (framed(*start, b"\x18\x05"), "a field of another type than expected"),
        (framed(*start, b"\x80" * 11), "an integer of more than 10 bytes"),
        (framed(*start, sb.ToStack(observation=sb.Observation())), "an observation without a pose"),
        (framed(*start, sb.ToStack(observation=few)), "a sweep of another size than its sensor"),
        (framed(*start) + b"\xff\xff\xff\xff", "a message that is too long"),
    ):
        code, found = talk(probe, data)
        assert code == 1, text
        assert text in found[-1].failure.text


def test_closed_pipes_end_it_without_noise(probe, messages):
    task, _ = messages
    start = framed(sb.ToStack(hello=sb.Hello(version=1)), sb.ToStack(task=task))
    assert talk(probe, b"")[0] == 0
    assert talk(probe, start + b"\x09\x00")[0] == 0  # in the middle of a length
    child = subprocess.Popen([probe], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    child.stdout.close()
    child.stdin.write(framed(sb.ToStack(hello=sb.Hello(version=1))))
    child.stdin.close()
    assert child.wait(20) == 0  # nobody reads its hello
