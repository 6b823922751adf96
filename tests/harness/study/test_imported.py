import json
import math

import pytest

from tests.harness.study.benchmark_files import barn_folder, field_folder
from wayproof.harness.cli.main import main
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.log.reader import open_log
from wayproof.harness.replay.audit import audit
from wayproof.harness.replay.replay import replay
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.study.file import read_study
from wayproof.harness.study.plan import plan_episodes
from wayproof.harness.study.store import Store
from wayproof.models.robots import ROBOTS


@pytest.fixture
def here(tmp_path, monkeypatch):
    """The current folder, in which world files are written."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def planned(name, folder, *settings):
    study = read_study(name, settings=[f"import.folder={folder}", *settings])
    return study, plan_episodes(study)


def test_worlds_of_barn_have_their_published_way(here):
    study, (first, *_) = planned("barn", barn_folder(here, gap=1.6), "seeds=2")
    assert study.worlds == ["worlds/barn/world_7.xml"]
    scenario = build(first.config)
    by_hand = math.hypot(0.075, 2.075) + 4.5 + math.hypot(0.075, 3.425)
    assert scenario.route_length() == pytest.approx(by_hand, abs=1e-4)
    assert scenario.mission.start[:2] == (-2.25, 3.0)
    assert scenario.mission.goal[:2] == (-2.25, 13.0)
    spec = ROBOTS["quadruped"].spec
    least = min(radius for _, radius in spec.discs)
    cell = first.config.map.resolution
    assert 5 * cell <= least < 5 * (cell + 0.01)
    assert first.config.costmap.localization_margin == pytest.approx(cell / math.sqrt(2), abs=1e-4)


@pytest.mark.large
def test_a_long_body_goes_through_a_gap_in_which_it_cannot_turn(here):
    """As a disc where that leads on, as its discs in the gap; and the audit agrees."""
    _, (one,) = planned("barn", barn_folder(here, gap=1.0), "seeds=[1]")
    result = run_episode(build(one.config), here / "a.mcap")
    assert (result.outcome, result.collisions) == ("success", 0)
    decisions = [m for m in read_messages(here / "a.mcap") if isinstance(m, pb.Decision)]
    slender, wide = sorted({round(decision.inflation_radius_m, 6) for decision in decisions})
    assert wide - slender == pytest.approx(0.245)
    found = audit(here / "a.mcap")
    assert found.violations == ()
    assert found.swept > 50
    assert replay(here / "a.mcap").identical


@pytest.mark.usefixtures("in_this_process")
def test_a_stack_on_trial_drives_in_barn_and_is_scored(here, capsys):
    folder = barn_folder(here, gap=3.0)
    words = ["study", "barn", "--set", f"import.folder={folder}", "--set", "seeds=1", "--jobs", "1"]
    words += ["--set", "stacks=blind", "--set", 'gates=["barn_score.mean >= 0.4"]', "--out", "out"]
    words += ["--set", "episode.time_limit=1"]
    assert main([*words, "--allow-inconclusive", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    (arm,) = document["arms"]
    assert (arm["outcomes"], arm["metrics"]["barn_score"]) == ({"timeout": 1}, 0.0)
    (log,) = (here / "out" / "logs").glob("*.mcap")
    assert open_log(log).config.stack.name == "blind"
    assert Store(here / "out").read_study().worlds == ["worlds/barn/world_7.xml"]
    assert main(["report", "out"]) == 0
    page = (here / "out" / "report.html").read_text()
    assert f"wayproof study barn --set import.folder={folder}" in page


def test_flights_begin_and_end_in_free_places_of_their_seed(here):
    study, episodes = planned("dodge", field_folder(here), "seeds=6")
    world = study.worlds[0]
    ends = [study.imports.ends[world][seed] for seed in range(6)]
    assert ends == [(one.config.start, one.config.goal) for one in episodes]
    assert len({start for start, _ in ends}) == 6
    for start, goal in ends:
        assert (start[:2], goal[:2]) == ((0.0, 0.0), (18.0, 0.0))
        assert 2.0 <= start[2] == goal[2] <= 8.0
    scenario = build(episodes[0].config)
    assert len(scenario.world.solids) == 1  # the other is put away far outside


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ([], "study 'barn': expected --set import.folder=DIR"),
        (["import.folder=nowhere"], "import.folder: no 'world_*.world' in 'nowhere'"),
        (["import.folder=.", "worlds=office"], "study 'barn': [import] is for one robot"),
    ],
)
def test_a_folder_that_cannot_be_taken_is_refused_in_a_line(here, capsys, settings, said):
    words = [word for one in settings for word in ("--set", one)]
    assert main(["study", "barn", *words]) == 2
    assert said in capsys.readouterr().err


def test_a_way_that_is_none_is_refused(here, capsys):
    folder = barn_folder(here, gap=1.6)
    (folder / "path_7.npy").write_bytes(b"no array")
    assert main(["study", "barn", "--set", f"import.folder={folder}"]) == 2
    assert "path_7.npy: " in capsys.readouterr().err
