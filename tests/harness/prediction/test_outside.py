"""Predictors from outside: run once, in the log, and never run again because a log names them."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper

from wayproof.harness.attribution.case import read_case
from wayproof.harness.cli.main import main
from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.errors import InputError
from wayproof.harness.explain.card import make_card
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.log.reader import open_log
from wayproof.harness.metrics import score
from wayproof.harness.replay.audit import audit
from wayproof.harness.replay.closed_loop import simulate_again
from wayproof.harness.replay.fork import fork
from wayproof.harness.replay.replay import replay
from wayproof.harness.replay.verify import verify
from wayproof.harness.replay.what_if import what_if
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.trace import read_trace

HERE = Path(__file__).parent
ROOT = HERE.parents[2]
SERVE = f"exec:{sys.executable} -m wayproof serve --predictor"
SHORT = "episode.time_limit=1.4"


def run(folder, source, *settings, world="warehouse", robot="drone", seed=1, name="log"):
    coarse = ["map.resolution=0.2"] if robot == "drone" else []
    chosen = [f"prediction.source={source}", SHORT, *coarse, *settings]
    config = override(Config(world, robot, seed), chosen)
    return run_episode(build(config), folder / f"{name}.mcap")


def own(folder, kind):
    file = folder / "mine.py"
    shutil.copy(HERE / "predictors.py", file)
    return f"{file}:{kind}"


def network(path, sizes, inputs=("states",), channels=2):
    """A network of one convolution: what is near an occupied cell or column is occupied."""
    edges = (3,) * len(sizes)
    weights = np.zeros((1, channels, *edges), np.float32)
    weights[0, 0] = 2.0
    infos = [
        helper.make_tensor_value_info(name, TensorProto.FLOAT, [1, channels, *sizes])
        for name in inputs
    ]
    output = helper.make_tensor_value_info("log_odds", TensorProto.FLOAT, [1, 1, *sizes])
    pads = [1] * (2 * len(sizes))
    node = helper.make_node("Conv", [inputs[0], "weights"], ["log_odds"], pads=pads)
    tensors = [numpy_helper.from_array(weights, "weights")]
    graph = helper.make_graph([node], "network", infos, [output], tensors)
    onnx.save(
        helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9), path
    )
    return path


def predictions(log):
    return [one for one in read_messages(Path(log)) if isinstance(one, pb.Prediction)]


@pytest.fixture(scope="module")
def walls(tmp_path_factory):
    """Source and result of an episode with a class that sees walls go on."""
    folder = tmp_path_factory.mktemp("walls")
    source = own(folder, "Walls")
    return source, run(folder, source)


@pytest.mark.parametrize(
    ("kind", "robot"), [("process", "drone"), ("columns", "quadruped"), ("fixed", "drone")]
)
def test_a_log_replays_without_its_predictor(tmp_path, kind, robot):
    folder = tmp_path / "predictor"
    folder.mkdir()
    source = {
        "process": lambda: f"{SERVE} {own(folder, 'Walls')}",
        "columns": lambda: network(folder / "n.onnx", ["nx", "ny"]),
        "fixed": lambda: network(folder / "n.onnx", [40, 30, 12]),
    }[kind]()
    result = run(tmp_path, source, robot=robot)
    shutil.rmtree(folder)
    log = Path(result.log)
    made = predictions(log)
    decisions = list(open_log(log).decisions())
    assert len(made) == len(decisions) - 1  # nothing was measured before the first one
    assert all(one.shape for one in made[9:])
    took = sorted(one.stages.predict_ms for one in decisions[1:])
    assert 0.0 < took[0] < score(read_trace(open_log(log)))["predict_p50"] < took[-1]
    replayed = replay(log)
    assert replayed.identical, (replayed.differences, replayed.contradictions)
    assert simulate_again(log).identical
    assert audit(log).violations == ()


def test_predicted_free_space_guides_and_admits_nothing(tmp_path):
    log = Path(run(tmp_path, own(tmp_path, "Free"), robot="quadruped").log)
    stated = [one.global_evidence for one in open_log(log).decisions()]
    assert max(one.predicted_m for one in stated) > 1.0
    assert audit(log).violations == ()


def test_a_process_gives_the_same_decisions_as_its_class(walls, tmp_path):
    _, inside = walls
    outside = run(tmp_path, f"{SERVE} {own(tmp_path, 'Walls')}", name="b")
    assert inside.chain == outside.chain
    assert {one.predictor for one in predictions(outside.log)} == {"walls 1"}
    assert inside.chain != run(tmp_path, own(tmp_path, "Cells"), name="c").chain


def test_any_language_can_answer_with_a_part_of_the_box(tmp_path):
    command = raw(tmp_path, "upper")
    log = Path(run(tmp_path, command).log)
    made = predictions(log)
    area = 12 * 12 * 30
    assert made[-1].predictor == "raw"
    assert all(0 < np.prod(one.shape) for one in made)
    assert max(np.prod(one.shape) for one in made) > area
    assert replay(log).identical


def raw(folder, kind):
    """A command of a predictor that shares no code with us."""
    protoc = [sys.executable, "-m", "grpc_tools.protoc", "-Iharness/schema"]
    subprocess.run([*protoc, f"--python_out={folder}", "stack.proto"], cwd=ROOT, check=True)
    return f"exec:{sys.executable} {HERE / 'raw_predictor.py'} {folder} {kind}"


@pytest.mark.parametrize(
    ("way", "kind", "text"),
    [
        ("class", "Nan", "predicted what is none: got nan at cell (1, 2, 3), expected"),
        ("class", "Shape", "got log-odds of shape (3, 3), expected ("),
        ("class", "Text", "got str, expected an array of log-odds"),
        ("class", "Overwrites", "destination is read-only"),
        ("class", "Hangs", "had not returned after 2 s (plugins.wall_s)"),
        ("served", "Raises", "failed: KeyError: 'weights'"),
        ("raw", "dies", "ended (exit code 7); its last line on stderr: segmentation"),
        ("raw", "hangs", "had not answered after 2 s (plugins.wall_s)"),
    ],
)
def test_a_broken_predictor_ends_the_episode_in_one_line(tmp_path, way, kind, text):
    source = raw(tmp_path, kind) if way == "raw" else own(tmp_path, kind)
    source = f"{SERVE} {source}" if way == "served" else source
    wall = "plugins.wall_s=2" if kind.lower() == "hangs" else "plugins.wall_s=120"
    result = run(tmp_path, source, wall, world="empty")
    assert (result.outcome, result.cause) == ("error", "plugin_failed")
    assert text in result.reason
    assert result.reason.startswith("predictor '")
    assert "\n" not in result.reason
    assert result.decisions == 3
    assert replay(Path(result.log)).identical  # the decisions before


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        ("outside", "expected within the box of ("),
        ("short", "got 7 log-odds, expected those of ("),
        ("other", "answered box 2, expected 1"),
    ],
)
def test_an_answer_that_is_none_is_named(tmp_path, kind, text):
    result = run(tmp_path, raw(tmp_path, kind), world="empty")
    assert (result.outcome, result.cause) == ("error", "plugin_failed")
    assert text in result.reason


@pytest.mark.parametrize(
    ("source", "text"),
    [
        ("oracle", "prediction.source: got 'oracle', expected none, completion, module:Class"),
        ("no.such:Thing", "which cannot be loaded: 'no.such' raised ModuleNotFoundError"),
        ("{mine}:Silent", "a class without predict; expected one with predict(box)"),
        ("{mine}:Unable", "raised OSError: no weights"),
        ("exec:no-such-command", "prediction.source exec:no-such-command: no-such-command: No"),
        ("exec:cat", "is a stack, expected a predictor"),
        ("exec:true", "ended (exit code 0)"),
        ("tcp:127.0.0.1:9", "127.0.0.1:9: Connection refused, expected a predictor that listens"),
        ("no.onnx", "predictor 'no.onnx': no such file, expected an ONNX model"),
        ("{mine}.onnx", "cannot be loaded"),
        ("two.onnx", "got 2 inputs and 1 outputs, expected one of each"),
        ("three.onnx", "expected a tensor(float) of shape (1, 2, nx, ny, nz)"),
    ],
)
def test_what_is_no_predictor_is_refused_in_one_line(tmp_path, capfd, monkeypatch, source, text):
    monkeypatch.chdir(tmp_path)
    shutil.copy(HERE / "predictors.py", "mine.py")
    Path("mine.py.onnx").write_text("no model")
    network(Path("two.onnx"), ["nx", "ny"], ("states", "more"))
    network(Path("three.onnx"), ["nx", "ny"], channels=3)
    if source == "exec:cat":
        source = f"exec:{sys.executable} {HERE.parent / 'interface' / 'peer.py'} stands"
    source = source.format(mine="mine.py")
    command = ["run", "empty", "--robot", "drone", "--seed", "1", "--log", "log.mcap"]
    assert main([*command, "--set", f"prediction.source={source}"]) == 2
    error = capfd.readouterr().err.strip().splitlines()
    assert text in error[-1]
    assert not any("Traceback" in line for line in error)
    assert not [one for one in os.listdir() if "log.mcap" in one]


def test_nothing_is_run_because_a_log_names_it(tmp_path):
    mark, source = tmp_path / "ran", own(tmp_path, "Walls")
    log = Path(run(tmp_path, source).log)
    text = f"open({str(mark)!r}, 'w').close()\n" + (HERE / "predictors.py").read_text()
    (tmp_path / "mine.py").write_text(text)
    assert verify(log).verified
    assert make_card(read_case(open_log(log)), 12).unmeasured == (
        f"prediction {source}, guide ('walls 1')"
    )
    with pytest.raises(InputError, match="a fork runs it, and only the log names it; expected --s"):
        fork(log, 5, ["motion.speed_fraction=0.5"], tmp_path / "fork.mcap")
    assert not mark.exists()


def test_a_fork_runs_the_predictor_that_it_is_given(walls, tmp_path):
    source, result = walls
    log = Path(result.log)
    recorded = open_log(log).result["chain"]
    named = [f"prediction.source={source}"]
    assert fork(log, 7, named, tmp_path / "same.mcap").chain == recorded
    other = fork(log, 7, [f"prediction.source={own(tmp_path, 'Cells')}"], tmp_path / "other.mcap")
    assert other.chain != recorded
    off = fork(log, 7, ["prediction.policy=ignore"], tmp_path / "off.mcap")
    assert replay(Path(off.log)).identical
    assert simulate_again(Path(other.log)).identical
    assert len(predictions(off.log)) == 6
    with pytest.raises(InputError, match="expected a predictor from outside after one"):
        fork(log, 7, ["prediction.source=none"], tmp_path / "none.mcap")


def test_other_thresholds_are_asked_of_the_log_and_another_predictor_is_not(walls, tmp_path):
    log = Path(walls[1].log)
    assert what_if(log, ["prediction.free_below=0.001"]).faithful
    for setting in ("prediction.source=completion", "prediction.reach=5"):
        with pytest.raises(InputError, match="the log holds what the predictor said"):
            what_if(log, [setting])
    off = run(tmp_path, own(tmp_path, "Walls"), "prediction.policy=ignore", name="off")
    assert not predictions(off.log)
    assert off.chain == run(tmp_path, "none", name="none").chain
    with pytest.raises(InputError, match="the predictor was not run"):
        what_if(Path(off.log), ["prediction.policy=guide"])


def test_what_takes_longer_than_a_period_is_left_out_where_latencies_are_measured(tmp_path):
    source = own(tmp_path, "Slow")
    log = Path(run(tmp_path, source, "latency.mode=measured", "episode.time_limit=2").log)
    made = predictions(log)
    assert [one.sequence for one in made if one.late] == [
        one.sequence for one in made if one.sequence % 3 == 0
    ]
    assert not any(one.shape for one in made if one.late)
    assert any(one.shape for one in made)
    assert verify(log).verified
    modelled = run(tmp_path, source, "episode.time_limit=0.6", name="modelled")
    assert not any(one.late for one in predictions(modelled.log))


def test_a_log_with_another_prediction_does_not_replay(walls, tmp_path):
    from wayproof.harness.log.codec.container import walk
    from wayproof.harness.log.copy import write_copy
    from wayproof.harness.log.head import read_head

    log = Path(walls[1].log)
    head = read_head(walk(log, head_only=True), log, allow_plugins=True)
    before = {one.sequence: one for one in predictions(log)}

    def changed(messages):
        for message in messages:
            if isinstance(message, pb.Prediction) and message.sequence == 9:
                message.log_odds = before[8].log_odds
                message.shape[:] = before[8].shape
                message.first[:] = before[8].first
            yield message

    target = tmp_path / "changed.mcap"
    write_copy(target, head, changed(read_messages(log)), open_log(log).result)
    replayed = replay(target)
    assert not replayed.identical
    assert replayed.first_difference == 9
