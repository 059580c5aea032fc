"""Simulated drives."""

from __future__ import annotations

import os
from dataclasses import dataclass

from . import _wetclutch as native
from ._car import Car
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


def simulate(car: Car, drive: str | os.PathLike[str], *, seed: int | None = None) -> Simulation:
    """Drives a car through a drive file. The same car, file and seed give the same tables.

    Args:
        car: A car with a gearbox.
        drive: A drive file, such as ``drives/city.toml``.
        seed: Seed of the noise of its sensors, in place of that of the file.

    Raises:
        InputError: The file is wrong, or the car is one of a single shift.
        WorkError: The simulation failed.
    """
    truth, measured, (distance_m, shifts, speed_max_m_s) = native.simulate(car._native, os.fspath(drive), seed)
    return Simulation(Table(truth), Table(measured), distance_m, shifts, speed_max_m_s)
