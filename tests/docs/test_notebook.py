"""The notebook of the docs: every code cell runs, in order, in one namespace."""

import ast
import json
from pathlib import Path

NOTEBOOK = Path(__file__).parents[2] / "docs/five-seeds.ipynb"


def cells():
    document = json.loads(NOTEBOOK.read_text())
    assert document["nbformat"] == 4
    return ["".join(cell["source"]) for cell in document["cells"] if cell["cell_type"] == "code"]


def shown(code, namespace):
    """Run a cell; return the value of its last line if that is an expression, as Jupyter does."""
    tree = ast.parse(code)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, str(NOTEBOOK), "exec"), namespace)
    if last is None:
        return None
    return eval(compile(ast.Expression(last.value), str(NOTEBOOK), "eval"), namespace)


def test_every_cell_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    namespace = {}
    values = [shown(code, namespace) for code in cells()]
    assert len(values[0]) == 5
    assert set(values[0]) <= {"success", "aborted", "collision", "timeout", "stuck"}
    units = values[1]
    assert units == {"time_s": "s", "latency_ms": "ms", "evidence_age_s": "s"}
    assert sum(row["sequence_count"] for row in values[2]) == len(namespace["decisions"]) > 100
    worst, error, clearance = values[3]
    assert error == max(one["ate"] for one in namespace["metrics"]) > 0.02
    assert clearance == namespace["metrics"][worst]["least_clearance"]
    assert 0.0 < values[5][2] < 1.0
    for name in ("worst.png", "track.png"):
        assert (tmp_path / name).stat().st_size > 20_000
    assert len(list((tmp_path / "logs").glob("*.mcap"))) == 5


def test_no_output_is_committed():
    document = json.loads(NOTEBOOK.read_text())
    assert all(not cell.get("outputs") for cell in document["cells"])
