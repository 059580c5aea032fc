"""Logs in formats that other libraries read: MDF 2 and 3 by asammdf, MAT-files by SciPy or h5py."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from importlib import import_module
from typing import Any

from ._errors import InputError

_TIMES = {"t", "time", "time_s", "times", "timestamp", "timestamps", "zeit"}


def columns_of(path: str) -> dict[str, Any] | None:
    """The channels of a file in such a format, over one time column; None for a file that the program reads itself.

    Raises:
        InputError: The library is not installed, or the file has no channels over a time.
    """
    try:
        with open(path, "rb") as file:
            begin = file.read(19)
    except OSError:
        # The program says what is wrong with the file.
        return None
    if begin.startswith((b"MDF     2", b"MDF     3")):
        return _merged(path, _mdf(path))
    if begin == b"MATLAB 5.0 MAT-file":
        loaded = _library(path, "scipy.io", "scipy").loadmat(path, squeeze_me=True, simplify_cells=True)
        return _of_vectors(path, _vectors(loaded))
    if begin == b"MATLAB 7.3 MAT-file":
        with _library(path, "h5py", "h5py").File(path, "r") as file:
            return _of_vectors(path, _vectors(file))
    return None


def _library(path: str, module: str, package: str) -> Any:
    try:
        return import_module(module)
    except ImportError as error:
        message = f"{path}: this format is read by `{package}`, which is not installed"
        raise InputError(message, hint=f"pip install {package}", file=path) from error


def _mdf(path: str) -> Iterator[tuple[str, Any, Any]]:
    """Name with unit, times in s and values of each channel of an MDF file with numbers."""
    with _library(path, "asammdf", "asammdf").MDF(path) as mdf:
        for signal in mdf.iter_channels(skip_master=True):
            if signal.samples.dtype.kind in "biuf" and signal.samples.ndim == 1 and len(signal):
                name = f"{signal.name} [{signal.unit}]" if signal.unit else signal.name
                yield name, signal.timestamps, signal.samples


def _merged(path: str, channels: Iterable[tuple[str, Any, Any]]) -> dict[str, Any]:
    """Channels with times of their own in one table: a cell without a reading is NaN."""
    import numpy as np

    channels = list(channels)
    if not channels:
        raise InputError(f"{path}: there are no channels in it", file=path)
    times = np.unique(np.concatenate([times for _, times, _ in channels]))
    columns: dict[str, Any] = {"time_s": times}
    for name, at, values in channels:
        column = np.full(len(times), np.nan)
        column[np.searchsorted(times, at)] = values
        # Of several channels with a name the first one counts, as in the list of the recorder.
        columns.setdefault(name, column)
    return columns


def _vectors(group: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """The vectors of numbers of a MAT-file and of the structures in it, with the names of these before theirs."""
    import numpy as np

    for name, value in group.items():
        if name.startswith(("__", "#")):
            continue
        if hasattr(value, "items"):
            yield from _vectors(value, f"{prefix}{name}.")
            continue
        values = np.squeeze(np.asarray(value))
        if values.ndim == 1 and values.dtype.kind in "biuf":
            yield f"{prefix}{name}", values


def _of_vectors(path: str, vectors: Iterable[tuple[str, Any]]) -> dict[str, Any]:
    """The vectors that are as long as the one of the times."""
    found = dict(vectors)
    time = next((name for name in found if name.rpartition(".")[2].lower() in _TIMES), None)
    if time is None:
        message = f"{path}: no vector in it is called as a time"
        raise InputError(message, hint="name the times `time`, in s, and save vectors of the same length with them", file=path)
    rows = len(found[time])
    return {"time_s": found[time]} | {name: values for name, values in found.items() if name != time and len(values) == rows}
