"""All errors of a file."""

from __future__ import annotations

import os

from ._errors import grouped


def check(path: str | os.PathLike[str]) -> None:
    """Checks a file of any kind, and the files that it names, as ``wetclutch check``.

    Raises:
        InputErrors: All errors, a group of :class:`InputError` with file, line, key and hint.
        InputError: The file cannot be read at all.
    """
    errors = grouped(os.fspath(path))
    if errors is not None:
        raise errors
