"""Simulated drives."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass

from . import _wetclutch as native
from ._car import Car
from ._errors import check_range, of_files
from ._progress import Progress, reported
from ._table import Table


@dataclass(frozen=True, slots=True)
class Simulation:
    """A simulated drive.

    Attributes:
        truth: Every signal, true pressures and torques included.
        measured: What a car measures or commands, through the sensors of the drive: a log for :func:`estimate`.
        distance_m: Distance driven, m.
        shifts: How many shifts there were.
        speed_max_m_s: Maximum speed, m/s.
    """

    truth: Table
    measured: Table
    distance_m: float
    shifts: int
    speed_max_m_s: float

    def __iter__(self) -> Iterator[Table]:
        """Both tables: ``truth, measured = simulate(...)``."""
        return iter((self.truth, self.measured))


def simulate(
    car: Car, drive: str | os.PathLike[str], *, seed: int | None = None, progress: Progress = False
) -> Simulation:
    """Drives a car through a drive file. The same car, file and seed give the same tables.

    Ends within some milliseconds of Ctrl-C; other threads of Python run meanwhile.

    Args:
        car: A car with a gearbox.
        drive: A drive file, such as ``drives/city.toml``.
        seed: Seed of the noise of its sensors, in place of that of the file.
        progress: True for a bar, or a function that takes words and the done fraction, at most ten times a second.

    Raises:
        InputError: The file is wrong, or the car is one of a single shift.
        WorkError: The simulation failed.
    """
    check_range("seed", seed, 0, 2**64 - 1)
    with of_files(drive), reported(progress) as report:
        truth, measured, summary = native.simulate(car._native, os.fspath(drive), seed, report)
    distance_m, shifts, speed_max_m_s = summary
    return Simulation(Table(truth), Table(measured), distance_m, shifts, speed_max_m_s)
