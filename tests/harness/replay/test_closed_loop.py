"""Episodes of logs simulated again in closed loop."""

from pathlib import Path

import pytest

from tests.harness.replay.episodes import SHORT, altered
from wayproof.harness.replay.closed_loop import simulate_again
from wayproof.harness.schema import wayproof_pb2 as pb


@pytest.mark.parametrize("robot", sorted(SHORT))
def test_simulated_anew_everything_is_the_same(recorded, robot):
    again = simulate_again(Path(recorded(*SHORT[robot]).log))
    assert again.identical
    assert again.scene_from_seed
    assert again.first_input is None


def test_the_first_input_that_differs_is_named(recorded, tmp_path):
    def brush(message):
        if isinstance(message, pb.Pose) and message.sequence == 5:
            message.position[0] += 1e-12

    source = Path(recorded(*SHORT["drone"]).log)
    again = simulate_again(altered(source, tmp_path / "brushed.mcap", brush))
    assert not again.identical
    assert (again.first_input.stream, again.first_input.sequence) == ("/pose", 5)
    assert again.first_input.time_s == pytest.approx(0.5)


def test_measured_delays_are_simulated_again(recorded):
    settings = ("episode.time_limit=2", "latency.mode=measured", "latency.deadline=0.5")
    again = simulate_again(Path(recorded("empty", "drone", 2, *settings).log))
    assert again.identical
