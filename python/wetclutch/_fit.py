"""Fits of cars to logs."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, overload

from . import _wetclutch as native
from ._car import Car, check_car
from ._errors import InputError, of_files
from ._estimate import Log, framed, read
from ._executor import each
from ._progress import Progress, Report, reported
from ._sensors import Sensors, file_or_sensors
from ._table import Table


@dataclass(frozen=True, slots=True)
class Fit:
    """A car that was fitted to logs.

    Attributes:
        car: The fitted car, for :func:`estimate` at once; the given one with the reason in its first line if ``kept`` is not None.
        intervals: A row for each fitted quantity: ``value`` and ``lower`` to ``upper``, the interval that contains it in 95 %, in ``unit``;
            a value with the unit 1 is a factor on that of the given car. ``deviation_after_over_before`` is the ratio of its standard
            deviations, and ``verdict`` says whether these logs identify it.
        channel_map: What belongs into the channel map of the logs, a row for each change: ``value`` is added to the ``key`` of the ``signal``, and
            ``scale`` is multiplied by it. The signal ``commands`` is each command of a valve.
        not_identifiable: Names of the quantities that these logs do not identify: they are known no better than before.
        statements: What else the logs show, in sentences.
        findings: What was found in the logs, in sentences.
        shifts: How many shifts were fitted.
        kept: Why the given values are kept, or None.
        page: The page of the fit as HTML, if it was asked for.
        adaptations: Fill time, kiss point, lag and friction by clutch, gears and oil temperature, if ``oil_step`` was given: a row for each with
            its interval, the number of shifts, and in ``lacks`` what the logs lack for it.
    """

    car: Car
    intervals: Table
    channel_map: Table
    not_identifiable: tuple[str, ...]
    statements: tuple[str, ...]
    findings: tuple[str, ...]
    shifts: int
    kept: str | None
    page: str | None
    adaptations: Table | None

    def plot(self) -> Any:
        """Draws each interval on what was known before; needs matplotlib.

        Returns:
            The axes of the figure.
        """
        from ._plot import plot_fit

        return plot_fit(self)

    def plot_adaptations(self) -> Any:
        """Draws fill time, kiss point, lag, delay and friction of each clutch with their intervals; needs matplotlib.

        Returns:
            The axes of the figure.

        Raises:
            ValueError: ``oil_step`` was not given.
        """
        from ._plot import plot_adaptations

        return plot_adaptations(self)

    def _repr_html_(self) -> str | None:
        return framed(self.page)

    def __repr__(self) -> str:
        kept = ", given values kept" if self.kept is not None else ""
        identified = self.intervals.rows - len(self.not_identifiable)
        return f"Fit({self.shifts} shifts, {identified} of {self.intervals.rows} quantities identifiable{kept})"


@overload
def fit(
    car: Car,
    logs: Any,
    *,
    sensors: Sensors | str | os.PathLike[str] | None = None,
    page: bool = False,
    oil_step: float | None = None,
    progress: Progress = False,
    executor: None = None,
) -> Fit: ...
@overload
def fit(
    car: Sequence[Car],
    logs: Sequence[Any],
    *,
    sensors: Sensors | str | os.PathLike[str] | None = None,
    page: bool = False,
    oil_step: float | None = None,
    progress: Progress = False,
    executor: Any = None,
) -> tuple[Fit, ...]: ...
def fit(
    car: Car | Sequence[Car],
    logs: Any,
    *,
    sensors: Sensors | str | os.PathLike[str] | None = None,
    page: bool = False,
    oil_step: float | None = None,
    progress: Progress = False,
    executor: Any = None,
) -> Fit | tuple[Fit, ...]:
    """Fits the values of a car to logs, or those of each of many cars to its logs. The results are those of ``wetclutch fit``.

    Ends within some milliseconds of Ctrl-C; other threads of Python run meanwhile.

    Args:
        car: The car to start from; its error budget says how far off its values may be. Or many cars.
        logs: A log, or a list or tuple of logs: each a :class:`Log`, or what :func:`read` makes one of. Of many cars, these of each.
        sensors: The sensors of the logs: :class:`Sensors`, or a file whose table ``sensors`` describes them.
        page: Whether to make the page of the fit.
        oil_step: Step of the oil temperature, K, of the table ``adaptations``: 2 to 200, such as 20. None leaves it out.
        progress: True for a bar, or a function that takes words and the done fraction or None, at most ten times a second.
        executor: Where many cars are fitted: any ``concurrent.futures.Executor``, or a ``dask.distributed.Client``; in this process if it
            is None. Files are read by the workers.

    Returns:
        The fit of the car; of many cars a tuple in their order.

    Raises:
        InputError: A log cannot be read or is not of this car, or no shift can be fitted.
        WorkError: A fit found no minimum, or workers died again and again at the same car.
    """
    read_by = file_or_sensors(sensors)
    for one in car if isinstance(car, (list, tuple)) else [car]:
        check_car(one)
    if not isinstance(car, Car):
        if len(car) != len(logs):
            raise ValueError(f"there are {len(car)} cars and logs of {len(logs)}, expected logs for each car")
        pairs = [(one, _logs(of)) for one, of in zip(car, logs, strict=True)]
        return each(executor, partial(_fitted, read_by, page, oil_step), pairs, progress, "cars")
    if executor is not None:
        raise ValueError("executor is for many cars: give a list of them, and one of the logs of each")
    with reported(progress) as report:
        return _fitted(read_by, page, oil_step, (car, _logs(logs)), report)


def _logs(logs: Any) -> list[Log]:
    many = logs if isinstance(logs, (list, tuple)) else [logs]
    if not many:
        raise InputError("there is no log", hint="give a log, or a list of logs", key="logs")
    return [log if isinstance(log, Log) else read(log) for log in many]


def _fitted(
    sensors: Sensors | str | None,
    page: bool,
    oil_step: float | None,
    of: tuple[Car, list[Log]],
    report: Report | None = None,
) -> Fit:
    car, logs = of
    with of_files(sensors, *(log.map for log in logs)):
        fitted, tables, not_identifiable, statements, findings, shifts, kept, html = native.fit(
            car._native, [log._native for log in logs], sensors, page, oil_step, report
        )
    intervals, channel_map, adaptations = tables
    return Fit(
        car=Car._of(fitted),
        intervals=Table(intervals),
        channel_map=Table(channel_map),
        not_identifiable=tuple(not_identifiable),
        statements=tuple(statements),
        findings=tuple(findings),
        shifts=shifts,
        kept=kept,
        page=html,
        adaptations=None if adaptations is None else Table(adaptations),
    )
