"""A new kind of sensor: one file and one line in `DEVICES`, through an episode and its replay."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest

from wayproof.harness import config_document as settings
from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.replay.closed_loop import simulate_again
from wayproof.harness.replay.replay import replay
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.models.sensors.beams import BeamTable
from wayproof.models.sensors.devices import DEVICES, OWN, Device, RangeNoise


@pytest.fixture
def registered(monkeypatch):
    """The line in `DEVICES`, from which the setting's names are taken as config is imported."""
    monkeypatch.setitem(DEVICES, "sonar-ring", SONAR_RING)
    monkeypatch.setitem(settings.NAMED, "sensors.lidar", (OWN, *DEVICES))


def test_a_new_kind_drives_an_episode_that_replays(registered, tmp_path):
    chosen = ["sensors.lidar=sonar-ring", "episode.time_limit=1"]
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


@dataclass(frozen=True, kw_only=True)
class SonarRing(Device):
    """Sonars in a ring, each with a fan of beams over its cone, fired one after another.

    Attributes:
        sonars: Number of sonars around the z axis.
        cone: Full opening angle of each, rad.
        rays: Number of beams over each cone.
    """

    kind: ClassVar[str] = "sonar_ring"

    sonars: int
    cone: float
    rays: int

    def beam_table(self) -> BeamTable:
        """Return one row, with the beams of every sonar side by side."""
        centres = np.arange(self.sonars) * (2.0 * np.pi / self.sonars)
        fan = np.linspace(-0.5 * self.cone, 0.5 * self.cone, self.rays)
        azimuth = (centres[:, None] + fan).ravel()
        return BeamTable(
            rows=np.array([[1.0, 0.0]]),
            columns=np.stack([np.cos(azimuth), np.sin(azimuth)], axis=1),
            beams=len(azimuth),
            scan_poses=self.sonars,
            measures=self.measures,
        )


SONAR_RING = SonarRing(
    sonars=16,
    cone=0.26,
    rays=5,
    range=5.0,
    minimum_range=0.15,
    rate=10.0,
    noise=RangeNoise(sigma_proportional=0.01),
    no_return_is_free=True,
    source="assumed: sixteen sonars as robots of the nineties carried them",
)
