"""The observer of a car for a controller."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterable
from pathlib import Path

from . import _wetclutch as native
from ._car import Car, check_car
from ._errors import of_files
from ._sensors import Sensors, file_or_sensors


def export(
    car: Car,
    folder: str | os.PathLike[str],
    *,
    name: str | None = None,
    shift: str | None = None,
    sensors: Sensors | str | os.PathLike[str] | None = None,
    program: str | os.PathLike[str] | None = None,
    c: str | os.PathLike[str] | None = None,
    fmu: str | os.PathLike[str] | Iterable[str | os.PathLike[str]] = (),
    car_fmu: str | os.PathLike[str] | Iterable[str | os.PathLike[str]] = (),
) -> list[Path]:
    """Writes the gearbox filter of a car for a controller into a folder. The files are those of ``wetclutch export``; files with their names are replaced.

    Args:
        car: A car with a gearbox.
        folder: Folder for the files; it is made if it is not there.
        name: Name of the car in C and in the names of the files, such as ``"eight_speed"``; the command takes that of the vehicle file. Without it that of the car.
        shift: One shift by its gears, such as ``"1-2"``; without it all shifts of the car.
        sensors: The sensors of the car: :class:`Sensors`, or a file whose table ``sensors`` describes them.
        program: Linked program of the controller, whose addresses go into the description for calibration tools.
        c: ``wetclutch.c``, the observer itself in C99, which is written as well: no library is needed then.
        fmu: Shared libraries of ``embedded/fmu``, each for another platform: the filter for co-simulation is written too.
        car_fmu: The same of ``embedded/car_fmu``: the simulated car with its shift controller.

    Returns:
        The paths of the files.

    Raises:
        InputError: The car has one shift only, there is no such shift, or a file is not what it should be.
        OSError: A file cannot be read or written.

    >>> import tempfile
    >>> files = export(Car.template("8hp", mass_kg=1900.0), tempfile.mkdtemp(), shift="1-2")
    >>> [file.name for file in files][:2]
    ['wetclutch.h', 'wetclutch_my_car.h']
    """

    def content(path: str | os.PathLike[str] | None) -> bytes | None:
        return None if path is None else Path(path).read_bytes()

    def paths(given: str | os.PathLike[str] | Iterable[str | os.PathLike[str]]) -> list[Path]:
        return [Path(path) for path in ([given] if isinstance(given, (str, os.PathLike)) else given)]

    check_car(car)
    own_name, text, gearbox = car._native
    with of_files(sensors):
        files = native.export(
            (f"{name or own_name}.toml", text, gearbox),
            shift,
            file_or_sensors(sensors),
            content(program),
            content(c),
            [path.read_bytes() for path in paths(fmu)],
            [path.read_bytes() for path in paths(car_fmu)],
        )
    into = Path(folder)
    into.mkdir(parents=True, exist_ok=True)
    # Each appears whole; none if one of them cannot be written.
    with tempfile.TemporaryDirectory(dir=into, prefix=".wetclutch-") as staging:
        for file, data in files:
            (Path(staging) / file).write_bytes(data)
        return [(Path(staging) / file).replace(into / file) for file, _ in files]
