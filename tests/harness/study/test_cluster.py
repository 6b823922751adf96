"""The same study on a Ray cluster of two nodes."""

from __future__ import annotations

import functools
from pathlib import Path

import pytest

from tests.harness.study.here import run_in_processes
from wayproof.harness.study.cluster import run_on_ray
from wayproof.harness.study.file import read_study
from wayproof.harness.study.plan import plan_episodes
from wayproof.harness.study.store import Store
from wayproof.harness.study.study import read_rows, run_study
from wayproof.harness.worker_pool import Bounds

STUDY = """
name = "cluster"
worlds = ["empty"]
robots = ["drone"]
seeds = 2
[set]
"episode.time_limit" = 1
"map.resolution" = 0.2
"""


@pytest.mark.large
@pytest.mark.filterwarnings("ignore::FutureWarning", "ignore::ResourceWarning")
def test_two_nodes_give_the_chains_of_one_machine(tmp_path: Path) -> None:
    """Including an episode that cannot be built, which is a row and not the end."""
    ray = pytest.importorskip("ray")
    cluster_utils = pytest.importorskip("ray.cluster_utils")
    path = tmp_path / "study.toml"
    path.write_text(STUDY)
    study = read_study(str(path))
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
