"""Errors and warnings with code, text, place, and the rendering that the command prints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ._result import Result


@dataclass(frozen=True)
class Message:
    """What is said of a scene or a run."""

    code: str
    """Such as ``"E201"``: ``wfl explain E201`` says more. Empty for an error without a page."""
    severity: str
    """``"error"`` or ``"warning"``."""
    text: str
    """The first line."""
    file: str | None
    """The file of the place, if there is one."""
    line: int | None
    """Its line, counted from 1."""
    column: int | None
    """Its column, counted from 1."""
    rendered: str
    """All of it, as the command prints it."""

    @property
    def place(self) -> tuple[str, int, int] | None:
        """File, line and column, counted from 1."""
        return None if self.file is None else (self.file, self.line or 0, self.column or 0)

    def __str__(self) -> str:
        return self.rendered.rstrip()


class WflWarning(UserWarning):
    """What a scene or a run gives cause to doubt."""


class WflError(Exception):
    """A scene that cannot be read or solved. ``str(error)`` is what the command prints."""

    def __init__(self, messages: list[Message], result: Result | None = None) -> None:
        super().__init__("\n\n".join(str(m) for m in messages))
        self.messages: list[Message] = messages
        """Everything that was found, errors and warnings."""
        self.result: Result | None = result
        """The run as far as it came, where it was not solved or not as expected."""

    @classmethod
    def _from(cls, dicts: list[dict[str, Any]]) -> WflError:
        return cls([Message(**d) for d in dicts])

    @property
    def first(self) -> Message:
        """The first error."""
        errors = [m for m in self.messages if m.severity == "error"]
        return (errors or self.messages)[0]

    @property
    def code(self) -> str:
        """The code of the first error."""
        return self.first.code

    @property
    def text(self) -> str:
        """The first line of the first error."""
        return self.first.text

    @property
    def place(self) -> tuple[str, int, int] | None:
        """File, line and column of the first error, counted from 1; None where it has no place."""
        return self.first.place
