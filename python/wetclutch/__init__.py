"""A virtual pressure sensor for the wet clutches of automatic transmissions.

Quantities are in SI units, and names end in their unit. Tables are Arrow data: any data-frame library takes them, and none is needed.

>>> import wetclutch as wc
>>> car = wc.Car.template("8hp", mass_kg=1900.0)
>>> car.gears[:3]
('1', '2', '3')
"""

from __future__ import annotations

from ._car import Car, gearboxes
from ._errors import InputError, WetclutchError, WorkError
from ._estimate import Estimates, Log, estimate, read
from ._simulate import Simulation, simulate
from ._table import Table
from ._wetclutch import __version__

__all__ = [
    "Car",
    "Estimates",
    "InputError",
    "Log",
    "Simulation",
    "Table",
    "WetclutchError",
    "WorkError",
    "__version__",
    "estimate",
    "gearboxes",
    "read",
    "simulate",
]
