"""Registry of published benchmarks and their options."""

import pytest

from wayproof.harness.bench.published import BENCHMARKS
from wayproof.harness.cli.main import main


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["bench", "barn"], "bench barn: expected --worlds with the path of its files"),
        (["bench", "rays", "--worlds", "x"], "unknown stage with --worlds 'rays'"),
        (["bench", "barn", "--worlds", "nowhere"], "--worlds: no folder 'nowhere'"),
        (["bench", "plan", "--scenarios", "nowhere"], "nowhere: no such file"),
        (["bench", "plan", "--scenarios", "a", "--worlds", "b"], "got --worlds and --scenarios"),
        (["import", "nowhere.csv"], "nowhere.csv: no such file"),
        (["import", "nowhere.csv", "--start", "1"], "--start: got '1', expected X,Y"),
        (["import", "nowhere.csv", "--out", "a.json"], "expected a name that ends in .xml"),
        (["import", "nowhere.csv", "--scale", "0"], "scale: got 0"),
        (["run", "nowhere.xml", "--robot", "drone", "--seed", "1"], "no such file"),
    ],
)
def test_bad_words_are_refused_in_one_line(capsys, arguments, said):
    assert main(arguments) == 2
    error = capsys.readouterr().err.splitlines()
    assert len(error) == 1
    assert said in error[0]


def test_every_benchmark_names_its_files():
    assert {name: one.option for name, one in BENCHMARKS.items()} == {
        "plan": "--scenarios",
        "barn": "--worlds",
        "dodge": "--worlds",
    }
