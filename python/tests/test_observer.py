from __future__ import annotations

import copy
import math
import pickle
from pathlib import Path
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


def test_an_acceleration_is_taken_once_it_is_stated(car: wc.Car) -> None:
    speed = {"teeth": 58, "timer_s": 1e-6, "periods": 2, "sample_time_s": 0.01, "delay_s": 0.0, "noise_rad_s": 0.1}
    sensors = wc.Sensors(engine=speed, turbine=speed, output=speed, wheel=speed, acceleration={"noise_m_s2": 0.05})
    drive = wc.Drive.read(ROOT / "drives" / "city.toml").replace(repetitions=1)
    log = wc.simulate(car, drive, sensors=sensors).measured
    assert "longitudinal_acceleration_m_s2" in log
    rows = steps(log, 1200)
    acceleration = [float(log["longitudinal_acceleration_m_s2"][row]) for row in range(1, 1200)]
    observers = [wc.Observer(car, sensors=sensors) for _ in range(2)]
    torques: list[list[float | None]] = [[], []]
    for step, value in zip(rows, acceleration):
        for observer, given, torque in zip(observers, [(value, 0.0), None], torques):
            estimate = observer.step(**step, acceleration_m_s2=given)
            torque.append(estimate.shaft_torque_n_m)
    assert torques[0] != torques[1]
    assert "longitudinal_acceleration_reading" in wc.estimate(car, log, sensors=sensors).rows


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


def test_a_pickled_observer_goes_on_to_the_last_bit(car: wc.Car, measured: wc.Table, tmp_path: Path) -> None:
    sensors = tmp_path / "bench.toml"
    sensors.write_text((ROOT / "experiments" / "bench.toml").read_text(encoding="utf-8"), encoding="utf-8")
    observer = wc.Observer(car, shift="1-2", sensors=sensors, learnt=wc.estimate(car, measured).learnt)
    sensors.unlink()
    rows = steps(measured, 3000)
    phases = set()
    for at, step in enumerate(rows):
        estimate = observer.step(**step)
        if at % 500 == 0 or estimate.phase not in phases:
            phases.add(estimate.phase)
            other = pickle.loads(pickle.dumps(observer))
            assert other == observer and repr(other) == repr(observer)
            ahead = [copy.copy(observer), other]
            first, second = ([one.step(**step) for step in rows[at + 1 : at + 200]] for one in ahead)
            assert first == second and ahead[0] == ahead[1] and ahead[0].learnt == ahead[1].learnt
    assert {"in_gear", "both_slip"} <= phases


def test_observers_are_equal_if_they_go_on_equally(car: wc.Car, measured: wc.Table) -> None:
    observer, other = wc.Observer(car), wc.Observer(car)
    assert observer == other and observer != wc.Observer(car, shift="1-2") and observer != 3
    for step in steps(measured, 50):
        observer.step(**step)
        assert observer != other
        other.step(**step)
        assert observer == other
    with pytest.raises(TypeError):
        hash(observer)


def test_a_pickle_of_another_version_is_refused(car: wc.Car) -> None:
    pickled = pickle.dumps(wc.Observer(car))
    version = wc.__version__.encode()
    assert pickled.count(version) >= 1
    with pytest.raises(wc.InputError, match=f"is of version 9.*this is {wc.__version__}") as raised:
        pickle.loads(pickled.replace(version, b"9" + version[1:]))
    assert raised.value.hint


def test_estimates_of_steps_pickle_and_copy(car: wc.Car, measured: wc.Table) -> None:
    observer = wc.Observer(car)
    for step in steps(measured, 3000):
        estimate = observer.step(**step)
    for other in (pickle.loads(pickle.dumps(estimate)), copy.deepcopy(estimate)):
        assert other == estimate and other.valve_model_pressures_pa == estimate.valve_model_pressures_pa
        assert repr(other) == repr(estimate) and other.gear == estimate.gear
    clutches = [clutch for clutch in map(lambda step: observer.step(**step).oncoming, steps(measured, 3000)) if clutch is not None]
    assert clutches
    for clutch in clutches[::10]:
        assert pickle.loads(pickle.dumps(clutch)) == clutch and clutch.pressure_deviation_pa >= 0.0
    assert clutches[0] != clutches[-1]
    with pytest.raises(wc.InputError, match="damaged"):
        wc._wetclutch.restored_step(b"")  # type: ignore[attr-defined]


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
