"""Decisions of other settings on the inputs of a log."""

from pathlib import Path

import pytest

from tests.harness.replay.episodes import SHORT
from wayproof.harness.cli.main import main
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log
from wayproof.harness.replay.what_if import what_if


def test_what_if_nothing_changes(recorded):
    answer = what_if(Path(recorded(*SHORT["drone"]).log), ["map.memory_mib=300"])
    assert answer.faithful
    assert answer.changes == ()


def test_what_if_a_wider_margin(recorded, capsys):
    log = recorded(*SHORT["drone"]).log
    answer = what_if(Path(log), ["costmap.localization_margin=0.5"])
    assert answer.faithful
    assert 0 < len(answer.changes) <= answer.decisions
    first = answer.changes[0]
    old = list(open_log(Path(log)).decisions())[first.sequence]
    assert (first.recorded.action, first.recorded.reason) == (old.action, old.reason)
    assert first.departure_m > 0.01 or first.recorded != first.changed
    assert main(["replay", "what-if", log, "--set", "costmap.localization_margin=0.5"]) == 1
    assert f"from {first.sequence} (" in capsys.readouterr().out


def test_a_change_later_on_is_no_echo(recorded):
    """Half the speed never changes where the recorded robot stands, so each change stands alone."""
    answer = what_if(Path(recorded(*SHORT["drone"]).log), ["motion.speed_fraction=0.5"])
    assert answer.changes
    assert all(one.changed.label != "localization_lost" for one in answer.changes)


@pytest.mark.parametrize(
    ("kind", "options", "said"),
    [
        (["what-if"], ["--set", "sensors.lidar=velodyne-vlp16"], "changes what is sensed"),
        (["what-if"], ["--set", "world=empty"], "changes what is sensed"),
        (["what-if"], [], "expected either --set KEY=VALUE or --stack STACK"),
        (["fork"], ["9999"], "N: got 9999, expected a decision from 0 to 20"),
        (["fork"], ["-1"], "N: got -1"),
        (["fork"], ["5", "--set", "seed=2"], "the episode had begun with it"),
        (["simulate"], ["--set", "map.log_odds_hit=0.8"], "unknown option '--set'"),
        ([], ["--log", "x.mcap"], "unknown option '--log'"),
    ],
)
def test_a_kind_of_replay_refuses_what_is_not_its_own(recorded, capsys, kind, options, said):
    assert main(["replay", *kind, recorded(*SHORT["quadruped"]).log, *options]) == 2
    captured = capsys.readouterr()
    assert said in captured.err
    assert captured.err.count("\n") == 1


def test_other_settings_of_the_referee_change_its_verdicts(recorded, capsys):
    path = Path(recorded("cylinders", "drone", 2, "stack.name=blind").log)
    wider = what_if(path, ["costmap.localization_margin=0.4"])
    old, new = wider.recorded_verdicts, wider.changed_verdicts
    recorded_ones = [one.verdict.verdict for one in open_log(path).decisions()]
    assert old.admitted == recorded_ones.count("admitted")
    assert old.cut == old.unknown + old.blocked == len(recorded_ones) - old.admitted
    assert old.first_cut == next(k for k, one in enumerate(recorded_ones) if one != "admitted")
    assert new.cut > old.cut
    assert {one.changed.verdict for one in wider.changes} == {"blocked"}
    assert wider.actions == 0  # without the guard the commands are followed all the same
    assert main(["replay", "what-if", str(path), "--set", "stack.guard=true"]) == 1
    shown = capsys.readouterr().out
    assert f"a guard cuts {old.cut}, the first at {old.first_cut}" in shown
    with pytest.raises(InputError, match="a log holds no answers of another stack"):
        what_if(path, ["stack.name=gap"])
