from __future__ import annotations

import copy
import os
import pickle
from pathlib import Path

import numpy as np
import pytest

import wetclutch as wc

from conftest import ROOT

SPEED = {"teeth": 58, "timer_s": 1e-6, "periods": 2, "sample_time_s": 0.01, "delay_s": 0.0, "noise_rad_s": 0.1}


def short_drive() -> wc.Drive:
    """The first minute of the city drive."""
    return wc.Drive.read(ROOT / "drives" / "city.toml").replace(repetitions=1)


def sensors() -> wc.Sensors:
    return wc.Sensors(engine=SPEED, turbine=SPEED, output=SPEED, wheel={**SPEED, "delay_s": 0.02}, seed=3)


def test_a_drive_that_is_read_gives_the_tables_of_its_file(car: wc.Car, run: wc.Simulation, drive_file: str) -> None:
    drive = wc.Drive.read(drive_file)
    truth, measured = wc.simulate(car, drive)
    assert truth == run.truth and measured == run.measured
    assert run.scores.rows > 3 and min(run.scores["oncoming_plates_degc"]) > 60 and max(run.scores["rating"]) <= 10
    assert drive.name == "city" and drive.duration_s == pytest.approx(run.truth["time_s"][-1], abs=1.0)
    assert drive.to_toml() == Path(drive_file).read_text(encoding="utf-8") and "city" in repr(drive)


def test_a_drive_pickles_compares_and_takes_other_values() -> None:
    drive = short_drive()
    for other in (pickle.loads(pickle.dumps(drive)), copy.deepcopy(drive), wc.Drive(drive.to_toml())):
        assert other == drive and hash(other) == hash(drive) and repr(other) == repr(drive)
    assert drive.replace({"repetitions": 2}).duration_s == 2 * drive.duration_s
    assert drive != drive.replace(repetitions=2) and drive != 3


def test_a_drive_that_follows_a_speed_is_read_from_any_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "cycle.csv").write_text("time_s,speed_km_h\n0,0\n10,30\n20,0\n", encoding="utf-8")
    (tmp_path / "cycle.toml").write_text('name = "cycle"\n[trace]\nfile = "cycle.csv"\n', encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    drive = wc.Drive.read("cycle.toml")
    monkeypatch.chdir(ROOT)
    assert wc.simulate(wc.Car.template("8hp", mass_kg=1900.0), pickle.loads(pickle.dumps(drive))).distance_m > 20.0


def test_all_errors_of_a_drive_and_of_sensors_are_raised_together(tmp_path: Path) -> None:
    text = short_drive().to_toml().replace("sample_time_s = 0.01", "sample_time_s = -1.0").replace("repetitions =", "repetitons =")
    # A vehicle file that is not there would be an error of the file too.
    text = text.replace("../vehicles", (ROOT / "vehicles").as_posix())
    path = tmp_path / "drive.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(wc.InputErrors) as of_file:
        wc.Drive.read(path)
    with pytest.raises(wc.InputErrors) as of_text:
        wc.Drive(text)
    assert len(of_file.value.exceptions) == len(of_text.value.exceptions) == 2
    assert [error.line for error in of_file.value.exceptions] == [error.line for error in of_text.value.exceptions]
    with pytest.raises(wc.InputErrors) as of_sensors:
        wc.Sensors(engine={**SPEED, "teeth": 0}, turbine=SPEED, output=SPEED, wheel={**SPEED, "delay": 0.02})
    assert {error.key for error in of_sensors.value.exceptions} >= {"sensors.engine.teeth"}
    with pytest.raises(wc.InputErrors, match="6 errors"):
        wc.Sensors(engine={}, turbine=SPEED, output=SPEED, wheel=SPEED)
    with pytest.raises(wc.InputError):
        wc.Drive.read(tmp_path / "no_such.toml")
    with pytest.raises(wc.InputError, match="sensors"):
        wc.Sensors.read(ROOT / "drives" / "city.toml")


def test_sensors_are_those_of_a_file_with_the_same_keys(car: wc.Car, tmp_path: Path) -> None:
    given = sensors()
    path = tmp_path / "sensors.toml"
    path.write_text(given.to_toml(), encoding="utf-8")
    assert wc.Sensors.read(path) == given and given != given.replace(seed=4) and given != 3
    assert pickle.loads(pickle.dumps(given)) == given == copy.deepcopy(given)
    drive = short_drive()
    simulated = wc.simulate(car, drive, sensors=given)
    assert simulated.measured == wc.simulate(car, drive, sensors=path).measured
    assert simulated.measured != wc.simulate(car, drive, sensors=given, seed=5).measured != wc.simulate(car, drive).measured
    assert wc.simulate(car, drive, sensors=given.replace(seed=5)).measured == wc.simulate(car, drive, sensors=given, seed=5).measured
    found = wc.estimate(car, simulated.measured, sensors=given)
    assert found == wc.estimate(car, simulated.measured, sensors=path) != wc.estimate(car, simulated.measured)
    assert wc.Observer(car, sensors=given) == pickle.loads(pickle.dumps(wc.Observer(car, sensors=given)))


def test_a_simulation_makes_the_errors_that_sensors_describe(car: wc.Car) -> None:
    lossy = sensors().replace({"turbine.missing_share": 0.2})
    measured = wc.simulate(car, short_drive(), sensors=lossy).measured
    came = np.isfinite(measured["turbine_speed_rad_s"]).mean()
    assert 0.7 < came < 0.9


def test_the_sensors_of_the_bench_are_read() -> None:
    given = wc.Sensors.read(os.fspath(ROOT / "experiments" / "bench.toml"))
    assert repr(given) == "Sensors(current, engine, turbine, output, wheel)"
