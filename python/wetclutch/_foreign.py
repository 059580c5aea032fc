"""Logs in formats that other libraries read: MDF 2 and 3 by asammdf, MAT-files by SciPy or h5py."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

from ._errors import InputError

# Names of a vector of times with the factor to s, the likeliest one first.
_TIMES = {name: 1.0 for name in ("time", "time_s", "t", "tout", "times", "timestamp", "timestamps", "zeit")}
_TIMES |= {name: 1e-3 for name in ("time_ms", "t_ms", "timestamp_ms", "timestamps_ms", "zeit_ms")}

# A matrix with more columns than this is none of channels.
_COLUMNS = 16


def columns_of(path: str) -> dict[str, Any] | None:
    """The channels of a file in such a format, over one time column; None for a file that the program reads itself.

    Raises:
        InputError: The library is not installed, or the file is damaged or has no channels over a time.
    """
    try:
        with open(path, "rb") as file:
            begin = file.read(19)
    except OSError:
        # The program says what is wrong with the file.
        return None
    if begin.startswith((b"MDF     2", b"MDF     3")):
        with _read_by(path, "asammdf"):
            return _merged(path, list(_mdf(path)), [])
    if begin == b"MATLAB 7.3 MAT-file":
        h5py = _library(path, "h5py", "h5py")
        with _read_by(path, "h5py"), h5py.File(path, "r") as file:
            return _of_tree(path, file)
    # A MAT-file of version 4 begins with numbers.
    if begin == b"MATLAB 5.0 MAT-file" or (path.lower().endswith(".mat") and b"\0" in begin):
        scipy = _library(path, "scipy.io", "scipy")
        with _read_by(path, "scipy"):
            return _of_tree(path, scipy.loadmat(path, squeeze_me=True, simplify_cells=True))
    return None


def _library(path: str, module: str, package: str) -> Any:
    try:
        return import_module(module)
    except ImportError as error:
        message = f"{path}: this format is read by `{package}`, which is not installed"
        raise InputError(message, hint=f"pip install {package}", file=path) from error


@contextmanager
def _read_by(path: str, package: str) -> Iterator[None]:
    """What a library says of a damaged file is an error of the file."""
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        message = f"{path}: {package} cannot read it: {error}"
        raise InputError(message, hint="the file may be damaged or cut: copy it again, or save it anew", file=path) from error


def _mdf(path: str) -> Iterator[tuple[str, Any, Any]]:
    """Name with unit, times in s and values of each channel of an MDF file with numbers; words of a table of values are their numbers."""
    with _library(path, "asammdf", "asammdf").MDF(path) as mdf:
        for signal in mdf.iter_channels(skip_master=True):
            if signal.samples.dtype.kind not in "biuf":
                signal = mdf.get(signal.name, signal.group_index, signal.channel_index, raw=True)
            if signal.samples.dtype.kind in "biuf" and signal.samples.ndim == 1 and len(signal):
                name = f"{signal.name} [{signal.unit}]" if signal.unit else signal.name
                yield name, signal.timestamps, signal.samples


def _merged(path: str, channels: list[tuple[str, Any, Any]], left_out: list[str]) -> dict[str, Any]:
    """Channels with times of their own in one table: a cell without a reading is NaN."""
    import numpy as np

    if left_out:
        named = ", ".join(left_out[:8]) + (", ..." if len(left_out) > 8 else "")
        warnings.warn(f"{path}: left out, as no times belong to them: {named}", stacklevel=4)
    if not channels:
        raise InputError(f"{path}: there are no channels in it", hint="save vectors of numbers, and their times", file=path)
    first = channels[0][1]
    if all(len(times) == len(first) and np.array_equal(times, first) for _, times, _ in channels):
        columns = {"time_s": first}
        for name, _, values in channels:
            columns.setdefault(name, values)
        return columns
    times = np.unique(np.concatenate([times for _, times, _ in channels]))
    columns = {"time_s": times}
    for name, at, values in channels:
        column = np.full(len(times), np.nan)
        column[np.searchsorted(times, at)] = values
        # Of several channels with a name the first one counts, as in the list of the recorder.
        columns.setdefault(name, column)
    return columns


def _of_tree(path: str, tree: Any) -> dict[str, Any]:
    """The channels of a MAT-file: those of each structure over the times in it, else over those of what is around it."""
    left_out: list[str] = []
    channels = list(_channels(tree, "", None, left_out))
    if not channels:
        message = f"{path}: no vector in it is called as a time"
        raise InputError(message, hint="name the times `time`, in s, and save vectors of the same length with them", file=path)
    return _merged(path, channels, left_out)


def _channels(group: Any, prefix: str, around: Any, left_out: list[str]) -> Iterator[tuple[str, Any, Any]]:
    """Name, times in s and values of the vectors of a structure and of the structures in it, with the names of these before theirs."""
    vectors: dict[str, Any] = {}
    groups: list[tuple[str, Any]] = []
    for name, value in group.items():
        if name.startswith(("__", "#")):
            continue
        if hasattr(value, "items"):
            groups.append((f"{prefix}{_label(value) or name}.", value))
        elif isinstance(value, list) and value and all(hasattr(of, "items") for of in value):
            # The signals of a structure with time.
            groups.extend((f"{prefix}{_label(of) or f'{name}{at + 1}'}.", of) for at, of in enumerate(value))
        elif (numbers := _numbers(value)) is not None:
            vectors[name] = numbers
        elif _has_many(value):
            left_out.append(f"{prefix}{name}")
    times = _times(vectors, around)
    rows = len(times[1]) if times else 0
    for name, values in vectors.items():
        if times and values is times[2]:
            continue
        if values.ndim == 1 and len(values) == rows:
            yield _plain(prefix, name), times[1], values
        elif values.ndim == 2 and rows in values.shape and min(values.shape) <= _COLUMNS:
            by_row = values if values.shape[0] == rows else values.T
            yield from ((f"{_plain(prefix, name)}_{at + 1}", times[1], by_row[:, at]) for at in range(by_row.shape[1]))
        elif values.size > 1:
            left_out.append(f"{prefix}{name}")
    for inner, of in groups:
        yield from _channels(of, inner, times, left_out)


def _label(group: Any) -> str:
    """The label of a signal in a structure with time."""
    label = group.get("label", "")
    return label if isinstance(label, str) else ""


def _plain(prefix: str, name: str) -> str:
    """The name of a channel; the values of a labelled signal have its label."""
    return prefix.removesuffix(".") if name == "values" and prefix else f"{prefix}{name}"


def _numbers(value: Any) -> Any:
    """The value as an array of numbers with one dimension or two; None of what is none."""
    import numpy as np

    try:
        values = np.squeeze(np.asarray(value))
    except ValueError:
        # A list of lists of different lengths.
        return None
    return values if values.ndim in (1, 2) and values.dtype.kind in "biuf" else None


def _has_many(value: Any) -> bool:
    """Whether it is a list of something else than numbers, as of words."""
    return (isinstance(value, list) or getattr(value, "ndim", 0) > 0) and len(value) > 1


def _times(vectors: dict[str, Any], around: Any) -> Any:
    """Name, values in s and vector of the times of these vectors: those of the likeliest name that others are as long as, else those around them."""
    lengths = [size for values in vectors.values() for size in values.shape]
    found = []
    for name, values in vectors.items():
        factor = _TIMES.get(name.lower())
        if factor is not None and values.ndim == 1:
            alike = lengths.count(len(values))
            found.append((alike > 1, -list(_TIMES).index(name.lower()), name, values, factor))
    if not found:
        return around
    is_alike, _, name, values, factor = max(found, key=lambda of: of[:2])
    others = [size for other, of in vectors.items() if other != name for size in of.shape]
    if not is_alike and around is not None and len(around[1]) in others:
        # Of another length: these vectors go with the times around them.
        return around
    return name, values if factor == 1.0 else factor * values, values
