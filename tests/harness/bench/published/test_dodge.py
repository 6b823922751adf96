from tests.harness.bench.published.benchmark_files import field_folder, finished
from wayproof.harness.bench.published import dodge


def test_a_flight_ends_at_the_finish(tmp_path):
    world = dodge.read_field(field_folder(tmp_path) / "easy_0.csv")
    config = dodge.dodge_config(world, 1)
    track = ((0.0, 0.0, 0.0, 4.0), (11.0, 16.9, 0.0, 4.0), (11.1, 17.0, 0.0, 4.0))
    row = dodge._row(finished(world, config, "stuck", 30.0, track))
    assert (row.outcome, row.time_s, row.collisions) == ("success", 11.1, 0)
    row = dodge._row(finished(world, config, "success", 12.0, track[:2]))
    assert row.outcome == "timeout"  # the goal is beyond the finish
    summary = dodge.summarise("all", [row, row])
    assert (summary.success, summary.restricted_mean_s) == (0.0, 35.0)


def test_starts_and_goals_are_free_and_of_the_seed(tmp_path):
    world = dodge.read_field(field_folder(tmp_path) / "easy_0.csv")
    assert len(world.solids) == 1  # the other is put away far outside
    ends = [dodge.flight_ends(world, seed) for seed in range(6)]
    assert ends == [dodge.flight_ends(world, seed) for seed in range(6)]
    assert len({start for start, _ in ends}) == 6
    for start, goal in ends:
        assert (start[:2], goal[:2]) == ((0.0, 0.0), (18.0, 0.0))
        assert 2.0 <= start[2] == goal[2] <= 8.0
