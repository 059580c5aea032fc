from __future__ import annotations

from pathlib import Path

import pytest

import wetclutch as wc

np = pytest.importorskip("numpy")
pd = pytest.importorskip("pandas")

RPM = 30.0 / np.pi


def test_channels_of_a_table_and_a_file_are_the_same(measured: wc.Table, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    measured.to_pandas().to_csv(path, index=False)
    in_memory, in_file = wc.read(measured).channels.to_pandas(), wc.read(path).channels.to_pandas()
    assert list(in_memory.channel) == list(in_file.channel)
    speed = in_memory.set_index("channel").loc["turbine_speed_rad_s"]
    assert speed.samples == measured.rows and speed.maximum == pytest.approx(np.nanmax(measured["turbine_speed_rad_s"]))
    assert speed.period_s == pytest.approx(0.01) and speed.gaps == 0 and np.isnan(speed.longest_gap_s)


def test_a_suggested_map_reads_the_log(measured: wc.Table, tmp_path: Path) -> None:
    frame = measured.to_pandas()
    for name, channel in {"turbine_speed_rad_s": "nTurbine_rpm", "output_speed_rad_s": "nOutput_rpm"}.items():
        frame[channel] = RPM * frame.pop(name)
    text = wc.read(frame).suggest()
    assert "turbine_speed" in text and "nTurbine" in text
    path = tmp_path / "map.toml"
    path.write_text(text, encoding="utf-8")
    log = wc.read(frame, map=path)
    assert "inertia_from_s" in log.shifts([3.0, 2.0, 1.0])


def test_shifts_of_a_log_are_those_of_its_estimate(car: wc.Car, measured: wc.Table) -> None:
    in_gear = np.array(measured["gear"]) == np.array(measured["target_gear"])
    speeds = np.asarray(measured["turbine_speed_rad_s"]), np.asarray(measured["output_speed_rad_s"])

    def ratio(gear: str) -> float:
        part = in_gear & (np.array(measured["gear"]) == gear) & (speeds[1] > 20.0)
        return float(np.median(speeds[0][part] / speeds[1][part]))

    driven = [gear for gear in car.gears if gear.isdigit() and gear in measured["gear"]]
    shifts = wc.read(measured).shifts([ratio(gear) for gear in driven])
    estimated = wc.estimate(car, measured).shifts
    assert abs(shifts.rows - estimated.rows) <= 2
    assert {"upshift", "downshift"} & {word for kind in shifts["kind"] for word in kind.split()}
    begins = np.asarray(estimated["time_s"])
    assert all(np.abs(begins - begin).min() < 1.5 for begin in np.asarray(shifts["inertia_from_s"]))


def test_what_is_no_log_is_refused() -> None:
    with pytest.raises(wc.InputError):
        wc.read({"time_s": [0.0, 0.01], "speed": [1.0, 2.0]}).shifts()
    with pytest.raises(wc.InputError):
        _ = wc.read("no_such.csv").channels
