"""All errors of a file."""

from __future__ import annotations

import os

from . import _wetclutch as native


def check(path: str | os.PathLike[str]) -> None:
    """Checks a file of any kind, and the files that it names, as ``wetclutch check``.

    Raises:
        ExceptionGroup: All errors, each an :class:`InputError` with file, line, key and hint.
        InputError: The file cannot be read at all.
    """
    errors = native.errors_of_file(os.fspath(path))
    if errors:
        count = "an error" if len(errors) == 1 else f"{len(errors)} errors"
        raise ExceptionGroup(f"{os.fspath(path)}: {count}", errors)
