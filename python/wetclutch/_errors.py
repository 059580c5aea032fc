"""Exceptions of the package."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Self


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
        made = (type(self), self.message, self.hint, self.file, self.line, self.key)
        # The notes say which of many logs it was, also from another process.
        return _made, made, {"__notes__": self.__notes__} if hasattr(self, "__notes__") else None


class InputError(WetclutchError, ValueError):
    """A file, a table or an argument is wrong."""


class InputErrors(ExceptionGroup[InputError], InputError):
    """All errors of a file and of those that it names: a group for ``except*``, whose parts are those of the first error."""

    hint: str | None
    file: str | None
    line: int | None
    key: str | None

    def __new__(cls, message: str, errors: Sequence[InputError]) -> Self:
        return super().__new__(cls, message, errors)

    def __init__(self, message: str, errors: Sequence[InputError]) -> None:
        first = errors[0]
        self.hint, self.file, self.line, self.key = first.hint, first.file, first.line, first.key

    def derive(self, errors: Sequence[InputError]) -> InputErrors:  # type: ignore[override]
        """A group of some of them."""
        return InputErrors(self.message, errors)

    def __reduce__(self) -> tuple[Any, ...]:
        return InputErrors, (self.message, list(self.exceptions))

    def __str__(self) -> str:
        return "\n".join([self.message, *(str(error) for error in self.exceptions)])


class WorkError(WetclutchError, RuntimeError):
    """The work itself failed: a simulation diverged, a design has no solution, or it was interrupted."""


def _made(
    kind: type[WetclutchError], message: str, hint: str | None, file: str | None, line: int | None, key: str | None
) -> WetclutchError:
    return kind(message, hint=hint, file=file, line=line, key=key)


def check_range(name: str, value: float | None, low: float, high: float) -> None:
    """Refuses an argument that is out of its range, or no number; None is one that is not given."""
    if value is not None and not low <= value <= high:
        raise InputError(f"{name} is {value}, expected {low} to {high}", key=name)


def whole(name: str, value: Any) -> int:
    """An argument as a whole number."""
    try:
        number = int(value)
    except (TypeError, ValueError, OverflowError):
        number = None
    if number is None or isinstance(value, bool) or value != number:
        raise InputError(f"{name} is {value}, expected a whole number", key=name)
    return number


def words(name: str, values: Any) -> list[str]:
    """An argument of one word or several."""
    if not isinstance(values, Iterable):
        raise InputError(f"{name} is {values!r}, expected words", hint=f"give a list of words as {name}", key=name)
    given = [values] if isinstance(values, str) else list(values)
    odd = next((value for value in given if not isinstance(value, str)), None)
    if odd is not None:
        raise InputError(f"{name}: {odd!r} is no word", hint=f"give a list of words as {name}", key=name)
    return given


@contextmanager
def of_files(*paths: object) -> Iterator[None]:
    """Raises all errors of these files where one of them has several, in place of the first; what is no path is passed over."""
    try:
        yield
    except InputErrors:
        raise
    except InputError as error:
        for path in (os.fspath(path) for path in paths if isinstance(path, (str, os.PathLike))):
            group = grouped(path)
            if group is not None and len(group.exceptions) > 1 and any(error.file == one.file for one in group.exceptions):
                raise group from None
        raise


@contextmanager
def of_texts(name: str, text: str, gearbox: str | None = None) -> Iterator[None]:
    """Raises all errors of the text of a file, and of its gearbox file, where there are several, in place of the first."""
    from . import _wetclutch as native

    try:
        yield
    except InputError:
        errors = native.errors_of_texts(name, text, gearbox)
        if len(errors) > 1:
            raise InputErrors(f"{name}: {len(errors)} errors", errors) from None
        raise


def grouped(path: str) -> InputErrors | None:
    """All errors of a file; None if there is none.

    Raises:
        InputError: The file cannot be read at all.
    """
    from . import _wetclutch as native

    errors = native.errors_of_file(path)
    if not errors:
        return None
    count = "an error" if len(errors) == 1 else f"{len(errors)} errors"
    return InputErrors(f"{path}: {count}", errors)
