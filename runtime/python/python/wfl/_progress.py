"""Tells how far a run has come: lines on standard error, and in a notebook one line that is renewed."""

from __future__ import annotations

import sys
from typing import Any


def _in_notebook() -> bool:
    """Cells have an output of their own: a kernel of Jupyter, not a terminal with IPython."""
    # whoever has not loaded IPython runs in no notebook, and nothing is imported for him
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython is not None else None
    return shell is not None and hasattr(shell, "kernel")


class Lines:
    """Shows lines of a run, the last one only in a notebook."""

    def __init__(self) -> None:
        self._handle: Any = None
        self._notebook = _in_notebook()

    def __call__(self, line: str) -> None:
        if not self._notebook:
            sys.stderr.write(f"{line}\n")
            return
        from IPython.display import display

        told = {"text/plain": line}
        if self._handle is None:
            self._handle = display(told, raw=True, display_id=True)
        else:
            self._handle.update(told, raw=True)
