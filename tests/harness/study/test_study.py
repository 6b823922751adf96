"""Studies: planned whole, run in processes, resumed, merged."""

from __future__ import annotations

import functools
import json
import os
import signal
import threading
import time
from pathlib import Path

import pytest

from tests.harness.study.here import HEAD, SMALL, refuse, run_here, run_in_processes, written
from wayproof.harness.cli.main import main
from wayproof.harness.config_document import to_json
from wayproof.harness.errors import InputError
from wayproof.harness.log.codec.container import walk
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.log.copy import write_copy
from wayproof.harness.log.head import read_head
from wayproof.harness.log.reader import open_log
from wayproof.harness.study.analysis import NOTHING_RAN
from wayproof.harness.study.contents import contents_of
from wayproof.harness.study.file import files_of, read_study
from wayproof.harness.study.job import Done, Job, run_job
from wayproof.harness.study.plan import plan_episodes
from wayproof.harness.study.result import StudyResult
from wayproof.harness.study.store import Store, merge
from wayproof.harness.study.study import count_missing, read_rows, run_study, shard
from wayproof.harness.worker_pool import Bounds
from wayproof.models.world_files.options import Ends, Found
from wayproof.models.world_files.world_file import world_text

ENDS = Ends((-3.0, -3.0, -0.5), (3.0, 3.0, 3.0), (-2.0, 0.0, 0.0), 0.0, (2.0, 0.0, 0.0))


SHORT = SMALL.replace("seeds", 'gates = ["success.drop <= 0"]\nseeds')
SHORT += '[axes]\n"costmap.unknown_policy" = ["forbid", "allow"]\n'

Engine = functools.partial(run_in_processes, workers=2, bounds=Bounds())


def run(folder: Path, text: str = SHORT, engine: object = Engine) -> StudyResult:
    study = read_study(written(folder, text))
    done: list[Done] = []
    store = Store(folder / "out")
    return run_study(study, plan_episodes(study), store, engine, done.append)  # type: ignore[arg-type]


def chains(folder: Path, text: str = SHORT) -> dict[str, str]:
    planned = plan_episodes(read_study(written(folder, text)))
    return {row.key: row.chain for row in read_rows(planned, Store(folder / "out"))}


def test_a_plan_crosses_everything_and_keys_tell_episodes_apart(tmp_path: Path) -> None:
    study = read_study(written(tmp_path, SHORT.replace('["empty"]', '["empty", "corridor"]')))
    planned = plan_episodes(study)
    assert len(planned) == 2 * 2 * 2
    assert len({one.key for one in planned}) == len(planned)
    assert [one.seed for one in planned] == sorted(one.seed for one in planned)
    assert {one.config.costmap.unknown_policy for one in planned} == {"forbid", "allow"}
    assert all(one.config.episode.time_limit == 1.0 for one in planned)


