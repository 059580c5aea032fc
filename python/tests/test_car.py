from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

import wetclutch as wc

from conftest import ROOT


@pytest.mark.parametrize("name", ["eight_speed", "six_speed", "dual_clutch", "two_speed_at", "two_speed_pwm"])
def test_a_car_is_the_same_after_pickle_copy_and_its_own_text(name: str) -> None:
    car = wc.Car.read(ROOT / "vehicles" / f"{name}.toml")
    for other in (
        pickle.loads(pickle.dumps(car)),
        copy.deepcopy(car),
        wc.Car(car.to_toml(), car.gearbox_toml()),
    ):
        assert other == car and hash(other) == hash(car) and other.gears == car.gears


def test_a_template_can_be_written_and_read_again(tmp_path: Path) -> None:
    for gearbox in wc.gearboxes():
        car = wc.Car.template(gearbox, mass_kg=1500.0)
        folder = tmp_path / gearbox
        folder.mkdir()
        car.write(folder / "car.toml")
        assert wc.Car.read(folder / "car.toml") == car
        assert len(car.gears) >= 4 and car.kind == "gearbox"


def test_a_written_car_does_not_replace_another_gearbox(tmp_path: Path) -> None:
    car = wc.Car.template("8hp", mass_kg=1900.0)
    (tmp_path / "8hp.toml").write_text("another one")
    with pytest.raises(FileExistsError, match="another gearbox"):
        car.write(tmp_path / "car.toml")
    assert not (tmp_path / "car.toml").exists()


def test_a_car_of_another_folder_is_written_with_its_gearbox_beside(tmp_path: Path) -> None:
    car = wc.Car.read(ROOT / "vehicles" / "six_speed.toml").replace(vehicle__mass_kg=2000.0)
    car.write(tmp_path / "mine.toml")
    again = wc.Car.read(tmp_path / "mine.toml")
    assert again.gearbox_toml() == car.gearbox_toml() and again.replace(gearbox="../gearboxes/lepelletier_6.toml") == car
    assert sorted(path.name for path in tmp_path.iterdir()) == ["lepelletier_6.toml", "mine.toml"]


def test_what_is_no_car_or_log_is_an_error_of_the_argument() -> None:
    car = wc.Car.template("8hp", mass_kg=1900.0)
    log = {"time_s": [0.0, 0.01], "turbine_speed_rad_s": [100.0, 101.0]}
    for call in (
        lambda: wc.estimate("car.toml", log),  # type: ignore[call-overload]
        lambda: wc.fit("car.toml", [log]),  # type: ignore[call-overload]
        lambda: wc.estimate(car, None),
        lambda: wc.estimate(car, log, learnt="learnt.toml"),
        lambda: wc.Table({"a": [object()]}),
        lambda: wc.Table({"a": np.ones((2, 2))}),
        lambda: wc.Table({"a": [1.0], "b": [1.0, 2.0]}),
    ):
        with pytest.raises(wc.InputError) as wrong:
            call()
        assert wrong.value.hint


def test_keys_are_replaced_and_checked() -> None:
    car = wc.Car.template("8hp", mass_kg=1900.0)
    heavier = car.replace(vehicle__mass_kg=2100.0)
    assert heavier.replace({"vehicle.mass_kg": 1900.0}) == car.replace({"vehicle.mass_kg": 1900.0})
    assert heavier != car
    with pytest.raises(wc.InputError) as wrong:
        car.replace(vehicle__mass_kg=-1.0)
    assert wrong.value.key == "vehicle.mass_kg" and wrong.value.line is not None
    with pytest.raises(wc.InputError) as unknown:
        car.replace(vehicle__mass=1900.0)
    assert unknown.value.line is not None


def test_errors_have_their_parts_and_pickle(tmp_path: Path) -> None:
    path = tmp_path / "car.toml"
    path.write_text('name = "x"\ngearbox = "no_such.toml"\n')
    with pytest.raises(wc.InputError) as raised:
        wc.Car.read(path)
    error = raised.value
    assert error.file is not None and isinstance(error, ValueError)
    again = pickle.loads(pickle.dumps(error))
    assert (again.message, again.hint, again.file, again.line, again.key) == (
        error.message,
        error.hint,
        error.file,
        error.line,
        error.key,
    )


def test_arguments_that_cannot_be_right_are_named() -> None:
    with pytest.raises(wc.InputError, match="gearboxes are"):
        wc.Car.template("9hp", mass_kg=1900.0)
    for name, value in [("mass_kg", -5.0), ("mass_kg", float("nan")), ("wheel_radius_m", 9.0), ("final_ratio", 99.0), ("engine_torque_n_m", 1.0)]:
        with pytest.raises(wc.InputError, match=f"{name} is {value}, expected .* to ") as raised:
            wc.Car.template("8hp", **{"mass_kg": 1900.0, name: value})
        assert raised.value.key == name
    with pytest.raises(TypeError):
        wc.Car.template("8hp")  # type: ignore[call-arg]


