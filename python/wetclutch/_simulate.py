"""Simulated drives."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass

from . import _wetclutch as native
from ._car import Car, check_car
from ._drive import Drive
from ._errors import check_range, of_files
from ._progress import Progress, reported
from ._sensors import Sensors, file_or_sensors
from ._table import Table


@dataclass(frozen=True, slots=True)
class Simulation:
    """A simulated drive.

    Attributes:
        truth: Every signal, true pressures and torques included.
        measured: What a car measures or commands, through the sensors of the drive: a log for :func:`estimate`.
        distance_m: Distance driven, m.
        shifts: How many shifts there were.
        scores: A row for each shift: how it went, what the occupants feel of it, friction work and temperature of the plates.
        speed_max_m_s: Maximum speed, m/s.
    """

    truth: Table
    measured: Table
    distance_m: float
    shifts: int
    speed_max_m_s: float
    scores: Table

    def __iter__(self) -> Iterator[Table]:
        """Both tables: ``truth, measured = simulate(...)``."""
        return iter((self.truth, self.measured))


def simulate(
    car: Car,
    drive: Drive | str | os.PathLike[str],
    *,
    sensors: Sensors | str | os.PathLike[str] | None = None,
    seed: int | None = None,
    progress: Progress = False,
) -> Simulation:
    """Drives a car. The same car, drive, sensors and seed give the same tables.

    Ends within some milliseconds of Ctrl-C; other threads of Python run meanwhile.

    Args:
        car: A car with a gearbox.
        drive: A :class:`Drive`, or a drive file, such as ``drives/city.toml``.
        sensors: Sensors in place of those of the drive: :class:`Sensors`, or a file whose table ``sensors`` describes them.
        seed: Seed of the noise of the sensors, in place of theirs.
        progress: True for a bar, or a function that takes words and the done fraction, at most ten times a second.

    Raises:
        InputError: A file is wrong, or the car is one of a single shift.
        WorkError: The simulation failed.
    """
    check_car(car)
    check_range("seed", seed, 0, 2**64 - 1)
    path = drive if isinstance(drive, Drive) else os.fspath(drive)
    with of_files(path, sensors), reported(progress) as report:
        truth, measured, scores, summary = native.simulate(car._native, path, file_or_sensors(sensors), seed, report)
    distance_m, shifts, speed_max_m_s = summary
    return Simulation(Table(truth), Table(measured), distance_m, shifts, speed_max_m_s, Table(scores))
