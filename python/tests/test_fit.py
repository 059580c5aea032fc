from __future__ import annotations

import os
import pickle
import signal
import subprocess
import threading
import time
from pathlib import Path

import pytest

import wetclutch as wc

from conftest import ROOT

np = pytest.importorskip("numpy")
pa = pytest.importorskip("pyarrow")
pl = pytest.importorskip("polars")


@pytest.fixture(scope="module")
def fitted(car: wc.Car, measured: wc.Table) -> wc.Fit:
    return wc.fit(car, measured, page=True)


def test_a_fitted_car_is_used_at_once(car: wc.Car, measured: wc.Table, fitted: wc.Fit) -> None:
    assert fitted.shifts > 3 and fitted.car.gears == car.gears and fitted.car != car
    assert wc.estimate(fitted.car, measured).shifts.rows > 3
    table = pa.table(fitted.intervals)
    assert table.num_rows > 10 and set(table["unit"].to_pylist()) <= {"1", "s", "Pa", "N m"}
    assert all(low <= at <= high for low, at, high in zip(*(fitted.intervals[name] for name in ("lower", "value", "upper"))))
    assert set(fitted.not_identifiable) < set(fitted.intervals["parameter"])
    assert list(fitted.channel_map) == ["signal", "key", "unit", "value", "standard_deviation"]
    assert fitted.page and "<html" in fitted.page and fitted._repr_html_()
    assert len(repr(fitted)) < 120 and pickle.loads(pickle.dumps(fitted)) == fitted


def test_the_command_gives_the_same_fit(measured: wc.Table, fitted: wc.Fit, tmp_path: Path) -> None:
    command = os.environ.get("WETCLUTCH")
    if not command:
        pytest.skip("WETCLUTCH names no binary")
    log, vehicle, out = tmp_path / "log.csv", ROOT / "vehicles" / "six_speed.toml", tmp_path / "fitted.toml"
    measured.to_pandas().to_csv(log, index=False)
    subprocess.run([command, "fit", log, "--vehicle", vehicle, "-o", out], check=True, capture_output=True)
    values = [line for line in out.read_text().splitlines() if not line.startswith(("#", "gearbox"))]
    assert values == [line for line in fitted.car.to_toml().splitlines() if not line.startswith(("#", "gearbox"))]


def test_valves_and_friction_are_fitted_by_oil_temperature(car: wc.Car, measured: wc.Table, fitted: wc.Fit) -> None:
    assert fitted.adaptations is None
    log = {name: measured[name] for name in measured} | {"oil_temperature_degc": np.full(measured.rows, 64.0)}
    adapted = wc.fit(car, log, oil_step=20, page=True)
    table = adapted.adaptations
    assert "Adaptation table" in (adapted.page or "")
    assert table is not None and table.rows > 20 and set(table["oil_from_degc"]) == {60.0}
    assert set(table["quantity"]) == {"fill time", "kiss point", "valve lag", "valve delay", "friction x valve gain"}
    with pytest.raises(wc.InputError, match="the step of the oil temperature is 1 K"):
        wc.fit(car, log, oil_step=1)


def test_several_logs_are_fitted_together(car: wc.Car, measured: wc.Table, fitted: wc.Fit) -> None:
    half = measured.rows // 2
    parts = [{name: measured[name][part] for name in measured} for part in (slice(0, half), slice(half, None))]
    both = wc.fit(car, parts)
    assert abs(both.shifts - fitted.shifts) <= 1
    copied = wc.fit(car, [measured, measured])
    assert copied.shifts == fitted.shifts and any("the same readings" in finding for finding in copied.findings)


def test_a_car_of_one_shift_is_fitted_to_a_file_as_to_a_table(tmp_path: Path) -> None:
    two_speed = wc.Car.read(ROOT / "vehicles" / "two_speed_at.toml")
    with pytest.raises(wc.InputError, match="a fit needs"):
        wc.fit(two_speed, {"time_s": [0.0, 0.01], "turbine_speed_rad_s": [100.0, 100.0]})
    command = os.environ.get("WETCLUTCH")
    if not command:
        pytest.skip("WETCLUTCH names no binary")
    subprocess.run([command, "simulate", ROOT / "experiments" / "bench.toml", "-o", tmp_path], check=True, capture_output=True)
    path = tmp_path / "bench_measured.csv"
    in_file, in_memory = (wc.fit(two_speed, log, page=True) for log in (path, pl.read_csv(path)))
    assert in_file.shifts == in_memory.shifts == 1 and in_file.intervals == in_memory.intervals
    assert in_memory.car.kind == "one-shift" and in_memory.page
    values = [[line for line in fit.car.to_toml().splitlines() if not line.startswith("#")] for fit in (in_file, in_memory)]
    assert values[0] == values[1]


def test_intervals_are_drawn(fitted: wc.Fit) -> None:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    axis = fitted.plot()
    assert [label.get_text() for label in axis.get_yticklabels()] == fitted.intervals["parameter"]


@pytest.mark.parametrize("has_oil", [True, False])
def test_adaptations_are_drawn_over_the_temperature_or_by_clutch(car: wc.Car, measured: wc.Table, fitted: wc.Fit, has_oil: bool) -> None:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    degc = np.where(np.arange(measured.rows) < measured.rows // 2, 30.0, 70.0)
    log = {name: measured[name] for name in measured} | ({"oil_temperature_degc": degc} if has_oil else {})
    axes = wc.fit(car, log, oil_step=20).plot_adaptations()
    assert [axis.get_ylabel() for axis in axes][:2] == ["fill time, ms", "kiss point, kPa"]
    elements = [text.get_text() for text in (axes[0].get_legend().get_texts() if has_oil else axes[-1].get_xticklabels())]
    assert elements == sorted(element.upper() for element in car.elements)
    with pytest.raises(ValueError, match="oil_step"):
        fitted.plot_adaptations()


def test_progress_comes_at_most_ten_times_a_second_and_may_end_the_fit(car: wc.Car, measured: wc.Table) -> None:
    times: list[float] = []

    def progress(words: str, fraction: float | None) -> None:
        assert words and fraction is None
        times.append(time.monotonic())

    wc.fit(car, measured, progress=progress)
    assert all(later - before > 0.09 for before, later in zip(times, times[1:]))

    def failing(words: str, fraction: float | None) -> None:
        raise LookupError(words)

    if times:
        with pytest.raises(LookupError):
            wc.fit(car, measured, progress=failing)


def test_ctrl_c_ends_a_fit(car: wc.Car, run: wc.Simulation) -> None:
    begin = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        threading.Timer(0.1, os.kill, (os.getpid(), signal.SIGINT)).start()
        wc.fit(car, [run.measured] * 20)
    assert time.monotonic() - begin < 10.0


def test_what_cannot_be_fitted_is_refused(car: wc.Car, measured: wc.Table) -> None:
    with pytest.raises(wc.InputError, match="no shift") as raised:
        wc.fit(car, {name: measured[name][:50] for name in measured})
    assert raised.value.hint
    for wrong in ([], {"time_s": []}, ROOT / "no_such.csv"):
        with pytest.raises(wc.InputError):
            wc.fit(car, wrong)
