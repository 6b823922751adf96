"""Prior maps for stacks on trial and for recordings: given to them, and admitting nothing."""

import sys
from pathlib import Path

import numpy as np
import pytest

from wayproof.harness.cli.main import main
from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.interface.observation_messages import task_from, task_message
from wayproof.harness.interface.observations import task_of
from wayproof.harness.log.reader import open_log
from wayproof.harness.prior.cells import logged_cells
from wayproof.harness.replay.answers import sensors_of
from wayproof.harness.replay.audit import audit
from wayproof.harness.replay.verify import verify
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build

BUILTIN = f"{Path(__file__).parents[1] / 'interface' / 'stacks_on_trial.py'}:OfSeed1"
SHORT = "episode.time_limit=1.5"


def run(folder, stack, *settings, name="log"):
    config = override(
        Config("maze", "drone", 1), [f"stack.name={stack}", "prior.source=truth", SHORT, *settings]
    )
    return run_episode(build(config), folder / f"{name}.mcap")


def ways(log):
    return [[(p.x, p.y, p.z) for p in one.trajectory.path] for one in open_log(log).decisions()]


def test_a_stack_gets_the_prior_map_and_the_referee_admits_nothing_by_it(tmp_path):
    served = f"exec:{sys.executable} -m wayproof serve {BUILTIN}"
    log = Path(run(tmp_path, served, name="process").log)
    assert ways(log) == ways(Path(run(tmp_path, "builtin", name="ours").log))
    without = run(tmp_path, BUILTIN, "prior.policy=ignore", name="without")
    assert ways(log) != ways(Path(without.log))
    stated = list(open_log(log).decisions())
    assert {one.verdict.verdict for one in stated} == {"admitted"}
    assert max(one.global_evidence.prior_m for one in stated) > 1.0
    assert verify(log).verified
    assert audit(log).violations == ()


def test_the_task_of_another_process_holds_the_cells(tmp_path):
    log = open_log(Path(run(tmp_path, "gap", "episode.time_limit=1").log))
    task = task_of(log.config, log.mission, sensors_of(log))
    again = task_from(task_message(task)).prior
    cells = logged_cells(log.config)
    assert (again.first, again.resolution) == (cells.first, cells.resolution)
    assert np.array_equal(again.states, cells.states)
    ignored = override(log.config, ["prior.policy=ignore"])
    assert task_of(ignored, log.mission, sensors_of(log)).prior is None


@pytest.fixture
def episode(recorded):
    """The log of an episode that is taken as a recording."""
    return recorded("corridor", "quadruped", 1, "episode.time_limit=2").log


def test_a_recording_takes_the_map_of_a_file(tmp_path, episode):
    log = tmp_path / "a.mcap"
    command = ["shadow", episode, "--robot", "quadruped", "--prior", episode, "--log", str(log)]
    assert main(command) in (0, 1)
    stated = list(open_log(log).decisions())
    assert max(one.global_evidence.prior_m for one in stated) > 0.1
    assert verify(log).verified
    assert audit(log).violations == ()


@pytest.mark.parametrize("source", ["truth", "splat"])
def test_a_recording_has_no_geometry_to_make_a_map_of(tmp_path, episode, capsys, source):
    common = ["shadow", episode, "--robot", "quadruped", "--log", str(tmp_path / "a.mcap")]
    assert main([*common, "--prior", source]) == 2
    assert "for a recording, whose world is not known; expected a file" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
