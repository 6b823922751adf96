"""The Python client: in a process without Wayproof, it is the stack that it is in this one."""

import os
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from wayproof import Config, build, open_log, override, run_episode
from wayproof.harness.replay.replay import replay
from wayproof.harness.schema import stack_pb2 as sb

ROOT = Path(__file__).parents[3]
CLIENT = ROOT / "examples/python/client.py"

ADAPTER = '''"""The client's stack in this process: the same messages, with no pipe in between."""

import importlib.util
import sys

from wayproof.harness.interface.command_messages import motion_of
from wayproof.harness.interface.observation_messages import (
    observation_message,
    task_message,
)
from wayproof.harness.interface.types import Command
from wayproof.harness.schema import stack_pb2

sys.modules["stack_pb2"] = stack_pb2
spec = importlib.util.spec_from_file_location("client", {client!r})
client = importlib.util.module_from_spec(spec)
spec.loader.exec_module(client)


class Adapter:
    def start(self, task):
        self.task, self.stack = task, client.Careful()
        self.stack.start(task_message(task))

    def step(self, observation):
        answer = self.stack.step(observation_message(observation, self.task))
        return Command(motion_of(answer), reason=answer.reason, scalars=dict(answer.scalars))

    def close(self):
        self.stack.close()
'''


@pytest.fixture(scope="module")
def environment(tmp_path_factory):
    """Variables of a process that has the generated code and two packages, and no Wayproof."""
    folder = tmp_path_factory.mktemp("generated")
    protoc = [sys.executable, "-m", "grpc_tools.protoc", "-Iharness/schema"]
    subprocess.run([*protoc, f"--python_out={folder}", "stack.proto"], cwd=ROOT, check=True)
    packages = Path(np.__file__).parents[1]
    path = os.pathsep.join([str(folder), str(packages)])
    # -S leaves out the links to this project's sources that an editable install puts there.
    found = subprocess.run(
        [sys.executable, "-S", "-c", "import numpy, google.protobuf, stack_pb2; import wayproof"],
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    if "No module named 'wayproof'" not in found.stderr:
        pytest.skip(f"Wayproof is installed among the packages: {found.stderr[-200:]}")
    return path


@pytest.fixture
def command(environment):
    words = ["env", f"PYTHONPATH={environment}", sys.executable, "-S", str(CLIENT)]
    return f"exec:{shlex.join(words)}"


def trial(log, stack, world, robot, limit):
    settings = [f"episode.time_limit={limit}", f"stack.name={stack}"]
    return run_episode(build(override(Config(world, robot, 2), settings)), log)


def test_the_client_gives_the_chain_of_the_same_stack_in_this_process(tmp_path, command):
    adapter = tmp_path / "adapter.py"
    adapter.write_text(ADAPTER.format(client=str(CLIENT)))
    here = trial(tmp_path / "here.mcap", f"{adapter}:Adapter", "cylinders", "quadruped", 4)
    there = trial(tmp_path / "there.mcap", command, "cylinders", "quadruped", 4)
    assert here.chain == there.chain
    assert here.decisions == there.decisions > 20
    assert replay(Path(there.log)).identical
    answers = [one.answer.command for one in open_log(Path(there.log)).records()]
    speeds = {sb.Command.FromString(one).velocity.forward for one in answers}
    assert len(speeds) > 5  # it saw something


def test_an_exception_of_the_client_is_the_reason_of_the_end(tmp_path, environment, command):
    mine = tmp_path / "mine.py"
    mine.write_text(CLIENT.read_text().replace("room = self.room(observation)", "room = 1 / 0"))
    result = trial(
        tmp_path / "a.mcap", command.replace(str(CLIENT), str(mine)), "empty", "drone", 60
    )
    assert (result.outcome, result.cause) == ("error", "plugin_failed")
    assert "failed: ZeroDivisionError: division by zero" in result.reason
