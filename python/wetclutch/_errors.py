"""Exceptions of the package."""

from __future__ import annotations

from typing import Any


class WetclutchError(Exception):
    """An error with the message of the command line and its parts.

    Attributes:
        message: What is wrong.
        hint: What to do about it, or None.
        file: The file in which it is, or None.
        line: The line of the file, from 1, or None.
        key: The key of the file, or None.
    """

    message: str
    hint: str | None
    file: str | None
    line: int | None
    key: str | None

    def __init__(
        self,
        message: str,
        *,
        hint: str | None = None,
        file: str | None = None,
        line: int | None = None,
        key: str | None = None,
    ) -> None:
        super().__init__(message if hint is None else f"{message}\nhint: {hint}")
        self.message = message
        self.hint = hint
        self.file = file
        self.line = line
        self.key = key

    def __reduce__(self) -> tuple[Any, ...]:
        return _made, (type(self), self.message, self.hint, self.file, self.line, self.key)


class InputError(WetclutchError, ValueError):
    """A file, a table or an argument is wrong."""


class WorkError(WetclutchError, RuntimeError):
    """The work itself failed: a simulation diverged, a design has no solution, or it was interrupted."""


def _made(
    kind: type[WetclutchError], message: str, hint: str | None, file: str | None, line: int | None, key: str | None
) -> WetclutchError:
    return kind(message, hint=hint, file=file, line=line, key=key)
