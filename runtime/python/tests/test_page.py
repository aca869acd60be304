"""Every block of docs/python.md runs, one after the other."""

from __future__ import annotations

import os
import re

from conftest import ROOT


def test_the_page_runs(tmp_path, monkeypatch):
    page = (ROOT / "docs" / "python.md").read_text()
    blocks = re.findall(r"```python\n(.*?)```", page, flags=re.DOTALL)
    assert len(blocks) == 8
    # files that the page writes go elsewhere
    os.symlink(ROOT / "examples", tmp_path / "examples")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for block in blocks:
        exec(compile(block, "docs/python.md", "exec"), names)
    assert (tmp_path / "fault.vtu").is_file()
    assert names["step"].converged and len(names["again"].steps) == 11
