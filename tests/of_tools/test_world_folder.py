"""Trial of a folder of worlds: each imported, run, replayed, explained and drawn, or refused."""

from tests.tools.world_folder import main, try_world, worlds_in
from wayproof.harness.log.reader import open_log

WORLD = """<sdf version='1.6'><world name='w'><include><uri>model://ground_plane</uri></include>
<model name='post'><static>1</static><pose>2 0 1 0 0 0</pose><link name='l'><collision name='c'>
<geometry><box><size>0.4 0.4 2</size></box></geometry></collision></link></model></world></sdf>"""


def test_a_world_is_run_and_what_it_left_is_kept(tmp_path):
    path = tmp_path / "hall" / "post.world"
    path.parent.mkdir()
    path.write_text(WORLD)
    row = try_world(path, "drone", ["episode.time_limit=1.0"], [], tmp_path)
    assert (row.refused, row.fault, row.solids) == ("", "", "1")
    assert row.outcome.startswith("timeout: ")
    assert (row.replayed, row.explained) == ("identical", "yes")
    assert int(row.decisions) >= 9
    assert float(row.import_mib) > float(row.import_s) >= 0.0
    (log,) = tmp_path.glob("*hall-post.mcap")
    assert open_log(log).result["outcome"] == "timeout"
    assert "way from start to goal" in log.with_suffix(".txt").read_text()


def test_a_refusal_is_a_row_of_its_own_and_the_table_counts_it(tmp_path, capsys):
    path = tmp_path / "broken.world"
    path.write_text("<sdf version='1.6'><world name='w'/></sdf>")
    (tmp_path / "tests").mkdir()
    (tmp_path / "tests" / "left_out.world").write_text(WORLD)
    assert list(worlds_in([tmp_path])) == [path]
    main([str(path), "--out", str(tmp_path / "table.md"), "--robot", "drone"])
    assert "broken.world: nothing solid in it" in capsys.readouterr().out
    table = (tmp_path / "table.md").read_text()
    assert table.endswith("1 worlds: 0 ran, 0 reached, 0 replayed identical, 1 refused, 0 faults\n")
