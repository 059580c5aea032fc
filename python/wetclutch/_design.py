"""Gains of an observer and their certificates."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from . import _wetclutch as native
from ._car import Car, check_car
from ._errors import InputError


@dataclass(frozen=True, slots=True)
class PhaseCertificate:
    """What is certified of the gains of one phase.

    Attributes:
        bound_pa: Steady-state bound on the error, Pa: of the pressure, or of the clutch torque as the pressure that gives it.
        open_loop_bound_pa: The same bound of the valve model alone, Pa.
        uses_open_loop: Whether no gain reduces the bound, so that the valve model alone is used.
        longest_step_s: The longest step over which the gains may correct the estimate, s.
        vertices: The vertices of the error system with the margin of the inequality at each, evaluated without the solver; none is negative.
    """

    bound_pa: float
    open_loop_bound_pa: float
    uses_open_loop: bool
    longest_step_s: float
    vertices: tuple[tuple[str, float], ...]


@dataclass(frozen=True, slots=True)
class Certificate:
    """What is certified of gains, by phase.

    Attributes:
        torque_phase: Of the phase in which the load moves from the offgoing to the oncoming clutch; None of the sliding-mode observer.
        inertia_phase: Of the phase in which both clutches slip; None of the sliding-mode observer.
        not_met: Requirements of the vehicle file that no certified gain meets, in sentences.
        text: Gains and certificates in JSON, with the keys of ``wetclutch design --json``.
    """

    torque_phase: PhaseCertificate | None
    inertia_phase: PhaseCertificate | None
    not_met: tuple[str, ...]
    text: str

    @property
    def offset_pa(self) -> float | None:
        """The largest offset of the estimate in both phases, Pa: the larger one of their steady-state bounds; None of the sliding-mode observer."""
        bounds = [phase.bound_pa for phase in (self.torque_phase, self.inertia_phase) if phase is not None]
        return max(bounds, default=None)

    def __repr__(self) -> str:
        phases = {"torque phase": self.torque_phase, "inertia phase": self.inertia_phase}
        bounds = [f"{name} {phase.bound_pa:.0f} Pa" for name, phase in phases.items() if phase is not None]
        return f"Certificate({', '.join(bounds) or 'none'})"


@dataclass(frozen=True, slots=True)
class ErrorSystem:
    """How the error of an estimate follows from its causes at a corner of the polytope, from sample to sample: ``x+ = A x + B w``, ``e = C x + D w``.

    Each cause ``w`` is -1 to 1 times its bound of the error budget; ``e`` is the error of the estimate.

    Attributes:
        phase: ``"torque_phase"`` or ``"inertia_phase"``.
        label: The corner: friction coefficient and lag of the valve.
        sample_time_s: Sample time, s.
        states: Names of the states and of the errors with their units; the pressure is the last.
        causes: Names of the causes; one that acts in several ways is there for each.
        a: ``A`` by rows.
        b: ``B`` by rows, in the units of the states.
        c: ``C`` by rows.
        d: ``D`` by rows, in the units of the states.
    """

    phase: str
    label: str
    sample_time_s: float
    states: tuple[str, ...]
    causes: tuple[str, ...]
    a: tuple[tuple[float, ...], ...]
    b: tuple[tuple[float, ...], ...]
    c: tuple[tuple[float, ...], ...]
    d: tuple[tuple[float, ...], ...]

    def to_control(self) -> Any:
        """The same as a ``control.StateSpace`` with these names; needs python-control."""
        import control

        # A name may be there once.
        numbers: dict[str, int] = {}
        inputs = []
        for cause in self.causes:
            numbers[cause] = numbers.get(cause, 0) + 1
            inputs.append(cause if numbers[cause] == 1 else f"{cause} {numbers[cause]}")
        return control.ss(
            self.a,
            self.b,
            self.c,
            self.d,
            self.sample_time_s,
            states=list(self.states),
            inputs=inputs,
            outputs=[f"{state}_error" for state in self.states],
            name=self.phase,
        )

    def __repr__(self) -> str:
        return f"ErrorSystem({self.phase}, {self.label}, {len(self.causes)} causes)"


@dataclass(frozen=True, slots=True)
class Gains:
    """Gains of an observer, by phase: their numbers by the names of ``wetclutch design --json``.

    Attributes:
        observer: The observer that they are for.
        torque_phase: Gains of the phase in which the load moves from the offgoing to the oncoming clutch.
        inertia_phase: Gains of the phase in which both clutches slip.
        error_systems: The error systems of gains for a sample time, of each phase at each corner; none of others.
    """

    observer: str
    torque_phase: Mapping[str, Any]
    inertia_phase: Mapping[str, Any]
    error_systems: tuple[ErrorSystem, ...] = ()

    def to_control(self, phase: str = "inertia_phase", corner: int = 0) -> Any:
        """The error system of a phase at a corner as a ``control.StateSpace``; needs python-control.

        Raises:
            InputError: There is none: the gains are not for a sample time.
        """
        systems = [system for system in self.error_systems if system.phase == phase]
        if not 0 <= corner < len(systems):
            hint = "design with a method for a sample time, such as peak-to-peak" if not systems else None
            raise InputError(f"there is no corner {corner} of {phase!r}: there are {len(systems)}", hint=hint)
        return systems[corner].to_control()

    def to_hex(self) -> dict[str, Any]:
        """The gains with each number in hexadecimal, in which it is exact."""
        return {"torque_phase": _hex(self.torque_phase), "inertia_phase": _hex(self.inertia_phase)}

    def __repr__(self) -> str:
        return f"Gains({self.observer}: {', '.join(self.inertia_phase)})"


def design(
    car: Car,
    *,
    shift: str | None = None,
    observer: str = "rigid",
    method: str | None = None,
    quantity: str | None = None,
    sample_time_s: float | None = None,
    kappa1_per_s: float | None = None,
    kappa2_per_s: float | None = None,
    error_bound: float | None = None,
    offset_max_pa: float | None = None,
) -> tuple[Gains, Certificate]:
    """Designs the gains of an observer for an upshift. The results are those of ``wetclutch design``.

    Args:
        car: The car.
        shift: The shift of a car with a gearbox, such as ``"1-2"``.
        observer: ``"rigid"``, ``"compliant"`` or ``"sliding"``; the last one has no certificate.
        method: ``"iss"`` (in continuous time; used if none is given), or for a sample time ``"iss-discrete"``, ``"peak-to-peak"``,
            ``"scheduled"`` or ``"interval"``.
        quantity: What the bound of a method for a sample time is on: ``"clutch-torque"`` (used if none is given) or ``"pressure"``.
        sample_time_s: Sample time of such a method, s: 0.0001 to 0.2; 0.01 if none is given.
        kappa1_per_s: ``kappa1`` of the method ``"iss"``, 1/s: 0.01 to 10000; this and the following ones replace the values of the file.
        kappa2_per_s: ``kappa2``, the decay rate of the error, 1/s: 0.4 to 800.
        error_bound: Bound on the model error, rad/s^2 of the rigid observer and normalised of the compliant one: 0 to 1e6.
        offset_max_pa: Largest acceptable offset of the estimate, Pa: 1e3 to 1e7.

    Returns:
        Gains and certificate.

    Raises:
        InputError: There is no such shift, or an argument is out of range or has no effect.
        WorkError: The design has no solution.

    >>> gains, certificate = design(Car.template("8hp", mass_kg=1900.0), shift="1-2", method="peak-to-peak")
    >>> certificate.inertia_phase.bound_pa < certificate.inertia_phase.open_loop_bound_pa
    True
    """
    check_car(car)
    options = {
        "observer": observer,
        "method": method,
        "quantity": quantity,
        "sample_time_s": sample_time_s,
        "kappa1_per_s": kappa1_per_s,
        "kappa2_per_s": kappa2_per_s,
        "error_bound": error_bound,
        "offset_max_pa": offset_max_pa,
    }
    text, not_met, models = native.design(car._native, shift, options)
    torque, inertia = (json.loads(text)[phase] for phase in ("torque_phase", "inertia_phase"))
    certificate = Certificate(_certificate(torque), _certificate(inertia), tuple(not_met), text)
    systems = tuple(_error_system(phase, model, inertia["sample_time_s"]) for phase, model in json.loads(models))
    return Gains(observer, _gains(torque), _gains(inertia), systems), certificate


#: What of the object of a phase is a gain.
_GAINS = ("gain_pa_s_rad", "gain_normalised", "gains", "speed_rad_s2", "pressure_pa_s")


def _gains(phase: Mapping[str, Any]) -> dict[str, Any]:
    return {name: phase[name] for name in _GAINS if name in phase}


def _error_system(phase: str, model: Mapping[str, Any], sample_time_s: float) -> ErrorSystem:
    a, b, c, d = (tuple(tuple(row) for row in model[name]) for name in "abcd")
    states, causes = tuple(model["states"]), tuple(model["causes"])
    return ErrorSystem(phase, model["label"], sample_time_s, states, causes, a, b, c, d)


def _certificate(phase: Mapping[str, Any]) -> PhaseCertificate | None:
    if "open_loop_bound_pa" not in phase:
        return None
    return PhaseCertificate(
        bound_pa=phase["bound_pa"] if "bound_pa" in phase else phase["offset_pa"],
        open_loop_bound_pa=phase["open_loop_bound_pa"],
        uses_open_loop=phase["uses_open_loop"],
        longest_step_s=phase["longest_step_s"],
        vertices=tuple(_vertices(phase)),
    )


def _vertices(phase: Mapping[str, Any]) -> list[tuple[str, float]]:
    if "margins" in phase:
        return [(margin["label"], margin["least"]) for margin in phase["margins"]]
    return [(vertex.get("label") or vertex["vertex"]["label"], vertex["margin_per_s"]) for vertex in phase["vertices"]]


def _hex(value: Any) -> Any:
    match value:
        case float():
            return value.hex()
        case Mapping():
            return {name: _hex(item) for name, item in value.items()}
        case list():
            return [_hex(item) for item in value]
        case _:
            return value
