"""A virtual pressure sensor for the wet clutches of automatic transmissions.

Quantities are in SI units, and names end in their unit. Tables are Arrow data: any data-frame library takes them, and none is needed.

>>> import wetclutch as wc
>>> car = wc.Car.template("8hp", mass_kg=1900.0)
>>> car.gears[:3]
('R', '1', '2')
"""

from __future__ import annotations

from ._car import Car, gearboxes
from ._check import check
from ._design import Certificate, ErrorSystem, Gains, PhaseCertificate, design
from ._drive import Drive
from ._errors import InputError, InputErrors, WetclutchError, WorkError
from ._estimate import Estimates, Log, estimate, read
from ._export import export
from ._fit import Fit, fit
from ._sensors import Sensors
from ._simulate import Simulation, simulate
from ._study import Study, study
from ._table import Table
from ._wetclutch import ClutchStep, Observer, StepEstimate, __version__

__all__ = [
    "Car",
    "Certificate",
    "ClutchStep",
    "Drive",
    "ErrorSystem",
    "Estimates",
    "Fit",
    "Gains",
    "InputError",
    "InputErrors",
    "Log",
    "Observer",
    "PhaseCertificate",
    "Sensors",
    "Simulation",
    "StepEstimate",
    "Study",
    "Table",
    "WetclutchError",
    "WorkError",
    "__version__",
    "check",
    "design",
    "estimate",
    "export",
    "fit",
    "gearboxes",
    "read",
    "simulate",
    "study",
]
