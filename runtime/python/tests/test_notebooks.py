"""The notebooks run from the first cell to the last; their own assertions compare with closed forms."""

from __future__ import annotations

from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

NOTEBOOKS = sorted((Path(__file__).resolve().parents[1] / "notebooks").glob("*.ipynb"))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda p: p.stem)
def test_a_notebook_runs(path):
    notebook = nbformat.read(path, as_version=4)
    client = NotebookClient(notebook, timeout=600, resources={"metadata": {"path": str(path.parent)}})
    client.execute()
    shown = [o for c in notebook.cells for o in c.get("outputs", []) if o.output_type != "stream"]
    assert any("image/png" in o.get("data", {}) for o in shown), "it has a plot"


def test_these_are_all():
    assert [p.stem for p in NOTEBOOKS] == ["calibration", "friction", "hertz", "identification"]


def test_outputs_are_not_kept():
    for path in NOTEBOOKS:
        cells = nbformat.read(path, as_version=4).cells
        assert all(not c.get("outputs") and not c.get("execution_count") for c in cells), path.name
