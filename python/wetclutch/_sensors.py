"""Sensors of a car."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any, ClassVar, Self

from . import _wetclutch as native
from ._errors import of_files, of_texts
from ._toml import replaced, toml


class Sensors:
    """The sensors of a car, as a table ``sensors`` of a file describes them: for :func:`simulate`, :func:`estimate`, :func:`fit` and :class:`Observer`.

    A simulation makes the errors of the readings that they describe; an estimate is not given them. Two are equal if their tables are.

    >>> speed = {"teeth": 58, "timer_s": 1e-6, "periods": 2, "sample_time_s": 0.01, "delay_s": 0.0, "noise_rad_s": 0.1}
    >>> Sensors(engine=speed, turbine=speed, output=speed, wheel=speed).replace(wheel__delay_s=0.02) == Sensors(
    ...     engine=speed, turbine=speed, output=speed, wheel={**speed, "delay_s": 0.02}
    ... )
    True
    """

    __slots__ = ("_text",)

    _text: str

    def __init__(
        self,
        *,
        engine: Mapping[str, float],
        turbine: Mapping[str, float],
        output: Mapping[str, float],
        wheel: Mapping[str, float],
        current: Mapping[str, float] | None = None,
        acceleration: Mapping[str, float] | None = None,
        seed: int = 0,
        row_offset_s: float | None = None,
        missing_share: float | None = None,
        outliers: int | None = None,
    ) -> None:
        """Sensors by the keys of their tables.

        Args:
            engine: Of the engine speed: ``teeth``, ``timer_s``, ``periods``, ``sample_time_s``, ``delay_s`` and ``noise_rad_s``; where they
                are given also ``offset_s``, ``scale``, ``missing_share``, ``burst_s``, ``frozen_s``, ``outliers`` and ``outlier_rad_s``.
            turbine: Of the turbine speed.
            output: Of the output speed.
            wheel: Of the speed of the driven wheels.
            current: Of the commands of the valves: ``noise_a``, ``offset_a`` and ``resolution_a``; where they are given also
                ``sample_time_s``, ``offset_s``, ``delay_s``, ``scale``, ``missing_share``, ``burst_s``, ``frozen_s``, ``outliers`` and
                ``outlier_a``. None for readings that are the commands.
            acceleration: Of the longitudinal acceleration, each where it is given: ``noise_m_s2``, ``bias_m_s2``, ``resolution_m_s2``,
                ``sample_time_s``, ``offset_s``, ``delay_s``, ``scale``, ``missing_share``, ``burst_s``, ``frozen_s``, ``outliers`` and
                ``outlier_m_s2``. None for a car that does not measure it.
            seed: Seed of the random numbers of a simulation.
            row_offset_s: Time of the rows against the ticks of the controller, s.
            missing_share: Fraction of the readings of all channels that are lost, 0 to 1.
            outliers: How many outliers are spread over the speeds at random.

        Raises:
            InputError: A key is missing or unknown, or a value is out of its range; the error has the key.
            InputErrors: This is so of several.
        """
        given = {
            "seed": seed,
            "row_offset_s": row_offset_s,
            "missing_share": missing_share,
            "outliers": outliers,
            "engine": dict(engine),
            "turbine": dict(turbine),
            "output": dict(output),
            "wheel": dict(wheel),
            "current": None if current is None else dict(current),
            "acceleration": None if acceleration is None else dict(acceleration),
        }
        self._take(toml({"sensors": {key: value for key, value in given.items() if value is not None}}))

    def _take(self, text: str) -> None:
        self._text = text
        with of_texts(*self._source):
            native.check_sensors(self)

    @property
    def _source(self) -> tuple[str, str]:
        return "sensors.toml", self._text

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Self:
        """Reads the table ``sensors`` of a file of any kind.

        Raises:
            InputError: The file cannot be read, has no such table, or something in it is wrong; the error has file, line and key.
            InputErrors: Several things in it are wrong.
        """
        import tomllib

        sensors = cls.__new__(cls)
        with of_files(path):
            table = tomllib.loads(native.check_sensors(os.fspath(path)))["sensors"]
        sensors._text = toml({"sensors": table})
        return sensors

    def to_toml(self) -> str:
        """The table as text."""
        return self._text

    def replace(self, values: dict[str, Any] | None = None, /, **keys: Any) -> Self:
        """The same sensors with other values, such as ``wheel__delay_s=0.02`` or ``{"wheel.delay_s": 0.02}``.

        Raises:
            InputError: There is no such key, or a value cannot be right.
            InputErrors: This is so of several.
        """
        of_table = {f"sensors.{key}": value for key, value in (values or {}).items()}
        of_table |= {f"sensors.{key.replace('__', '.')}": value for key, value in keys.items()}
        sensors = type(self).__new__(type(self))
        sensors._take(replaced(self._text, of_table, {}))
        return sensors

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Sensors):
            return NotImplemented
        import tomllib

        return tomllib.loads(self._text) == tomllib.loads(other._text)

    __hash__: ClassVar[None] = None  # type: ignore[assignment]

    def __getstate__(self) -> str:
        return self._text

    def __setstate__(self, text: str) -> None:
        self._text = text

    def __repr__(self) -> str:
        import tomllib

        return f"Sensors({', '.join(key for key, value in tomllib.loads(self._text)['sensors'].items() if isinstance(value, dict))})"


def file_or_sensors(given: Sensors | str | os.PathLike[str] | None) -> Sensors | str | None:
    """Sensors as the native part takes them: a path as text."""
    return given if given is None or isinstance(given, Sensors) else os.fspath(given)
