import json

import pytest

from wayproof.harness.bench.stages import STAGES
from wayproof.harness.cli.main import main

NAMES = ", ".join(sorted(STAGES))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["bench", "ray"], f"unknown stage 'ray'; did you mean 'rays'? (available: {NAMES})"),
        (["bench", "nothing"], f"unknown stage 'nothing' (available: {NAMES})"),
        (["bench"], "the following arguments are required: STAGE"),
        (["bench", "rays", "--repeats", "0"], "repeats: got 0, expected 1 to 1000"),
        (["bench", "rays", "--seed", "-1"], "seed: got -1"),
        (
            ["bench", "rays", "--stack", "gap"],
            "--stack: got bench rays, expected one of: barn, dodge",
        ),
        (["study", "smoke", "--stack", "gap"], "--stack, --guard: expected --worlds"),
        (["study", "barn", "--worlds", ".", "--guard"], "--guard: expected --stack"),
    ],
)
def test_bad_words_are_refused_in_one_line(capsys, arguments, said):
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert said in captured.err


def test_one_part_alone(capsys):
    assert main(["bench", "robots", "--repeats", "1", "--only", "hover", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [(row["robot"], row["case"], row["runs"]) for row in rows] == [("drone", "hover", 1)]
    assert main(["bench", "map", "--only", "hover"]) == 2
    assert "unknown part of bench map 'hover' (available: accuracy, " in capsys.readouterr().err
    assert main(["bench", "rays", "--only", "hover"]) == 2
    assert (
        "--only: got bench rays, expected one of: coverage, halls, loop, map, odometry, robots"
        in capsys.readouterr().err
    )
