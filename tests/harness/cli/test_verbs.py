"""What holds for each verb: help that teaches, quiet pipes, one document; `list` and `import`."""

import json
import shlex
import shutil
import subprocess
import sys

import pytest

from tests.harness.study.benchmark_files import field_folder
from wayproof.harness.cli import COMMANDS
from wayproof.harness.cli.main import main, parse, parser_of
from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log
from wayproof.harness.recompute.rebuild import rebuild
from wayproof.harness.replay.replay import replay
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build
from wayproof.models.world_files import ImportOptions

WRONG = {
    "run": ["nowhere", "--robot", "drone", "--seed", "1"],
    "study": ["no-such-study"],
    "report": ["no-such-folder"],
    "compare": ["no-such-folder", "nor-this"],
    "bench": ["no-such-stage"],
    "list": ["surplus"],
    "import": ["no-such-file.stl"],
    "import robot": ["no-such-file.toml"],
    "replay what-if": ["no-such.mcap", "--set", "map.resolution=0.2"],
    "replay fork": ["no-such.mcap", "3"],
    "export": ["no-such.mcap", "--csv", "x.csv"],
}
"""Words after each verb that it must refuse; the others take a log."""


@pytest.mark.parametrize("verb", COMMANDS)
def test_the_example_is_one_of_its_own_lines(verb):
    program, *words = shlex.split(COMMANDS[verb].example)
    assert program == "wayproof"
    named = parse(words).verb
    assert named == verb or f"wayproof {verb} " in COMMANDS[verb].example  # `serve` is in a `run`


@pytest.mark.parametrize("verb", COMMANDS)
def test_help_teaches_by_example_and_a_pipe_gets_no_colours(capsys, verb):
    with pytest.raises(SystemExit) as end:
        main([*verb.split(), "--help"])
    assert end.value.code == 0
    shown = capsys.readouterr()
    assert COMMANDS[verb].example in shown.out
    assert "\x1b" not in shown.out
    assert shown.err == ""


@pytest.mark.parametrize("verb", COMMANDS)
def test_every_argument_says_what_it_is_for(verb):
    obvious = {"log", "help", "json"}
    for action in parser_of(verb)._actions:
        assert action.help or action.dest in obvious, f"{verb}: {action.dest}"