def test_shards_are_a_partition_that_keeps_twins_together(tmp_path: Path) -> None:
    planned = plan_episodes(read_study(written(tmp_path, SHORT.replace("seeds = 2", "seeds = 7"))))
    parts = [shard(planned, f"{i}/3") for i in (1, 2, 3)]
    placed = [planned.index(one) for part in parts for one in part]
    assert sorted(placed) == list(range(len(planned)))
    seeds = [{one.seed for one in part} for part in parts]
    assert not (seeds[0] & seeds[1] | seeds[1] & seeds[2] | seeds[0] & seeds[2])


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study that ran through, in this process."""
    folder = tmp_path_factory.mktemp("undisturbed")
    result = run(folder, engine=run_here)
    assert (result.episodes, result.missing, result.errors) == (4, 0, 0)
    return folder


def test_a_finished_study_runs_nothing_again(undisturbed: Path) -> None:
    assert run(undisturbed, engine=refuse).missing == 0
    assert (undisturbed / "out" / "table.parquet").is_file()


def test_what_is_missing_is_run_and_comes_out_the_same(undisturbed: Path, tmp_path: Path) -> None:
    before = chains(undisturbed)
    lost = next(iter(before))
    Store(undisturbed / "out").log(lost).unlink()
    ran: list[str] = []

    def engine(jobs: list[Job], stacks: list[bytes], finished: object) -> None:
        ran.extend(job.key for job in jobs)
        run_here(jobs, stacks, finished)  # type: ignore[arg-type]

    run(undisturbed, engine=engine)
    assert ran == [lost]
    assert chains(undisturbed) == before


@pytest.mark.large
def test_killed_workers_cost_nothing_but_time(undisturbed: Path, tmp_path: Path) -> None:
    """One at its start, one in the midst: the study ends as the undisturbed one did."""
    stop = threading.Event()
    logs = tmp_path / "out" / "logs"

    def kill() -> None:
        for finished in (0, 1):
            while not stop.wait(0.02):
                workers = worker_processes()
                if workers and len(list(logs.glob("*.mcap"))) >= finished:
                    os.kill(workers[0], signal.SIGKILL)
                    break

    killer = threading.Thread(target=kill)
    killer.start()
    try:
        result = run(tmp_path)
    finally:
        stop.set()
        killer.join()
    assert result.errors == 0
    assert chains(tmp_path) == chains(undisturbed)


def worker_processes() -> list[int]:
    """Spawned children of this process that run jobs."""
    found = []
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        try:
            parent = int((entry / "stat").read_text().rsplit(")", 1)[1].split()[1])
            command = (entry / "cmdline").read_bytes()
        except OSError:
            continue
        if parent == os.getpid() and b"spawn_main" in command:
            found.append(int(entry.name))
    return found


def test_a_broken_episode_is_a_row_and_not_the_end(tmp_path: Path) -> None:
    """The goal lies outside the geofence for one variant alone."""
    axis = '"costmap.unknown_policy" = ["forbid", "allow"]'
    text = SHORT.replace(axis, "goal = [[6, 6, 1.2], [500, 0, 1.2]]")
    result = run(tmp_path, text.replace("seeds = 2", "seeds = 1"), engine=run_here)
    assert (result.missing, result.errors) == (0, 1)
    broken = result.arms[1]
    assert broken.outcomes == {"error": 1}
    assert broken.success.estimate == 0.0
    planned = plan_episodes(read_study(str(tmp_path / "study.toml")))
    [row] = [one for one in read_rows(planned, Store(tmp_path / "out")) if one.outcome == "error"]
    assert "expected inside the geofence" in row.reason


def test_an_error_of_the_machine_is_tried_again_and_no_failure_of_its_arm(tmp_path: Path) -> None:
    text = SHORT.replace("seeds = 2", "seeds = 1")
    tried: list[str] = []

    def full(jobs, stacks, finished):
        for job in jobs:
            finished(Done(job.key, "the disk is full", of_machine=True))

    def short_of_memory(jobs, stacks, finished):
        for job in jobs:
            tried.append(job.key)
            lacks = tried.count(job.key) < 3
            finished(Done(job.key, "no memory", of_machine=True) if lacks else run_job(job))

    keys = [one.key for one in plan_episodes(read_study(written(tmp_path, text)))]
    stuck = run(tmp_path, text, engine=full)
    assert (stuck.verdict, stuck.errors, stuck.gates[0].worlds) == ("incomplete", 2, 0)
    assert stuck.arms[0].success == NOTHING_RAN
    assert run(tmp_path, text, engine=short_of_memory).errors == 0
    assert sorted(tried) == sorted(keys * 3)


def test_time_is_bounded_and_its_excess_a_failure_of_the_arm(tmp_path: Path) -> None:
    bounds = Bounds(wall_s=0.3, memory_mib=4096)
    bounded = functools.partial(run_in_processes, workers=1, bounds=bounds)
    long = f"{HEAD}seeds = 1\n".replace("empty", "warehouse")
    result = run(tmp_path, long, engine=bounded)  # it takes many times as long
    assert (result.errors, result.arms[0].outcomes) == (1, {"error": 1})
    assert result.arms[0].success.estimate == 0.0  # no fault of the machine


def test_a_folder_takes_one_run_at_a_time(tmp_path: Path) -> None:
    store = Store(tmp_path)
    with store.open(), pytest.raises(InputError, match="another run"), Store(tmp_path).open():
        pass


def test_merging_takes_what_is_new_and_refuses_two_truths(undisturbed, tmp_path):
    whole = Store(undisturbed / "out")
    keys = sorted(chains(undisturbed))
    part = tmp_path / "part"
    (part / "logs").mkdir(parents=True)
    for key in keys[:2]:
        (part / "logs" / f"{key}.mcap").write_bytes(whole.log(key).read_bytes())
    target = Store(tmp_path / "target")
    planned = plan_episodes(read_study(str(undisturbed / "study.toml")))
    with target.open():
        assert merge(target, [part, undisturbed / "out"], planned) == 4
        assert count_missing(planned, target) == 0
        assert merge(target, [part], planned) == 0
        _spoil_chain(part / "logs" / f"{keys[0]}.mcap")
        with pytest.raises(InputError, match="two different results"):
            merge(target, [part], planned)


def _spoil_chain(path: Path) -> None:
    head = read_head(walk(path), path, allow_plugins=False)
    result = {**open_log(path).result, "chain": "0" * 32}
    write_copy(path, head, read_messages(path), result)


@pytest.mark.large
def test_a_parent_that_is_killed_takes_its_workers_along(tmp_path: Path) -> None:
    """And the next run finishes the study."""
    import subprocess
    import sys

    command = [sys.executable, "-m", "wayproof", "study", written(tmp_path), "--jobs", "2"]
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[3] / "src")}
    process = subprocess.Popen(
        [*command, "--out", str(tmp_path / "out"), "--json"],
        env=environment,
        stdout=subprocess.DEVNULL,
    )
    logs = tmp_path / "out" / "logs"
    while not list(logs.glob("*.mcap")) and process.poll() is None:
        time.sleep(0.05)
    process.kill()
    process.wait()
    time.sleep(0.5)
    left = sorted(path.name for path in logs.glob("*.mcap"))
    time.sleep(0.5)
    assert sorted(path.name for path in logs.glob("*.mcap")) == left  # nobody writes any more
    assert 1 <= len(left)
    assert run(tmp_path, engine=run_here).missing == 0


def test_a_key_holds_what_a_file_holds_and_not_where_it_lies(tmp_path: Path) -> None:
    paths = [tmp_path / "room.xml", tmp_path / "elsewhere" / "room.xml"]
    paths[1].parent.mkdir()
    text = world_text(Found(), ENDS, "room")
    for path in paths:
        path.write_text(text)
    keys = [planned_keys(tmp_path, path) for path in paths]
    assert keys[0] == keys[1]
    paths[0].write_text(text.replace("0 0 -9.81", "0 0 -9.80"))
    assert planned_keys(tmp_path, paths[0]) != keys[0]
    with pytest.raises(InputError, match="no such file"):
        planned_keys(tmp_path, tmp_path / "none.xml")


def planned_keys(folder: Path, world: Path) -> list[str]:
    text = SHORT.replace('["empty"]', json.dumps([str(world)]))
    return [one.key for one in plan_episodes(read_study(written(folder, text)))]


def test_a_file_that_changes_after_the_plan_is_not_run(tmp_path: Path) -> None:
    path = tmp_path / "room.xml"
    path.write_text(world_text(Found(), ENDS, "room"))
    text = SHORT.replace('["empty"]', json.dumps([str(path)]))
    [one, *_] = plan_episodes(read_study(written(tmp_path, text)))
    path.write_text(path.read_text().replace("0 0 -9.81", "0 0 -9.80"))
    done = run_job(Job(one.key, to_json(one.config), tmp_path / "log.mcap"))
    assert "was changed since" in done.error
    assert not (tmp_path / "log.mcap").exists()


def test_a_folder_remembers_what_its_files_held(tmp_path: Path) -> None:
    """So it is reported where they are no more."""
    path = tmp_path / "room.xml"
    path.write_text(world_text(Found(), ENDS, "room"))
    text = SHORT.replace('["empty"]', json.dumps([str(path)]))
    study = read_study(written(tmp_path, text))
    keys = [one.key for one in plan_episodes(study)]
    store = Store(tmp_path)
    store.keep_study(study, contents_of(files_of(study)))
    path.unlink()
    assert [one.key for one in plan_episodes(store.read_study(), store.read_contents())] == keys


def test_ctrl_c_says_what_a_study_has_kept(tmp_path, monkeypatch, capsys):
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    file = written(tmp_path, SHORT)
    store = Store(tmp_path / "kept")
    store.logs.mkdir(parents=True)
    store.log(plan_episodes(read_study(file))[0].key).touch()
    monkeypatch.setattr("wayproof.harness.study.study.run_study", interrupted)
    assert main(["study", file, "--out", str(store.folder)]) == 130
    message = "interrupted; 1 of 4 episodes are kept, and the same command runs the others"
    assert message in capsys.readouterr().err
