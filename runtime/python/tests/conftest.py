"""What the tests share: the examples of the repository, and the command that the package carries."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import wfl

ROOT = Path(__file__).resolve().parents[3]
EXAMPLES = ROOT / "examples"


def command(*words: object, program: str | None = None) -> subprocess.CompletedProcess[str]:
    """Runs `wfl` with some words; the program that was built beside the package where one is named."""
    carried = [sys.executable, "-c", "import sys; from wfl._command import main; sys.exit(main())"]
    start = [program] if program else carried
    return subprocess.run([*start, *map(str, words)], capture_output=True, text=True, check=False)


def programs() -> list[str | None]:
    """The command of the package, and the program of the repository if it is known."""
    known = os.environ.get("WFL_PROGRAM")
    return [None, known] if known else [None]


@pytest.fixture
def examples() -> Path:
    return EXAMPLES


@pytest.fixture(autouse=True)
def quiet_scenes():
    """Warnings of scenes are looked at where a test is about them."""
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", wfl.WflWarning)
        yield


HEAT = """wfl 1
param c = 1
mesh box [0,0] to [1,1] cells [6,6] quad
region left = faces where x == 0
region right = faces where x == 1
data k : scalar = 1 + x*t
unknown u : scalar
term flow on all : k*Grad_u.Grad_Test_u
fix u = 0 on left
load u = c*(1 + y) on all
steps t = 0 to 1 by 0.25
measure m = mean(u) on all
measure f = integral(k*Grad_u.Normal) on right
"""
