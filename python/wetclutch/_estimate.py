"""Estimates from logs."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Literal, TypedDict, Unpack, overload

from . import _wetclutch as native
from ._car import Car, check_car
from ._errors import InputError, check_range, of_files, whole, words
from ._executor import each
from ._foreign import columns_of
from ._progress import Progress, Report, reported
from ._sensors import Sensors, file_or_sensors
from ._table import Table


@dataclass(frozen=True, slots=True)
class Log:
    """A log, and which of its channels are which signals.

    Attributes:
        path: The file; None for a table in memory.
        table: The table in memory, or that of a file which another library has read; None for a file.
        map: Channel map, a file as ``wetclutch inspect --suggest`` writes it.
        dbc: Messages and signals of a CAN log.
        mapped: Channels by signals, such as ``{"engine_speed": "N_Eng [rpm]"}``; they replace those of the map.
    """

    path: str | None = None
    table: Table | None = None
    map: str | None = None
    dbc: str | None = None
    mapped: Mapping[str, str] = field(default_factory=dict)

    @property
    def channels(self) -> Table:
        """The channels of the log, a row for each: unit, samples, period, span, values and gaps. Reads the whole log.

        >>> log = read({"time_s": [0.0, 0.01, 0.02], "nTurbine": [900.0, 905.0, 910.0]})
        >>> log.channels["channel"], float(log.channels["maximum"][0])
        (['nTurbine'], 910.0)
        """
        return Table(native.log_channels(self._native))

    def suggest(self) -> str:
        """A first channel map by the names and units of the channels, as text for a file that goes after ``map``; check every line of it."""
        return native.log_map(self._native)

    def shifts(self, ratios: Sequence[float] = ()) -> Table:
        """The shifts that the speeds of the log show, a row for each: gears, kind, times, flare and jerk. They need no car.

        Args:
            ratios: Ratios of the forward gears, the first one first, in place of those of the map; needed where no gear is mapped.

        Raises:
            InputError: The log cannot be read, or nothing in it tells a shift.
        """
        return Table(native.shifts_of_log(self._native, list(ratios)))

    @property
    def _native(self) -> tuple[str, native.Table | None, dict[str, Any]]:
        """Its name, its table if it is one in memory, and how its channels are mapped."""
        channels = [f"{signal}={channel}" for signal, channel in self.mapped.items()]
        mapping = {"map": self.map, "dbc": self.dbc, "channels": channels}
        return self.path or "the table", None if self.table is None else self.table._table, mapping


def read(
    log: Any,
    *,
    map: str | os.PathLike[str] | None = None,
    dbc: str | os.PathLike[str] | None = None,
    channels: Mapping[str, str] | None = None,
) -> Log:
    """A log of a file (CSV, Parquet, MDF 4, CAN with a DBC) or of a data frame.

    MDF 2 and 3 are read by asammdf, MAT-files by SciPy or (version 7.3) h5py, where these are installed. The vectors of a MAT-file that are as long as
    the one that is called ``time`` (s) are its channels.

    A table whose columns have the names of the program (``turbine_speed_rad_s``, ``gear``, ...) needs neither map nor channels.

    Args:
        log: A path, or whatever :class:`Table` takes.
        map: Channel map, as ``wetclutch inspect --suggest`` writes it.
        dbc: Messages and signals of a CAN log.
        channels: Channels by signals; they replace those of the map.

    >>> read({"time_s": [0.0, 0.01], "turbine_speed_rad_s": [100.0, 101.0]}).table
    Table(2 rows: time_s, turbine_speed_rad_s)
    """
    if log is None:
        raise InputError("there is no log", hint="give a path, a data frame, or columns by their names")
    if channels is not None:
        channels = mapped(channels)
    path = os.fspath(log) if isinstance(log, (str, os.PathLike)) else None
    columns = log if path is None else columns_of(path)
    return Log(
        path=path,
        table=None if columns is None else Table(columns),
        map=None if map is None else os.fspath(map),
        dbc=None if dbc is None else os.fspath(dbc),
        mapped=dict(channels or {}),
    )


def mapped(channels: Any) -> dict[str, str]:
    """Channels by signals, checked."""
    if not isinstance(channels, Mapping) or not all(isinstance(of, str) for of in (*channels, *channels.values())):
        hint = 'give names of channels by signals, such as {"engine_speed": "N_Eng [rpm]"}'
        raise InputError("channels is no mapping from words to words", hint=hint, key="channels")
    return dict(channels)


@dataclass(frozen=True, slots=True)
class Estimates:
    """Estimates of a log.

    Attributes:
        rows: A row for each row of the log: pressures and torques with their guaranteed ranges, phase and health.
        shifts: A row for each shift.
        findings: What was found in the log, in sentences.
        learnt: What was learnt of the car, for the next log; None where nothing was.
        page: The page of the drive as HTML, if it was asked for and the log has a shift.
    """

    rows: Table
    shifts: Table
    findings: tuple[str, ...]
    learnt: str | None
    page: str | None

    def _repr_html_(self) -> str | None:
        return framed(self.page)

    def __repr__(self) -> str:
        return f"Estimates({self.rows.rows} rows, {self.shifts.rows} shifts)"

    def plot(self, shift: int | Literal["first"] | None = "first") -> Any:
        """Draws pressures and torques of a shift with their guaranteed ranges, or the whole drive; needs matplotlib.

        Args:
            shift: Number of the shift, as in ``shifts["number"]``, or ``"first"``; None for the drive of a car with a gearbox.

        Returns:
            The axes of the figure: pressures above, torques below; of a drive gear, torque at the gearbox input, pressures of the elements.

        Raises:
            IndexError: There is no such shift.
        """
        from ._plot import plot_drive, plot_shift

        return plot_drive(self) if shift is None else plot_shift(self, None if shift == "first" else shift)


def framed(page: str | None) -> str | None:
    """A page in a frame of a notebook."""
    if page is None:
        return None
    from html import escape

    return f'<iframe srcdoc="{escape(page)}" style="width:100%;height:640px;border:0"></iframe>'


class _Options(TypedDict, total=False):
    """How a log is estimated."""

    observer: str | None
    method: str | None
    sensors: Sensors | str | os.PathLike[str] | None
    budget: Mapping[str, Any] | None
    columns: Sequence[str]
    shift: int | None
    shifts: Sequence[str]
    learnt: str | None
    threads: int | None
    page: bool


@overload
def estimate(
    car: Car,
    log: list[Any] | tuple[Any, ...],
    *,
    progress: Progress = False,
    executor: Any = None,
    **options: Unpack[_Options],
) -> tuple[Estimates, ...]: ...
@overload
def estimate(
    car: Car, log: Any, *, progress: Progress = False, executor: None = None, **options: Unpack[_Options]
) -> Estimates: ...
def estimate(
    car: Car,
    log: Any,
    *,
    observer: str | None = None,
    method: str | None = None,
    sensors: Sensors | str | os.PathLike[str] | None = None,
    budget: Mapping[str, Any] | None = None,
    columns: Sequence[str] = (),
    shift: int | None = None,
    shifts: Sequence[str] = (),
    learnt: str | None = None,
    threads: int | None = None,
    page: bool = False,
    progress: Progress = False,
    executor: Any = None,
) -> Estimates | tuple[Estimates, ...]:
    """Estimates pressures and torques of the clutches from a log, or from each of many. The results are those of ``wetclutch estimate``.

    Ends within some milliseconds of Ctrl-C; other threads of Python run meanwhile.

    Args:
        car: The car.
        log: A :class:`Log`, or what :func:`read` makes one of; or a list or tuple of them, each estimated alone.
        observer: Observer of a car of one shift, such as ``"kalman"``; the best for the log if none is given.
        method: Design method of its gains, such as ``"peak-to-peak"``, of the observers rigid and compliant.
        sensors: The sensors of the log: :class:`Sensors`, or a file whose table ``sensors`` describes them.
        budget: Bounds on errors by their keys, such as ``car.budget | {"error_bounds.engine_torque_share": 0.05}``, in place of all of
            ``car.budget``.
        columns: Columns of the rows, in this order; all of them if empty. The time is always the first.
        shift: The shift with this number alone, from 1.
        shifts: Shifts between these gears alone, such as ``["1-2", "2-3"]``.
        learnt: What was learnt of the car in an earlier log: ``Estimates.learnt``.
        threads: Threads on which a log is read, estimated and written; if it is None as many as there are processors, in an executor one. The
            results are the same on any number.
        page: Whether to make the page of the drive.
        progress: True for a bar, or a function that takes words and the done fraction or None, at most ten times a second.
        executor: Where many logs are estimated: any ``concurrent.futures.Executor``, or a ``dask.distributed.Client``; in this process if
            it is None. Files are read by the workers.

    Returns:
        The estimates of the log; of many logs a tuple in their order.

    Raises:
        InputError: A log cannot be read or is not of this car, or an argument does not fit it.
        WorkError: Workers died again and again at the same log.
    """
    if threads is None and executor is not None:
        threads = 1
    check_range("threads", threads, 1, 1024)
    check_range("shift", shift, 1, 10**9)
    check_car(car)
    if shift is not None:
        shift = whole("shift", shift)
    if threads is not None:
        threads = whole("threads", threads)
    if learnt is not None and (not isinstance(learnt, str) or "\n" not in learnt):
        raise InputError(f"learnt: `{learnt}` is no text of what was learnt", hint="give Estimates.learnt, or the text of such a file")
    options = {
        "observer": observer,
        "method": method,
        "sensors": file_or_sensors(sensors),
        "columns": words("columns", columns),
        "shift": shift,
        "shifts": words("shifts", shifts),
        "learnt": learnt,
        "threads": threads,
        "with_page": bool(page),
    }
    if budget is not None:
        car = car._with_budget(budget)
    if isinstance(log, (list, tuple)):
        logs = [one if isinstance(one, Log) else read(one) for one in log]
        return each(executor, partial(_estimated, car, options), logs, progress, "logs")
    if executor is not None:
        raise ValueError("executor is for many logs: give a list of them")
    with reported(progress) as report:
        return _estimated(car, options, log if isinstance(log, Log) else read(log), report)


def _estimated(car: Car, options: dict[str, Any], log: Log, report: Report | None = None) -> Estimates:
    name, table, mapping = log._native
    with of_files(log.map, options["sensors"]):
        rows, found, findings, learnt, html = native.estimate(car._native, name, table, mapping, options, report)
    return Estimates(Table(rows), Table(found), tuple(findings), learnt, html)
