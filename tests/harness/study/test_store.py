"""Logs in the folder of a study: no file name is believed."""

import json
import re
import shutil
from pathlib import Path

import pytest

from tests.harness.study.here import BRIEF, HEAD, written
from wayproof.harness.cli.main import main
from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log
from wayproof.harness.study.contents import contents_of, named_by
from wayproof.harness.study.file import files_of, read_study
from wayproof.harness.study.matching import mismatch
from wayproof.harness.study.plan import CLEAN, Arm, plan_episodes, planned_for
from wayproof.harness.study.store import Store, merge
from wayproof.harness.study.study import read_own_rows, read_rows

SHORT = "episode.time_limit=1", "map.resolution=0.2"


@pytest.fixture
def finished(tmp_path, recorded):
    """A study of two episodes, and its folder with both logs."""
    study = read_study(written(tmp_path, f"{HEAD}seeds = [1, 2]{BRIEF}"))
    store = Store(tmp_path / "out")
    planned = plan_episodes(study)
    with store.open():
        for one in planned:
            result = recorded("empty", "drone", one.seed, *SHORT)
            shutil.copyfile(result.log, store.log(one.key))
        store.keep_study(study, contents_of(files_of(study)))
    return store, planned


def test_a_log_is_of_the_episode_that_its_config_says(finished, recorded, capsys):
    """Neither another one's log nor a second copy of one counts, whatever its name."""
    store, planned = finished
    first, second = (store.log(one.key) for one in planned)
    assert [one.seed for one in read_rows(planned, store)] == [1, 2]
    shutil.copyfile(first, second)
    rows, foreign = read_own_rows(planned, store)
    assert [one.seed for one in rows] == [1]
    [line] = foreign
    assert str(second) in line
    assert "seed: got 1, expected 2" in line
    with pytest.raises(InputError, match="seed: got 1, expected 2"):
        read_rows(planned, store)
    shutil.copyfile(
        recorded("empty", "drone", 1, "episode.time_limit=0.5", "map.resolution=0.2").log, first
    )
    shutil.copyfile(recorded("empty", "drone", 2, *SHORT).log, second)
    assert main(["report", str(store.folder)]) == 0
    out = capsys.readouterr().out
    assert "episode.time_limit: got 0.5, expected 1" in out
    assert "in place of 1 of these lie logs of other episodes" in out
    assert main(["study", str(store.folder.parent / "study.toml"), "--out", str(store.folder)]) == 3
    assert "episode.time_limit: got 0.5, expected 1" in capsys.readouterr().out
    assert main(["compare", str(store.folder), str(store.folder), "--json"]) == 3
    assert len(json.loads(capsys.readouterr().out)["foreign"]) == 2


def test_limits_of_the_robot_are_those_that_its_world_asks_for(finished, recorded):
    """A plan leaves them to the world, and a log says which they were."""
    store, planned = finished
    assert planned[1].config.motion.limits == "auto"
    store.log(planned[1].key).unlink()
    slow = recorded("empty", "drone", 2, *SHORT, "motion.limits=cautious").log
    shutil.copyfile(slow, store.log(planned[1].key))
    rows, foreign = read_own_rows(planned, store)
    assert [one.seed for one in rows] == [1]
    [line] = foreign
    assert "motion.limits: got cautious, expected auto" in line
    moving = Arm("crossing", "drone", "", CLEAN, 0.0)
    config = override(Config("crossing", "drone", 0), SHORT)
    one = planned_for(moving, config, contents_of(named_by(config)))
    for settings, said in (((), ""), (("motion.limits=full",), "got full, expected auto")):
        log = open_log(Path(recorded("crossing", "drone", 0, *SHORT, *settings).log))
        assert mismatch(log, one).endswith(said)
        assert bool(mismatch(log, one)) == bool(said)


def test_a_study_of_logs_of_other_episodes_alone_has_not_run(finished, recorded, capsys):
    store, planned = finished
    for one in planned:
        other = recorded("empty", "drone", one.seed, "episode.time_limit=0.5")
        shutil.copyfile(other.log, store.log(one.key))
    (store.folder / "table.parquet").write_bytes(b"of the run before")
    assert main(["study", str(store.folder.parent / "study.toml"), "--out", str(store.folder)]) == 3
    captured = capsys.readouterr()
    assert "2 of 2 have not run; in place of 2 of these lie logs of other" in captured.out
    assert not (store.folder / "table.parquet").exists()


def test_another_goal_or_lidar_is_another_episode(finished, recorded):
    """A log has what a run fills in also as it was asked for."""
    store, planned = finished
    for settings, said in (
        (("goal=[6.0,6.0]",), r"goal: got .*6.*, expected None"),
        (("sensors.lidar=velodyne-vlp16",), "sensors.lidar: got velodyne-vlp16, expected "),
    ):
        log = recorded("empty", "drone", 1, *SHORT, *settings).log
        shutil.copyfile(log, store.log(planned[0].key))
        _, [line] = read_own_rows(planned, store)
        assert re.search(said, line)


def test_merging_takes_no_log_under_a_wrong_name(finished, tmp_path):
    store, planned = finished
    other = tmp_path / "other" / "logs"
    other.mkdir(parents=True)
    before = [one.read_bytes() for one in sorted(store.logs.iterdir())]
    for name, said in (("0" * 24, "named by no episode"), (planned[1].key, "seed: got 1")):
        (target := Store(tmp_path / f"target-{name}")).logs.mkdir(parents=True)
        path = other / f"{name}.mcap"
        shutil.copyfile(store.log(planned[0].key), path)
        with pytest.raises(InputError, match=said):
            merge(target, [other.parent], planned)
        assert not list(target.logs.iterdir())
        path.unlink()
    assert [one.read_bytes() for one in sorted(store.logs.iterdir())] == before


def test_a_forked_log_is_no_episode_of_a_study(finished, tmp_path, recorded):
    """Its last config may be the one planned; its first decisions followed another one."""
    store, planned = finished
    log = recorded("empty", "drone", 1, *SHORT, "map.memory_mib=300").log
    fork = tmp_path / "fork.mcap"
    main(["replay", "fork", log, "3", "--set", "map.memory_mib=301", "--log", str(fork)])
    shutil.copyfile(fork, store.log(planned[0].key))
    _, [line] = read_own_rows(planned, store)
    assert "forked at decision 3" in line
