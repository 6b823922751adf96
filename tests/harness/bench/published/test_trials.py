from tests.harness.bench.published.benchmark_files import field_folder
from wayproof.harness.bench.published import dodge
from wayproof.harness.bench.published.trials import Trial, run_trial
from wayproof.harness.config_document import override


def test_a_world_that_cannot_start_is_an_outcome(tmp_path):
    world = dodge.read_field(field_folder(tmp_path) / "easy_0.csv")
    config = override(dodge.dodge_config(world, 0), ["start=[8.0,0.0,4.0]"])
    done = run_trial(Trial(world, config, tmp_path / "a.mcap"))
    assert done.result is None
    assert "within the body's radius" in done.refused
    assert dodge._row(done).outcome == "refused"
