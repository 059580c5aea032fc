from __future__ import annotations

import copy
import math
from typing import Any

import pytest

import wetclutch as wc

from conftest import ROOT


def steps(measured: wc.Table, rows: int) -> list[dict[str, Any]]:
    """The rows of a log as arguments of steps: what is not read in a row is left out."""
    names = ["engine_speed_rad_s", "turbine_speed_rad_s", "output_speed_rad_s", "wheel_speed_rad_s"]
    names = [name for name in names if name in measured]
    taken = []
    for row in range(1, rows):
        step: dict[str, Any] = {"dt_s": measured["time_s"][row] - measured["time_s"][row - 1]}
        for name in names:
            if not math.isnan(measured[name][row]):
                step[name] = float(measured[name][row])
        step["gear"], step["target_gear"] = measured["gear"][row], measured["target_gear"][row]
        taken.append(step)
    return taken


def test_a_shift_has_estimates_of_both_clutches(car: wc.Car, measured: wc.Table) -> None:
    observer = wc.Observer(car)
    found = [observer.step(**step) for step in steps(measured, 6000)]
    shifting = [estimate for estimate in found if estimate.oncoming is not None]
    assert shifting and any(estimate.gear != estimate.target_gear for estimate in shifting)
    for estimate in shifting:
        assert estimate.oncoming is not None and estimate.offgoing is not None
        assert math.isfinite(estimate.oncoming.torque_n_m)
    elements = {name for estimate in found for name in estimate.valve_model_pressures_pa}
    assert elements <= set(car.elements)


def test_a_copy_goes_on_by_itself(car: wc.Car, measured: wc.Table) -> None:
    observer = wc.Observer(car)
    rows = steps(measured, 3000)
    for step in rows[:2000]:
        observer.step(**step)
    other = copy.deepcopy(observer)
    first = [observer.step(**step) for step in rows[2000:]]
    assert first == [other.step(**step) for step in rows[2000:]]
    assert observer.learnt == other.learnt
    assert wc.Observer(car, learnt=observer.learnt).learnt != wc.Observer(car).learnt


def test_the_shift_of_the_observer_is_commanded_where_a_step_has_no_gear(car: wc.Car, measured: wc.Table) -> None:
    given, by_default = wc.Observer(car), wc.Observer(car, shift="1-2")
    found = []
    for step in steps(measured, 3000):
        is_shift = (step["gear"], step["target_gear"]) == ("1", "2")
        found.append(given.step(**step))
        short = {name: value for name, value in step.items() if not (is_shift and "gear" in name)}
        assert by_default.step(**short) == found[-1]
    shifting = [estimate for estimate in found if (estimate.gear, estimate.target_gear) == ("1", "2")]
    assert shifting and "1-2" in repr(shifting[0])


@pytest.mark.parametrize("value", [math.nan, math.inf, -1e300, 0.0])
def test_readings_that_cannot_be_right_have_an_estimate(car: wc.Car, value: float) -> None:
    observer = wc.Observer(car)
    for dt_s in (0.01, 0.0, -1.0, math.nan, 1e9):
        estimate = observer.step(
            dt_s=dt_s,
            engine_speed_rad_s=value,
            turbine_speed_rad_s=(value, value),
            commands={name: value for name in car.elements},
            gear="2",
        )
        assert estimate == estimate and estimate.health


def test_what_an_observer_does_not_know_is_refused(car: wc.Car) -> None:
    observer = wc.Observer(car)
    with pytest.raises(wc.InputError, match="gear: there is no `9`") as raised:
        observer.step(dt_s=0.01, gear="9")
    assert raised.value.hint and "1, 2" in raised.value.hint
    with pytest.raises(wc.InputError, match="element: there is no `Z`"):
        observer.step(dt_s=0.01, commands={"Z": 1.0})
    with pytest.raises(wc.InputError, match="element: there is no"):
        observer.pressure_range_pa("Z")
    with pytest.raises(TypeError):
        observer.step()  # type: ignore[call-arg]
    with pytest.raises(TypeError):
        observer.step(dt_s=0.01, turbine_speed_rad_s="fast")  # type: ignore[arg-type]
    with pytest.raises(wc.InputError):
        wc.Observer(car, shift="1-9")
    with pytest.raises(wc.InputError, match="single shift"):
        wc.Observer(wc.Car.read(ROOT / "vehicles" / "two_speed_at.toml"))
