"""Cars."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any, Self

from . import _wetclutch as native
from ._errors import InputError, check_range, of_files, of_texts
from ._toml import leaves, replaced, toml, without


def gearboxes() -> tuple[str, ...]:
    """Names of the gearboxes of the program.

    >>> "8hp" in gearboxes()
    True
    """
    return tuple(native.gearboxes())


class Car:
    """A car as its vehicle file describes it: with its whole gearbox, or as one of its shifts sees it.

    Two cars are equal if their files have the same text. A car is pickled as these texts, so that it can be sent to other processes.

    Attributes:
        name: Name of the car.
        kind: ``"gearbox"`` or ``"one-shift"``.
        gears: Names of its gears.
        elements: Names of the clutches, brakes and one-way clutches of its gearbox.
    """

    __slots__ = ("_gearbox", "_text", "elements", "gears", "kind", "name")

    name: str
    kind: str
    gears: tuple[str, ...]
    elements: tuple[str, ...]
    _text: str
    _gearbox: str | None

    def __init__(self, text: str, gearbox: str | None = None) -> None:
        """A car from the text of a vehicle file and, of a car with a gearbox, that of its gearbox file.

        Raises:
            InputError: Something in them is wrong; the error has line and key.
            InputErrors: Several things in them are wrong.
        """
        with of_texts("car.toml", text, gearbox):
            self._take(native.check_car("car.toml", text, gearbox))

    def _take(self, described: tuple[str, str, str, str | None, list[str], list[str]]) -> None:
        self.name, self.kind, self._text, self._gearbox, gears, elements = described
        self.gears, self.elements = tuple(gears), tuple(elements)

    @classmethod
    def _of(cls, described: tuple[str, str, str, str | None, list[str], list[str]]) -> Self:
        car = cls.__new__(cls)
        car._take(described)
        return car

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Self:
        """Reads a vehicle file, and the gearbox file that it names.

        Raises:
            InputError: A file cannot be read, or something in it is wrong; the error has file, line and key.
            InputErrors: Several things in it are wrong.
        """
        with of_files(path):
            return cls._of(native.read_car(os.fspath(path)))

    @classmethod
    def template(
        cls,
        gearbox: str,
        *,
        mass_kg: float,
        name: str = "my car",
        wheel_radius_m: float | None = None,
        final_ratio: float | None = None,
        engine_torque_n_m: float | None = None,
        converter: bool | None = None,
        stroke: bool = False,
    ) -> Self:
        """A car of a few numbers with one of the gearboxes of the program; what is not given is usual for a car of this mass.

        Args:
            gearbox: One of :func:`gearboxes`.
            mass_kg: Mass with driver, kg: 200 to 60000.
            name: Name of the car.
            wheel_radius_m: Rolling radius of the driven wheels, m: 0.1 to 1.
            final_ratio: Ratio from the gearbox output to the wheels, 0.5 to 10.
            engine_torque_n_m: Maximum engine torque, N m: 20 to 2000.
            converter: Whether a torque converter connects engine and gearbox, and not a clutch.
            stroke: Whether the pistons of the clutches have a stroke, so that the fill takes time.

        Raises:
            InputError: There is no such gearbox, or a number cannot be right.

        >>> Car.template("8hp", mass_kg=1900.0)
        Car('my car', 8 forward gears)
        """
        check_range("mass_kg", mass_kg, 200, 60000)
        check_range("wheel_radius_m", wheel_radius_m, 0.1, 1)
        check_range("final_ratio", final_ratio, 0.5, 10)
        check_range("engine_torque_n_m", engine_torque_n_m, 20, 2000)
        return cls._of(
            native.template_car(
                gearbox, name, mass_kg, wheel_radius_m, final_ratio, engine_torque_n_m, converter, stroke
            )
        )

    def to_toml(self) -> str:
        """The text of the vehicle file."""
        return self._text

    def gearbox_toml(self) -> str | None:
        """The text of the gearbox file; None of a file of one shift."""
        return self._gearbox

    def write(self, path: str | os.PathLike[str]) -> None:
        """Writes the vehicle file and, of a car with a gearbox, the gearbox file into the same folder. A gearbox file that the vehicle file
        names and that is there already stays where it is.

        Raises:
            FileExistsError: The gearbox file is there already and is another one, or a gearbox file has the name of the vehicle file.
        """
        path = os.fspath(path)
        text = self._text
        _refuse_gearbox_at(path)
        if self._gearbox is not None:
            import tomllib

            folder, named = os.path.dirname(path), tomllib.loads(text)["gearbox"]
            if _text_of(os.path.join(folder, named)) != self._gearbox:
                beside = os.path.basename(named)
                if beside == os.path.basename(path):
                    raise FileExistsError(f"{path}: the gearbox file of this car has the same name; give the vehicle file another one")
                there = _text_of(os.path.join(folder, beside))
                if there is None:
                    _write_whole(os.path.join(folder, beside), self._gearbox)
                elif there != self._gearbox:
                    message = f"{os.path.join(folder, beside)}: this file is there already, and is another gearbox"
                    raise FileExistsError(message)
                if beside != named:
                    text = _with_gearbox(text, beside)
        _write_whole(path, text)

    def replace(self, values: dict[str, Any] | None = None, /, **keys: Any) -> Self:
        """The same car with other values in its vehicle file.

        Args:
            values: New values by their keys in the file, such as ``{"vehicle.mass_kg": 1900.0}``.
            keys: The same with two underscores for the dot: ``vehicle__mass_kg=1900.0``.

        Raises:
            InputError: There is no such key, or a value cannot be right.
            InputErrors: This is so of several.

        >>> car = Car.template("8hp", mass_kg=1900.0)
        >>> car.replace(vehicle__mass_kg=2000.0) == car
        False
        """
        return type(self)(replaced(self._text, values, keys), self._gearbox)

    @property
    def budget(self) -> dict[str, Any]:
        """The bounds on errors that the vehicle file states, by their keys; all others have their defaults.

        >>> car = Car.template("8hp", mass_kg=1900.0).replace(error_bounds__engine_torque_share=0.05)
        >>> car.budget
        {'error_bounds.engine_torque_share': 0.05}
        """
        import tomllib

        return {key: value for key, value in leaves(tomllib.loads(self._text)) if _is_bound(key)}

    def _with_budget(self, budget: Mapping[str, Any]) -> Self:
        """The same car with these bounds on errors in place of those of its file."""
        import tomllib

        if not isinstance(budget, Mapping):
            raise InputError(f"budget is a {type(budget).__name__}", hint="give bounds by their keys, as car.budget has them", key="budget")
        for key in budget:
            if not isinstance(key, str) or not _is_bound(key):
                hint = "a bound is a key below `error_bounds`, as in car.budget"
                raise InputError(f"budget: `{key}` is no bound on an error", hint=hint, key=key)
        others = toml(without(_BOUNDS, tomllib.loads(self._text)))
        return type(self)(replaced(others, budget, {}), self._gearbox)

    @property
    def _native(self) -> tuple[str, str, str | None]:
        return self.name, self._text, self._gearbox

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Car):
            return NotImplemented
        return (self._text, self._gearbox) == (other._text, other._gearbox)

    def __hash__(self) -> int:
        return hash((self._text, self._gearbox))

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self._text, self._gearbox)

    def __repr__(self) -> str:
        if self.kind == "one-shift":
            return f"Car({self.name!r}, one shift)"
        forward = [gear for gear in self.gears if not gear.startswith("R")]
        return f"Car({self.name!r}, {len(forward)} forward gears)"


def check_car(car: object) -> None:
    """Refuses what is no car."""
    if not isinstance(car, Car):
        raise InputError(f"car is a {type(car).__name__}, and no Car", hint="give `wetclutch.Car.read(PATH)`", key="car")


#: The tables of bounds on errors.
_BOUNDS = "error_bounds"


def _is_bound(key: str) -> bool:
    return _BOUNDS in key.split(".")[:-1]


def _text_of(path: str) -> str | None:
    """The text of a file; None of one that is not there."""
    try:
        with open(path, encoding="utf-8", newline="") as file:
            return file.read()
    except FileNotFoundError:
        return None
    except (UnicodeDecodeError, IsADirectoryError):
        # Something else, which is not to be replaced.
        return ""


def _refuse_gearbox_at(path: str) -> None:
    """Refuses to write a vehicle file where a gearbox file is."""
    import tomllib

    try:
        is_gearbox = "gear" in tomllib.loads(_text_of(path) or "")
    except tomllib.TOMLDecodeError:
        is_gearbox = False
    if is_gearbox:
        raise FileExistsError(f"{path}: this file is there already, and is a gearbox file")


def _with_gearbox(text: str, named: str) -> str:
    """The text of a vehicle file that names another gearbox file; its comments stay."""
    import re

    line = re.compile(r"""^(gearbox\s*=\s*)("[^"\\]*"|'[^']*')""", re.MULTILINE)
    changed, count = line.subn(lambda found: f'{found[1]}"{named}"', text, count=1)
    return changed if count else replaced(text, {"gearbox": named}, {})


def _write_whole(path: str, text: str) -> None:
    partial = f"{path}.partial"
    with open(partial, "w", encoding="utf-8", newline="\n") as file:
        file.write(text)
    try:
        os.replace(partial, path)
    except OSError:
        os.remove(partial)
        raise