@pytest.mark.parametrize("verb", COMMANDS)
def test_bad_input_is_one_document_on_stdout_and_one_line_on_stderr(
    capsys, monkeypatch, tmp_path, verb
):
    monkeypatch.chdir(tmp_path)
    assert main([*verb.split(), *WRONG.get(verb, ["no-such.mcap"]), "--json"]) == 2
    shown = capsys.readouterr()
    assert set(json.loads(shown.out)) == {"error"}
    assert shown.out.count("\n") == 1
    assert shown.err.count("\n") == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "words",
    [
        ["replay"],
        ["audit"],
        ["replay simulate"],
        ["explain", "--metrics"],
        ["view", "--save", "x.rrd"],
        ["export", "--foxglove", "x.mcap"],
        ["export", "--csv", "x.csv", "--tum", "x.tum"],
        ["explain"],
        ["explain", "3", "--png", "x.png"],
        ["list"],
    ],
    ids=lambda words: words[0],
)
def test_good_input_is_one_document_and_nothing_else(capfd, monkeypatch, tmp_path, recorded, words):
    verb, *more = words
    paths = [] if verb == "list" else [recorded("empty", "drone", 1).log]
    monkeypatch.chdir(tmp_path)
    assert main([*verb.split(), *paths, *more, "--json"]) == 0
    shown = capfd.readouterr()
    assert isinstance(json.loads(shown.out), dict)
    assert shown.out.count("\n") == 1
    assert shown.err == ""


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["wayproof", "re"], {"replay", "report"}),
        (["wayproof", "run", "ware"], {"warehouse"}),
        (["wayproof", "run", "warehouse", "--robot", "q"], {"quadruped"}),
        (["wayproof", "run", "warehouse", "--perturb", "pose_jump", ":"], {"1"}),
        (["wayproof", "run", "warehouse", "--set", "map.r"], {"map.resolution="}),
        (["wayproof", "run", "warehouse", "--set", "planner.name", "="], {"astar", "rrtstar"}),
        (["wayproof", "run", "warehouse", "--set", "planner.name", "=", "as"], {"astar"}),
        (["wayproof", "study", "s"], {"smoke", "stacks"}),
        (["wayproof", "bench", "r"], {"rays"}),
        (["wayproof", "replay", ""], {"d.mcap"}),
        (["wayproof", "replay", "wh"], {"what-if"}),
        (["wayproof", "replay", "fork", ""], {"d.mcap"}),
        (["wayproof", "view", "x.mcap", "--sa"], {"--save"}),
    ],
)
def test_bash_completes(capsys, monkeypatch, tmp_path, words, expected):
    """Bash passes words broken at = and :, and replaces only what follows the last of them."""
    bash = shutil.which("bash")
    if bash is None:
        pytest.skip("no bash here")
    assert main(["--completion", "bash"]) == 0
    monkeypatch.chdir(tmp_path)
    (tmp_path / "d.mcap").touch()
    (tmp_path / "d.txt").touch()
    script = tmp_path / "complete.bash"
    script.write_text(capsys.readouterr().out)
    typed = shlex.join(words)
    ask = f"COMP_WORDS=({typed}); COMP_CWORD={len(words) - 1}; _wayproof_words_joined"
    command = f"source {script}; {ask}; echo ${{COMPREPLY[@]}}"
    shown = subprocess.run([bash, "-c", command], capture_output=True, text=True, check=True)
    found = set(shown.stdout.split())
    assert expected <= found
    assert "d.txt" not in found


def test_fish_completes(capsys, tmp_path):
    assert main(["--completion", "fish"]) == 0
    script = capsys.readouterr().out
    assert "map.resolution=" in script
    fish = shutil.which("fish")
    if fish is None:
        pytest.skip("no fish here; apt-get install fish")
    (tmp_path / "complete.fish").write_text(script)
    ask = f"source {tmp_path}/complete.fish; complete -C 'wayproof run ware'"
    shown = subprocess.run([fish, "-c", ask], capture_output=True, text=True, check=True)
    assert "warehouse" in shown.stdout


def listed(capsys, *words):
    assert main(["list", *words, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_a_section_has_its_settings_alone(capsys):
    found = listed(capsys, "costmap")
    assert list(found) == ["settings"]
    assert all(name.startswith("costmap.") for name in found["settings"])


def test_a_name_of_two_kinds_has_both(capsys):
    assert set(listed(capsys, "pose_drift")) == {"perturbations", "studies"}


def test_a_severity_has_its_amount_and_unit(capsys):
    found = listed(capsys, "pose_jump")["perturbations"]["pose_jump"]
    assert (found["amounts"], found["unit"]) == ([0.03, 0.1, 0.3, 0.8, 1.4], "m")


def test_a_setting_is_printed_with_default_bounds_and_source(capsys):
    assert main(["list", "map.resolution"]) == 0
    shown = capsys.readouterr().out
    for text in ("Edge of a cell, m.", "0.1", "0.01 to 0.5", "maps/config.py"):
        assert text in shown


@pytest.mark.parametrize(
    "words", [["list", "--json"], ["run", "--help"], ["view", "--help"], ["--help"]]
)
def test_listing_and_help_load_nothing_heavy(words):
    code = (
        "import sys\nfrom wayproof.harness.cli.main import main\n"
        "try:\n    main(sys.argv[1:])\nexcept SystemExit:\n    pass\n"
        "heavy = {'numba', 'numpy', 'scipy', 'mujoco', 'ompl', 'rerun', 'PIL'} & set(sys.modules)\n"
        "assert not heavy, heavy"
    )
    subprocess.run([sys.executable, "-c", code, *words], check=True, capture_output=True)


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
