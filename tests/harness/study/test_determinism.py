"""A study run again in other ways, and on a Ray cluster of two nodes: the same chains."""

from __future__ import annotations

import functools
import json
from dataclasses import replace

import pytest

from tests.harness.study.here import SMALL, run_here, run_in_processes, written
from wayproof.harness.cli.main import main
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build
from wayproof.harness.study.cluster import run_on_ray
from wayproof.harness.study.determinism import ARRANGEMENTS, certify, draw
from wayproof.harness.study.file import StudyFile, read_study
from wayproof.harness.study.plan import plan_episodes
from wayproof.harness.study.store import Store
from wayproof.harness.study.study import read_rows, run_study
from wayproof.harness.worker_pool import Bounds


def test_a_certificate_tells_of_a_chain_that_differs(tmp_path, capsys):
    """All are alike, until a finished log is replaced by that of another episode."""
    path, out = written(tmp_path, SMALL.replace("seeds = 2", "seeds = 1")), tmp_path / "out"
    study = read_study(path)
    [planned] = plan_episodes(study)
    store = Store(out)
    run_study(study, [planned], store, run_here, lambda done: None)
    words = ["study", path, "--out", str(out), "--jobs", "1", "--check-determinism", "--json"]
    assert main(words) == 0
    certificate = json.loads(capsys.readouterr().out)["determinism"]
    kept = json.loads((out / "determinism.json").read_text())
    assert certificate == kept
    assert kept["identical"]
    assert [one["arrangement"] for one in kept["reruns"]] == [one.name for one in ARRANGEMENTS]
    assert kept["versions"]["mujoco"]
    run_episode(build(replace(planned.config, seed=5)), store.log(planned.key))
    certificate = certify(
        "small", [planned], store, study.bounds, lambda done: None, arrangements=ARRANGEMENTS[:1]
    )
    assert not certificate.identical
    assert not json.loads((out / "determinism.json").read_text())["identical"]
    assert [one.chain for one in certificate.reruns] == [kept["reruns"][0]["chain"]]


def test_a_sample_has_some_of_every_arm() -> None:
    study = StudyFile(
        name="x",
        worlds=["empty", "office"],
        robots=["drone"],
        seeds=30,
        perturbations={"rate": [1.0]},
    )
    planned = plan_episodes(study)
    drawn = draw(planned, 8)
    assert len({one.key for one in drawn}) == 8
    assert [sum(one.arm == arm for one in drawn) for arm in {one.arm for one in planned}] == [2] * 4
    assert draw(list(reversed(planned)), 8) == drawn
    assert len(draw(planned[:3], 8)) == 3


@pytest.mark.large
@pytest.mark.filterwarnings("ignore::FutureWarning", "ignore::ResourceWarning")
def test_two_nodes_give_the_chains_of_one_machine(tmp_path):
    """Including an episode that cannot be built, which is a row and not the end."""
    ray = pytest.importorskip("ray")
    cluster_utils = pytest.importorskip("ray.cluster_utils")
    study = read_study(written(tmp_path))
    planned = plan_episodes(study)
    cluster = cluster_utils.Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    try:
        cluster.add_node(num_cpus=1)
        rows = {}
        for name, engine in {
            "ray": functools.partial(run_on_ray, address=cluster.address),
            "processes": run_in_processes,
        }.items():
            store = Store(tmp_path / name)
            bound = functools.partial(engine, workers=2, bounds=Bounds())
            result = run_study(study, planned, store, bound, lambda done: None)
            assert (result.missing, result.errors) == (0, 0)
            rows[name] = [row.chain for row in read_rows(planned, store)]
        assert rows["ray"] == rows["processes"]
    finally:
        ray.shutdown()
        cluster.shutdown()
