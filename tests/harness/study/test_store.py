"""Studies from outside: bounded before they are listed, no code run, no file name believed."""

import json
import re
import shutil
from pathlib import Path

import pytest

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
from wayproof.models.robots import custom

HEAD = 'name = "outside"\nworlds = ["empty"]\nrobots = ["drone"]\n'

TWO = HEAD + 'seeds = [1, 2]\n[set]\n"episode.time_limit" = 1\n"map.resolution" = 0.2\n'

SHORT = "episode.time_limit=1", "map.resolution=0.2"


def values(count):
    return str([round(0.1 + 0.001 * k, 3) for k in range(count)])


def axes(count, *names):
    return "seeds = 1\n[axes]\n" + "".join(f'"{name}" = {values(count)}\n' for name in names)


FOUR = (
    "costmap.localization_margin",
    "costmap.cost_range",
    "behaviour.blend_length",
    "motion.altitude_low",
)

TOO_MUCH = {
    "seeds": ("seeds = 100000000000\n", "100000000000 episodes, expected at most 100000"),
    "long seeds": ("seeds = " + "9" * 5000 + "\n", "Exceeds the limit"),
    "no seeds": ("seeds = -3\n", "seeds is empty"),
    "axes": (axes(200, *FOUR), "1600000000 arms, expected at most 5000"),
    "severities": (f"seeds = 1\n[perturbations]\nlatency = {values(6000)}\n", "6001 arms"),
    "both": (axes(60, *FOUR[:2]).replace("seeds = 1", "seeds = 100"), "360000 episodes"),
    "bytes": (f"seeds = 1\n# {'x' * 2**20}\n", "bytes, expected at most 1048576"),
    "depth": (f"seeds = {'[' * 50000}{']' * 50000}\n", "nested too deeply"),
}


@pytest.mark.parametrize("name", TOO_MUCH)
def test_a_study_is_bounded_before_it_is_listed(name, tmp_path, capsys):
    text, said = TOO_MUCH[name]
    path = tmp_path / "study.toml"
    path.write_text(HEAD + text)
    assert main(["study", str(path), "--out", str(tmp_path / "out")]) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert said in line
    assert not (tmp_path / "out").exists()


def test_the_folder_of_a_study_is_bounded_too(tmp_path):
    store = Store(tmp_path)
    document = {"name": "a", "worlds": ["empty"], "robots": ["drone"], "seeds": 10**11}
    store.study.write_text(json.dumps(document))
    with pytest.raises(InputError, match="100000000000 episodes"):
        store.read_study()
    store.study.write_text(json.dumps({**document, "seeds": 1}) + " " * 2**20)
    with pytest.raises(InputError, match="bytes, expected at most"):
        store.read_study()


SPEC = (Path(custom.__file__).parent / "examples" / "spot.toml").read_text()

CODE = {
    "set": 'seeds = 1\n[set]\n"planner.name" = "planted:Planner"\n',
    "axis": 'seeds = 1\n[axes]\n"planner.name" = ["astar", "planted:Planner"]\n',
    "stack": 'seeds = 1\nstacks = ["builtin", "planted:Stack"]\n',
    "stack setting": 'seeds = 1\n[set]\n"stack.name" = "exec:touch ran"\n',
    "robot": "seeds = 1\n",
    "text": 'seeds = 1\n[set]\n"robot_file" = "controller = \'planted:Controller\'"\n',
}


@pytest.mark.parametrize("name", CODE)
def test_a_study_file_runs_no_code(name, tmp_path, capsys, monkeypatch):
    (tmp_path / "planted.py").write_text("open('ran', 'w').close()\n")
    (tmp_path / "robot.toml").write_text(
        re.sub('controller = ".*"', 'controller = "planted:Controller"', SPEC)
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    text = (HEAD + CODE[name]).replace('"drone"', '"robot.toml"' if name == "robot" else '"drone"')
    (tmp_path / "study.toml").write_text(text)
    assert main(["study", "study.toml", "--out", "out"]) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert "expected --allow-plugins" in line
    assert not (tmp_path / "ran").exists()
    assert not (tmp_path / "out").exists()
    assert read_study("study.toml", allow_plugins=True).name == "outside"


@pytest.fixture
def finished(tmp_path, recorded):
    """A study of two episodes, and its folder with both logs."""
    path = tmp_path / "study.toml"
    path.write_text(TWO)
    study = read_study(str(path))
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
