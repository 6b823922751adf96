"""Verification: an authentic log passes, and every forgery is found by some step."""

import json
import shutil
from pathlib import Path

import pytest

from tests.harness.replay.forgeries import CLAIMS, EDITS, Forgery, forge
from wayproof.harness.attribution.finding import Finding
from wayproof.harness.cli.main import main
from wayproof.harness.counterfactual.check import Verdict
from wayproof.harness.counterfactual.verdict import record_check
from wayproof.harness.errors import InputError
from wayproof.harness.log.copy import thin
from wayproof.harness.log.reader import open_log
from wayproof.harness.log.recover import recover
from wayproof.harness.recompute.rebuild import made_otherwise
from wayproof.harness.replay.closed_loop import simulate_again
from wayproof.harness.replay.consistency import contradictions
from wayproof.harness.replay.fork import fork
from wayproof.harness.replay.replay import replay, scope_of
from wayproof.harness.replay.signature import new_key, read_private_key, sign
from wayproof.harness.replay.verify import verify

PERTURBED = 'perturbation={"kind": "pose_drift", "severity": 5}'

SIMULATED = {
    "a bit of a sweep, digests and hashes made anew": "/sensor/",
    "the source of a sensor's figures": "/sensor/lidar/info[-1].source",
    "the clearance in the truth, figures made anew": "/truth[0].clearance_m",
    "the truth, to what was believed, figures made anew": "/truth[",
    "the hash of the stream `world`": "/streams[",
    "a saved state": "/state[",
    "an obstacle taken out of the scene": "scene.xml",
    "world and difficulty": "scene.xml",
    "the perturbation, to none, and its records": "/sensor/",
    "the cause": "result.cause",
}
"""Edits that only a new simulation shows, and the place that it names."""

TOGETHER = (
    (
        "the source of a sensor's figures",
        "the clearance in the truth, figures made anew",
        "the cause",
    ),
    ("a bit of a sweep, digests and hashes made anew", "the hash of the stream `world`"),
)
"""Such edits that one simulation shows side by side."""


@pytest.fixture(scope="module")
def source(recorded):
    """A short episode that failed and was perturbed."""
    short = "episode.time_limit=1.2", "map.resolution=0.2"
    result = recorded("empty", "drone", 1, *short, PERTURBED)
    assert (result.outcome, bool(result.cause)) == ("timeout", True)
    return Path(result.log)


def test_an_untouched_log_is_verified(source, capsys):
    assert main(["verify", str(source)]) == 0
    shown = capsys.readouterr().out
    assert shown.startswith("verified: timeout, 13 decisions simulated again; ")
    assert "claims: stage latencies, versions, machine" in shown
    assert "only 'replay simulate'" not in shown


@pytest.mark.parametrize("name", [one for one in EDITS if one not in (*SIMULATED, *CLAIMS)])
def test_a_forged_log_is_not_verified_even_without_a_simulation(source, tmp_path, name):
    found = verify(forge(source, name, tmp_path / "forged.mcap"), simulate=False)
    assert not found.verified
    assert found.failed in ("content", "replay")
    assert found.findings
    assert found.findings[0].recorded != found.findings[0].recomputed


@pytest.mark.parametrize("names", TOGETHER, ids=lambda names: names[0])
def test_the_simulation_names_each_place_that_was_edited(source, tmp_path, names):
    forgery = Forgery(source)
    for name in names:
        EDITS[name](forgery)
    found = verify(forgery.write(tmp_path / "forged.mcap"))
    assert (found.verified, found.failed) == (False, "simulation")
    fields = [one.field for one in found.findings]
    for name in names:
        assert any(one.startswith(SIMULATED[name]) for one in fields), (name, fields)


@pytest.mark.parametrize("name", ["an obstacle taken out of the scene", "world and difficulty"])
def test_a_scene_that_its_seed_does_not_make_is_named(source, tmp_path, name):
    assert made_otherwise(open_log(source)) == []
    found = made_otherwise(open_log(forge(source, name, tmp_path / "forged.mcap")))
    assert found[0].field.startswith("scene.xml")


@pytest.mark.parametrize("name", CLAIMS)
def test_only_a_signature_protects_a_claim(source, tmp_path, name):
    log = Path(shutil.copy(source, tmp_path / "signed.mcap"))
    public = str(new_key(tmp_path / "me.pem"))
    sign(log, read_private_key(tmp_path / "me.pem"))
    forge(source, name, log)
    assert contradictions(open_log(log)) == []
    assert main(["verify", str(log), "--key", public]) == 1


def test_an_unchecked_signature_is_mentioned(source, tmp_path, capsys):
    log = Path(shutil.copy(source, tmp_path / "signed.mcap"))
    public = str(new_key(tmp_path / "me.pem"))
    sign(log, read_private_key(tmp_path / "me.pem"))
    assert main(["verify", str(log), "--no-simulation"]) == 0
    assert "which was not checked: --key FILE" in capsys.readouterr().out
    assert main(["verify", str(log), "--no-simulation", "--key", public]) == 0
    assert "13 decisions signed, replayed; " in capsys.readouterr().out
    Path(f"{log}.sig").unlink()
    assert main(["verify", str(log), "--key", public, "--json"]) == 1
    document = json.loads(capsys.readouterr().out)
    assert (document["failed"], document["signed_by"]) == ("signature", None)