def test_all_errors_of_texts_are_raised_together() -> None:
    car = wc.Car.template("8hp", mass_kg=1900.0)
    with pytest.raises(wc.InputErrors) as of_keys:
        car.replace(vehicle__mass_kg=-1.0, vehicle__mas=3.0)
    assert len(of_keys.value.exceptions) == 2 and all(error.line for error in of_keys.value.exceptions)
    text, gearbox = car.to_toml(), car.gearbox_toml()
    assert gearbox is not None
    with pytest.raises(wc.InputErrors) as of_gearbox:
        wc.Car(text, gearbox.replace("inertia_kg_m2 = 0", "inertia_kg_m2 = -9"))
    assert len(of_gearbox.value.exceptions) > 1
    with pytest.raises(wc.InputErrors):
        wc.Car(wc.Car.read(ROOT / "vehicles" / "two_speed_at.toml").replace().to_toml().replace("mass_kg = ", "mass_kg = -").replace("drag_", "drg_"))


def test_numbers_of_numpy_and_any_letter_can_be_values() -> None:
    car = wc.Car.template("8hp", mass_kg=1900.0)
    assert car.replace(vehicle__mass_kg=np.float64(2000.0)) == car.replace(vehicle__mass_kg=2000.0)
    assert car.replace(vehicle__mass_kg=np.int32(2000)) == car.replace(vehicle__mass_kg=2000)
    name = 'a "b" \\ \U000e0001 \u00f6'
    assert car.replace(name=name).name == name


def test_the_budget_of_a_car_has_the_bounds_that_its_file_states() -> None:
    car = wc.Car.template("8hp", mass_kg=1900.0)
    assert car.budget == {}
    bounded = car.replace({"error_bounds.engine_torque_share": 0.05, "clutch.A.error_bounds.friction_factor": [0.7, 1.3]})
    assert bounded.budget == {"error_bounds.engine_torque_share": 0.05, "clutch.A.error_bounds.friction_factor": [0.7, 1.3]}


def test_a_budget_takes_the_place_of_that_of_the_car(car: wc.Car, measured: wc.Table) -> None:
    plain = wc.estimate(car, measured)
    bounded = car.replace({"clutch.C.error_bounds.friction_factor": [0.6, 1.4]})
    wider = wc.estimate(bounded, measured)
    assert wider != plain and wc.estimate(bounded, measured, budget=bounded.budget) == wider
    assert wc.estimate(bounded, measured, budget={}) == plain
    assert wc.estimate(car, measured, budget=bounded.budget) == wider
    assert wc.estimate(car, [measured], budget=bounded.budget) == (wider,)
    with pytest.raises(wc.InputError, match="no bound on an error") as raised:
        wc.estimate(car, measured, budget={"vehicle.mass_kg": 1900.0})
    assert raised.value.key == "vehicle.mass_kg" and raised.value.hint
    with pytest.raises(wc.InputError, match="expected"):
        wc.estimate(car, measured, budget={"clutch.C.error_bounds.friction_factor": [-1.0, 2.0]})


def test_a_vehicle_file_and_a_gearbox_file_do_not_replace_each_other(tmp_path: Path) -> None:
    car = wc.Car.template("8hp", mass_kg=1900.0)
    with pytest.raises(FileExistsError, match="same name"):
        car.write(tmp_path / "8hp.toml")
    car.write(tmp_path / "car.toml")
    before = (tmp_path / "8hp.toml").read_text()
    with pytest.raises(FileExistsError, match="is a gearbox file"):
        wc.Car.template("lepelletier_6", mass_kg=1900.0).write(tmp_path / "8hp.toml")
    assert (tmp_path / "8hp.toml").read_text() == before
    (tmp_path / "folder").mkdir()
    with pytest.raises(OSError):
        car.write(tmp_path / "folder")
    assert not list(tmp_path.glob("*.partial"))


@pytest.mark.parametrize("mass_kg", [200.0, 20_000.0, 60_000.0])
@pytest.mark.parametrize("gearbox", wc.gearboxes())
def test_every_mass_has_a_template(gearbox: str, mass_kg: float) -> None:
    assert wc.Car.template(gearbox, mass_kg=mass_kg).gears


def test_a_gear_is_not_called_as_none_is(car: wc.Car) -> None:
    gearbox = car.gearbox_toml()
    assert gearbox is not None
    for name in ("N", "P", "0", "nan"):
        with pytest.raises(wc.InputError, match="stands for no gear"):
            wc.Car(car.to_toml(), gearbox.replace('name = "2"', f'name = "{name}"'))


def test_wrong_arguments_of_every_function_are_named(car: wc.Car, tmp_path: Path) -> None:
    drive = wc.Drive("name = 'start'\n[[segment]]\nduration_s = 1.0\nthrottle = 0.2\n")
    frame = {"time_s": [0.0, 0.01]}
    x: Any = "x"
    calls: list[Callable[[], object]] = [
        lambda: wc.design(x),
        lambda: wc.export(x, tmp_path),
        lambda: wc.simulate(x, drive),
        lambda: wc.Observer(x),
        lambda: car.replace({"vehicle.mass_kg": np.array([1950.0, 1.0])}),
        lambda: car.replace(cast("Any", {1: 1})),
        lambda: wc.estimate(car, frame, budget=cast("Any", [1])),
        lambda: wc.estimate(car, frame, columns=cast("Any", [1])),
        lambda: wc.estimate(car, frame, shift=cast("Any", 1.5)),
        lambda: wc.read(frame, channels=cast("Any", ["a"])),
        lambda: wc.read(frame, channels=cast("Any", {"turbine_speed": None})),
        lambda: wc.fit(car, []),
    ]
    for call in calls:
        with pytest.raises(wc.InputError):
            call()
