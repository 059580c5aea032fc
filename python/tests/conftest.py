"""What the tests share: a car, and a short simulated drive as a log."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

import wetclutch as wc

ROOT = Path(__file__).resolve().parents[2]

# A program that a script starts in the background ignores interrupts until it says otherwise.
signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def car() -> wc.Car:
    return wc.Car.read(ROOT / "vehicles" / "six_speed.toml")


@pytest.fixture(scope="session")
def drive_file() -> str:
    return os.fspath(ROOT / "drives" / "city.toml")


@pytest.fixture(scope="session")
def run(car: wc.Car, drive_file: str) -> wc.Simulation:
    return wc.simulate(car, drive_file)


@pytest.fixture(scope="session")
def measured(run: wc.Simulation) -> wc.Table:
    """The first two minutes of the drive."""
    rows = 12_000
    return wc.Table({name: run.measured[name][:rows] for name in run.measured})
