"""The command ``wfl``, as the wheel carries it."""

from __future__ import annotations

import signal
import sys

from ._wfl import command


def main() -> int:
    """Runs the command with the arguments of this process and returns its exit code."""
    # the command has ends of its own for signals and closed pipes, as a program has
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return command(sys.argv[0], sys.argv)
