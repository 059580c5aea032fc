"""Drives: what driver and road do."""

from __future__ import annotations

import os
from typing import Any, Self

from . import _wetclutch as native
from ._errors import of_files, of_texts
from ._toml import replaced


class Drive:
    """What driver and road do, as a drive file describes it: for :func:`simulate`.

    Two drives are equal if their files have the same text. A drive is pickled as this text and its path, from whose folder a file of
    speeds is read where the drive follows one.

    Attributes:
        name: Name of the drive.
        duration_s: Its length, s.

    >>> drive = Drive("name = 'start'\\n[[segment]]\\nduration_s = 20.0\\nthrottle = 0.2\\n")
    >>> drive.replace(repetitions=3)
    Drive('start', 60 s)
    """

    __slots__ = ("_path", "_text", "duration_s", "name")

    name: str
    duration_s: float
    _path: str
    _text: str

    def __init__(self, text: str, *, path: str | os.PathLike[str] = "drive.toml") -> None:
        """A drive from the text of a drive file.

        Args:
            text: The text.
            path: What messages call it; a file of speeds is read from its folder.

        Raises:
            InputError: Something in it is wrong; the error has line and key.
            InputErrors: Several things in it are wrong.
        """
        self._path, self._text = os.fspath(path), text
        with of_texts(self._path, text):
            self._take(native.check_drive(self))

    @property
    def _source(self) -> tuple[str, str]:
        return self._path, self._text

    def _take(self, described: tuple[str, str, float]) -> None:
        self._text, self.name, self.duration_s = described

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Self:
        """Reads a drive file.

        Raises:
            InputError: The file cannot be read, or something in it is wrong; the error has file, line and key.
            InputErrors: Several things in it are wrong.
        """
        drive = cls.__new__(cls)
        drive._path = os.path.abspath(path)
        with of_files(path):
            drive._take(native.check_drive(os.fspath(path)))
        return drive

    def to_toml(self) -> str:
        """The text of the drive file."""
        return self._text

    def replace(self, values: dict[str, Any] | None = None, /, **keys: Any) -> Self:
        """The same drive with other values of its keys, given as those of :meth:`Car.replace`.

        Raises:
            InputError: There is no such key, or a value cannot be right.
            InputErrors: This is so of several.
        """
        return type(self)(replaced(self._text, values, keys), path=self._path)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Drive):
            return NotImplemented
        return self._text == other._text

    def __hash__(self) -> int:
        return hash(self._text)

    def __getstate__(self) -> tuple[str, str, str, float]:
        return self._path, self._text, self.name, self.duration_s

    def __setstate__(self, state: tuple[str, str, str, float]) -> None:
        self._path, self._text, self.name, self.duration_s = state

    def __repr__(self) -> str:
        return f"Drive({self.name!r}, {self.duration_s:.0f} s)"
