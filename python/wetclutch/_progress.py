"""Progress of long calls."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeAlias

#: Takes words and the done fraction, from 0 to 1, or None where the end is not known; at most ten times a second.
Report: TypeAlias = Callable[[str, float | None], object]
#: What a long call takes as ``progress``.
Progress: TypeAlias = bool | Report


@contextmanager
def reported(progress: Progress) -> Iterator[Report | None]:
    """What the native part reports to: nothing, the given callable, or a bar of tqdm if that is installed, else a line on standard error."""
    if not isinstance(progress, bool):
        yield progress
        return
    if not progress:
        yield None
        return
    try:
        from tqdm.auto import tqdm
    except ImportError:
        try:
            yield _line
        finally:
            sys.stderr.write("\r\x1b[K")
        return
    with tqdm(total=1.0, bar_format="{l_bar}{bar}| {elapsed}", leave=False) as bar:

        def report(words: str, fraction: float | None) -> None:
            bar.set_description_str(words, refresh=False)
            bar.n = fraction or 0.0
            bar.refresh()

        yield report


def _line(words: str, fraction: float | None) -> None:
    done = "" if fraction is None else f"{100.0 * fraction:3.0f} % "
    sys.stderr.write(f"\r\x1b[K{done}{words}")
    sys.stderr.flush()
