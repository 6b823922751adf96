"""A new kind of sensor: one file and one line in `DEVICES`, through an episode and its replay."""

import pytest

from tests.harness.sonar_ring import SONAR_RING
from wayproof.harness import config_document as settings
from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.replay.closed_loop import simulate_again
from wayproof.harness.replay.replay import replay
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.models.sensors.devices import DEVICES, OWN


@pytest.fixture
def registered(monkeypatch):
    """The line in `DEVICES`, from which the setting's names are taken as config is imported."""
    monkeypatch.setitem(DEVICES, "sonar-ring", SONAR_RING)
    monkeypatch.setitem(settings.NAMED, "sensors.lidar", (OWN, *DEVICES))


def test_a_new_kind_drives_an_episode_that_replays(registered, tmp_path):
    chosen = ["sensors.lidar=sonar-ring", "episode.time_limit=2"]
    scenario = build(override(Config("corridor", "quadruped", 1), chosen))
    log = tmp_path / "sonars.mcap"
    result = run_episode(scenario, log)
    messages = list(read_messages(log))
    (info,) = (message for message in messages if isinstance(message, pb.SensorInfo))
    assert (info.name, info.kind, info.device) == ("lidar", "sonar_ring", "sonar-ring")
    sweeps = [message for message in messages if isinstance(message, pb.Sweep)]
    assert {(sweep.rows, sweep.columns) for sweep in sweeps} == {(1, 80)}
    assert len(sweeps) == result.decisions
    assert replay(log).identical
    assert simulate_again(log).identical


def test_every_kind_names_itself():
    kinds = {type(device) for device in (*DEVICES.values(), SONAR_RING)}
    assert {kind.kind for kind in kinds} == {"depth_camera", "lidar", "rangefinder", "sonar_ring"}
