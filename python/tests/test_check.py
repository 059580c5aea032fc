from __future__ import annotations

import pickle
from pathlib import Path

import pytest

import wetclutch as wc

from conftest import ROOT


def test_all_errors_of_a_file_are_raised_together(tmp_path: Path) -> None:
    text = (ROOT / "vehicles" / "two_speed_at.toml").read_text(encoding="utf-8")
    path = tmp_path / "car.toml"
    path.write_text(text.replace("mass_kg = 1500", "mass_kg = -1").replace("drag_coefficient =", "drag_coefficent ="), encoding="utf-8")
    with pytest.raises(ExceptionGroup) as raised:
        wc.check(path)
    errors = raised.value.exceptions
    assert len(errors) == 2 and "2 errors" in str(raised.value)
    for error in errors:
        assert isinstance(error, wc.InputError) and error.file == str(path) and error.line and error.key
    with pytest.raises(wc.InputErrors) as of_car:
        wc.Car.read(path)
    assert of_car.value.exceptions[0].line == errors[0].line and len(of_car.value.exceptions) == 2
    # As one error it is the first of them.
    with pytest.raises(wc.InputError) as first:
        wc.Car.read(path)
    assert (first.value.file, first.value.line, first.value.key) == (errors[0].file, errors[0].line, errors[0].key)
    again = pickle.loads(pickle.dumps(of_car.value))
    assert str(again) == str(of_car.value) and [error.hint for error in again.exceptions] == [error.hint for error in errors]
    caught = []
    try:
        wc.Car.read(path)
    except* wc.InputError as group:
        caught = list(group.exceptions)
    assert len(caught) == 2


def test_all_errors_of_a_drive_a_study_and_a_channel_map_are_raised_together(car: wc.Car, tmp_path: Path) -> None:
    def wrong(name: str, *replaced: tuple[str, str]) -> Path:
        text = (ROOT / name).read_text(encoding="utf-8")
        for old, new in replaced:
            assert old in text
            text = text.replace(old, new)
        path = tmp_path / Path(name).name
        path.write_text(text, encoding="utf-8")
        return path

    drive = wrong("drives/city.toml", ("sample_time_s = 0.01", "sample_time_s = -1.0"), ("repetitions =", "repetitons ="))
    with pytest.raises(wc.InputErrors):
        wc.simulate(car, drive)


def test_one_error_of_a_file_is_raised_alone(tmp_path: Path) -> None:
    path = tmp_path / "car.toml"
    path.write_text('name = "x"\ngearbox = "no_such.toml"\n', encoding="utf-8")
    with pytest.raises(wc.InputError) as raised:
        wc.Car.read(path)
    assert raised.value.file


def test_a_file_without_errors_is_quiet(tmp_path: Path) -> None:
    for file in ("vehicles/eight_speed.toml", "gearboxes/8hp.toml", "drives/city.toml", "experiments/combined.toml"):
        wc.check(ROOT / file)
    with pytest.raises(wc.InputError):
        wc.check(tmp_path / "no_such.toml")
