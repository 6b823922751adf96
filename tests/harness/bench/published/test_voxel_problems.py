import json
import re

import pytest

from wayproof.harness.cli.main import main


def test_published_lengths_are_checked(tmp_path, capsys):
    (tmp_path / "m.3dmap").write_text("voxel 6 6 6\n3 3 3\n")
    file = tmp_path / "m.3dscen"
    file.write_text("version 1\nm.3dmap\n0 0 0 4 2 1 5.14626437 1.0\n0 0 0 5 0 0 5.5 1.0\n")
    assert main(["bench", "plan", "--scenarios", str(file), "--repeats", "2", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [row["planner"] for row in rows] == ["exact", "astar", "rrtconnect"]
    assert (rows[0]["problems"], rows[0]["success"], rows[0]["differing"]) == (2, 1.0, 1)
    assert all(0.8 < row["length_ratio_mean"] < 1.2 for row in rows)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("0 0 0 3 3 3 5.1 1.0", r"m\.3dscen:3: cell \(3, 3, 3\) is occupied"),
        ("0 0 0 6 0 0 5.1 1.0", r"m\.3dscen:3: cell \(6, 0, 0\) is occupied or outside"),
        ("0 0 0 1 0", "expected start x y z"),
        ("0 0 0 1 0 0 -1 1", "length -1"),
    ],
)
def test_broken_problems_are_named(tmp_path, capsys, line, said):
    (tmp_path / "m.3dmap").write_text("voxel 6 6 6\n3 3 3\n")
    file = tmp_path / "m.3dscen"
    file.write_text(f"version 1\nm.3dmap\n{line}\n")
    assert main(["bench", "plan", "--scenarios", str(file)]) == 2
    assert len(error := capsys.readouterr().err.splitlines()) == 1
    assert re.search(said, error[0])
