import json

import pytest

from tests.harness.study.benchmark_files import field_folder
from wayproof.harness.cli.main import main
from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log
from wayproof.harness.recompute.rebuild import rebuild
from wayproof.harness.replay.replay import replay
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build
from wayproof.models.world_files import ImportOptions


def test_a_log_holds_the_world_of_its_file(tmp_path, capsys):
    field_folder(tmp_path)
    out = tmp_path / "field.xml"
    command = ["import", str(tmp_path / "easy_0.csv"), "--out", str(out), "--json"]
    assert main([*command, "--start", "0,0", "--goal", "12,0"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["notes"] == ["1 spheres more than 500 m away: left out"]
    config = override(
        Config(str(out), "drone", 5), ["episode.time_limit=1.0", "motion.altitude_high=6"]
    )
    first = run_episode(build(config), tmp_path / "first.mcap")
    log = open_log(tmp_path / "first.mcap")
    assert log.config.world == document["name"]
    out.unlink()  # neither a replay nor another run needs it
    assert replay(tmp_path / "first.mcap").identical
    again = run_episode(rebuild(log), tmp_path / "again.mcap")
    assert again.chain == first.chain
    with pytest.raises(InputError, match="was read from a file: expected the file, or a log"):
        build(log.config)


def test_the_help_names_the_defaults_of_the_options(capsys):
    with pytest.raises(SystemExit):
        main(["import", "--help"])
    document = " ".join(capsys.readouterr().out.split())
    own = ImportOptions()
    for value in (own.height, own.resolution, own.scale, own.unknown):
        text = value if isinstance(value, str) else f"{value:g}"
        assert f"(default: {text})" in document
