"""Episodes of logs simulated again in closed loop."""

from pathlib import Path

import pytest

from tests.harness.replay.episodes import SHORT, altered
from wayproof.harness.log.reader import open_log
from wayproof.harness.replay.answers import restarted_stack
from wayproof.harness.replay.closed_loop import simulate_again
from wayproof.harness.replay.fork import fork
from wayproof.harness.replay.replay import replay
from wayproof.harness.replay.verify import verify
from wayproof.harness.schema import wayproof_pb2 as pb


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
    path = Path(recorded("empty", "drone", 2, *settings).log)
    assert replay(path).identical
    assert simulate_again(path).identical


GUARDED = ("cylinders", "drone", 6, "stack.name=blind", "stack.guard=true", "episode.stuck_after=2")


@pytest.fixture
def forked(recorded, tmp_path):
    """Fork the log of a guarded stack on trial, which goes on, once for each change."""

    def fork_at(*changes):
        path = Path(recorded(*GUARDED).log)
        for number, (at, setting) in enumerate(changes):
            target = tmp_path / f"{number}.mcap"
            with restarted_stack(open_log(path), "blind") as restarted:
                fork(path, at, (setting,), target, restarted=restarted)
            path = target
        return path

    return fork_at


@pytest.mark.few(1)
@pytest.mark.parametrize(
    "changes",
    [
        [(9, "stack.guard=false")],
        [(5, "episode.time_limit=1.5"), (9, "stack.guard=false")],
    ],
)
def test_a_fork_of_a_stack_on_trial_that_ends_before_its_log_is_true(recorded, forked, changes):
    """The recorded answers are those of the fork: none is left for the end before it."""
    path = forked(*changes)
    assert int(open_log(path).result["decisions"]) < recorded(*GUARDED).decisions
    found = verify(path)
    assert found.verified, found.findings
    assert "simulation" in found.steps


@pytest.mark.few(1)
@pytest.mark.parametrize("sequence", [9, 11])
def test_a_forged_fork_of_a_stack_on_trial_is_found(forked, tmp_path, sequence):
    """At and after the fork."""

    def brush(message):
        if isinstance(message, pb.Pose) and message.sequence == sequence:
            message.position[0] += 1e-12

    source = forked((9, "stack.guard=false"))
    again = simulate_again(altered(source, tmp_path / "brushed.mcap", brush))
    assert not again.identical
    assert (again.first_input.stream, again.first_input.sequence) == ("/pose", sequence)