def test_verbs_refuse_a_log_that_contradicts_itself(source, tmp_path, capsys):
    log = str(forge(source, "the outcome, to success", tmp_path / "forged.mcap"))
    for words in (
        ["explain", log, "--metrics"],
        ["explain", log],
        ["audit", log],
        ["view", log, "--save", str(tmp_path / "x.rrd")],
        ["export", log, "--foxglove", str(tmp_path / "x.mcap")],
        ["view", log, "--png", str(tmp_path / "x.png")],
    ):
        assert main(words) == 2, words
        error = capsys.readouterr().err
        assert "result.outcome is " in error
        assert error.count("\n") == 1
    assert main(["explain", log, "--metrics", "--unchecked"]) == 0
    assert {one.name for one in tmp_path.iterdir()} == {"forged.mcap"}


def test_a_log_without_its_tail_is_not_identical(source, tmp_path, capsys):
    log = forge(source, "the tail cut off, count and time too", tmp_path / "forged.mcap")
    found = replay(log)
    assert (found.identical, found.differing) == (False, 0)
    assert next(one.field for one in found.contradictions) == "result.outcome"
    assert main(["replay", str(log)]) == 1
    assert "result.outcome: timeout -> one of collision" in capsys.readouterr().out


def test_a_replay_lists_what_it_covers(source):
    scope = replay(source).scope
    assert {"decisions", "chain", "outcome", "cause", "deadline misses"} <= set(scope.recomputed)
    assert {"truth", "states", "sweeps"} <= set(scope.simulation)
    assert scope.claims == ("stage latencies", "versions", "machine")


def test_the_verdict_of_a_check_is_a_claim(source, tmp_path):
    log = tmp_path / "checked.mcap"
    shutil.copyfile(source, log)
    finding = Finding("tracking", "by hand", 3, (0.0, 0.0, 0.0))
    record_check(log, Verdict(finding, "confirmed", (), 0.0))
    scopes = [scope_of(open_log(one), with_cause=True) for one in (source, log)]
    assert set(scopes[1].claims) - set(scopes[0].claims) == {"verdict of its counterfactual check"}


def test_a_replay_attributes_the_cause_again(source, tmp_path):
    found = replay(forge(source, "the cause", tmp_path / "forged.mcap"))
    assert not found.identical
    fields = {one.field: one for one in found.contradictions}
    assert fields["result.cause_evidence"].recorded == "no way leads there"


def test_a_forged_outcome_is_not_identical_in_closed_loop(source, tmp_path):
    again = simulate_again(forge(source, "the outcome, to success", tmp_path / "forged.mcap"))
    assert not again.identical
    assert (again.outcome, again.recorded_outcome) == ("timeout", "success")
    assert "result.outcome" in [one.field for one in again.findings]


def test_a_log_of_decisions_is_verified_by_a_simulation_alone(source, tmp_path):
    small = Path(shutil.copy(source, tmp_path / "small.mcap"))
    thin(small)
    found = verify(small)
    assert found.verified, found.findings
    assert found.steps == ("content", "simulation")
    assert found.violations == 0
    without = verify(small, simulate=False)
    assert (without.verified, without.findings[0].field) == (False, "sweeps")


def test_a_forked_log_is_simulated_fork_by_fork(source, tmp_path):
    forked = fork(source, 6, ["map.resolution=0.15"], tmp_path / "fork.mcap")
    found = verify(Path(forked.log))
    assert found.verified, found.findings
    assert "simulation" in found.steps
    for name in ("the clearance in the truth", "the tail cut off, a success"):
        assert contradictions(open_log(forge(Path(forked.log), name, tmp_path / "forged.mcap")))


def test_a_recovered_log_is_verified_as_far_as_it_goes(source, tmp_path, capsys):
    broken = tmp_path / "cut.mcap"
    broken.write_bytes(source.read_bytes()[: source.stat().st_size * 4 // 5])
    recovered = str(tmp_path / "recovered.mcap")
    recover(broken, Path(recovered))
    assert main(["verify", recovered]) == 0
    shown = capsys.readouterr().out
    assert "as far as it goes (the log breaks off): error, " in shown
    assert "that its end is missing" in shown
    for words in (["explain"], ["explain", "--metrics"], ["audit"], ["replay"]):
        assert main([*words, recovered]) == 0, words


def test_an_intact_log_has_nothing_to_recover(source, tmp_path, capsys):
    log = Path(shutil.copy(source, tmp_path / "a.mcap"))
    assert main(["export", str(log), "--log", str(tmp_path / "b.mcap")]) == 2
    assert "whole, nothing to recover" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == [log]


def test_a_whole_log_that_lacks_only_its_name_keeps_its_result(source, tmp_path):
    partial = Path(shutil.copy(source, tmp_path / "a.mcap.partial"))
    written = tmp_path / "a.mcap"
    recover(partial, written)
    assert open_log(written).result == open_log(source).result


def test_a_log_that_cannot_be_verified_is_one_line(source, tmp_path, capsys):
    assert main(["verify", str(tmp_path / "none.mcap")]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    spoilt = bytearray(source.read_bytes())
    spoilt[len(spoilt) // 2] ^= 1
    (tmp_path / "spoilt.mcap").write_bytes(spoilt)
    with pytest.raises(InputError, match=r"checksum|corruption|damaged"):
        verify(tmp_path / "spoilt.mcap")


def test_another_machine_is_named_where_a_simulation_differs(source, tmp_path, capsys):
    forgery = Forgery(source)
    EDITS["the hash of the stream `world`"](forgery)
    forgery.run.update(libc="musl", cpu="other")
    assert main(["verify", str(forgery.write(tmp_path / "forged.mcap"))]) == 1
    assert "recorded with another cpu, libc: a simulation is repeated" in capsys.readouterr().out
