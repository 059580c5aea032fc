from __future__ import annotations

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
    with pytest.raises(wc.InputError):
        wc.Car.read(path)


def test_a_file_without_errors_is_quiet(tmp_path: Path) -> None:
    for file in ("vehicles/eight_speed.toml", "gearboxes/8hp.toml", "drives/city.toml", "experiments/combined.toml"):
        wc.check(ROOT / file)
    with pytest.raises(wc.InputError):
        wc.check(tmp_path / "no_such.toml")
