from __future__ import annotations

import concurrent.futures
import os
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import wetclutch as wc

from conftest import ROOT

np = pytest.importorskip("numpy")
pl = pytest.importorskip("polars")
pd = pytest.importorskip("pandas")


def test_a_simulated_drive_is_estimated(car: wc.Car, measured: wc.Table) -> None:
    found = wc.estimate(car, measured, page=True)
    assert found.rows.rows == measured.rows and found.shifts.rows > 3
    assert np.array_equal(found.rows["time_s"], measured["time_s"])
    assert found.learnt and found.page and "<html" in found.page
    again = wc.estimate(car, measured, learnt=found.learnt, shift=1)
    assert 0 < again.rows.rows < measured.rows and again.shifts.rows == 1


def test_every_source_of_the_same_log_gives_the_same_bytes(car: wc.Car, measured: wc.Table, tmp_path: Path) -> None:
    expected = wc.estimate(car, measured)
    path = tmp_path / "log.csv"
    pl.DataFrame(measured).write_csv(path)
    for log in (pl.DataFrame(measured), measured.to_pandas(), path, wc.read(path), wc.read(pl.DataFrame(measured))):
        found = wc.estimate(car, log)
        assert found.rows == expected.rows and found.shifts == expected.shifts, type(log)


def test_the_command_gives_the_same_numbers(car: wc.Car, measured: wc.Table, tmp_path: Path) -> None:
    command = os.environ.get("WETCLUTCH")
    if not command:
        pytest.skip("WETCLUTCH names no binary")
    log, out = tmp_path / "log.csv", tmp_path / "out.csv"
    pl.DataFrame(measured).write_csv(log)
    vehicle = os.fspath(ROOT / "vehicles" / "six_speed.toml")
    subprocess.run([command, "estimate", log, "--vehicle", vehicle, "-o", out], check=True, capture_output=True)
    rows = wc.estimate(car, measured).rows
    written = pl.read_csv(out, infer_schema_length=None)
    assert written.columns == list(rows)
    for name in rows:
        if isinstance(rows[name], list):
            continue
        assert np.array_equal(written[name].cast(pl.Float64).to_numpy(), np.asarray(rows[name]), equal_nan=True), name


def test_a_mapped_frame_is_read(car: wc.Car, measured: wc.Table) -> None:
    del car
    two_speed = wc.Car.read(ROOT / "vehicles" / "two_speed_at.toml")
    time_s = np.arange(0.0, 4.0, 0.01)
    frame = pd.DataFrame({"t": time_s, "n_t": 1500.0 + 0.0 * time_s})
    with pytest.raises(wc.InputError) as raised:
        wc.estimate(two_speed, wc.read(frame, channels={"turbine_speed": "n_t"}))
    assert raised.value.hint


def test_what_is_no_log_of_the_car_is_refused_with_a_hint(car: wc.Car, measured: wc.Table) -> None:
    missing = {name: measured[name] for name in measured if name != "turbine_speed_rad_s"}
    with pytest.raises(wc.InputError, match="turbine_speed_rad_s"):
        wc.estimate(car, missing)
    with pytest.raises(wc.InputError):
        wc.estimate(car, {"time_s": []})
    with pytest.raises(wc.InputError, match="no effect"):
        wc.estimate(car, measured, observer="kalman")
    with pytest.raises(wc.InputError, match="expected one of"):
        wc.estimate(wc.Car.read(ROOT / "vehicles" / "two_speed_at.toml"), measured, observer="kalmann")
    with pytest.raises(wc.InputError, match="no column"):
        wc.estimate(car, measured, columns=["pressure"])
    for shift in (0, -1, 2**70):
        with pytest.raises(wc.InputError, match="shift is .*, expected 1"):
            wc.estimate(car, measured, shift=shift)
    for seed in (-1, 2**64):
        with pytest.raises(wc.InputError, match="seed is .*, expected 0 to"):
            wc.simulate(car, ROOT / "drives" / "city.toml", seed=seed)
    with pytest.raises(ValueError, match="threads"):
        wc.estimate(car, measured, threads=0)
    with pytest.raises(wc.InputError):
        wc.estimate(car, ROOT / "no_such.csv")


@pytest.mark.parametrize("wrong", [float("nan"), float("inf"), 1e300, -1e6])
def test_wrong_readings_end_in_an_estimate_or_an_error(car: wc.Car, measured: wc.Table, wrong: float) -> None:
    rows = 3000
    for name in ("turbine_speed_rad_s", "output_speed_rad_s", "engine_speed_rad_s"):
        columns: dict[str, Any] = {key: measured[key][:rows] for key in measured}
        columns[name] = np.array(columns[name])
        columns[name][1000:1200] = wrong
        try:
            found = wc.estimate(car, columns)
        except wc.InputError:
            continue
        assert found.rows.rows == rows


NUMBERS = st.one_of(st.floats(width=64), st.none(), st.integers(-(10**6), 10**6))
COLUMN = st.lists(NUMBERS, max_size=30)


@settings(max_examples=40, deadline=None)
@given(times=COLUMN, speeds=COLUMN, kind=st.sampled_from(["list", "numpy", "strided", "chunked", "float32"]))
def test_whatever_comes_in_ends_in_an_estimate_or_an_error(times: list[Any], speeds: list[Any], kind: str) -> None:
    car, rows = wc.Car.template("8hp", mass_kg=1900.0), min(len(times), len(speeds))
    names = ["engine_speed_rad_s", "turbine_speed_rad_s", "output_speed_rad_s", "wheel_speed_rad_s"]
    names += [f"element_{name.lower()}_current_a" for name in car.elements]
    columns: dict[str, Any] = {"time_s": times[:rows], **{name: speeds[:rows] for name in names}}
    if kind != "list":
        dtype = np.float32 if kind == "float32" else np.float64
        with np.errstate(over="ignore"):
            columns = {name: np.array(of, dtype=np.float64).astype(dtype) for name, of in columns.items()}
    if kind == "strided":
        columns = {name: np.repeat(of, 2)[::2] for name, of in columns.items()}
    columns |= {"gear": ["1"] * rows, "target_gear": ["2"] * rows}
    data: Any = columns
    if kind == "chunked":
        whole = pl.DataFrame(columns)
        data = pl.concat([whole[: rows // 2], whole[rows // 2 :]], rechunk=False)
    try:
        found = wc.estimate(car, data)
    except wc.InputError:
        return
    # Rows with the time of the row before are left out, with a warning.
    left_out = [finding for finding in found.findings if "have the time of the row before and are not used" in finding]
    assert found.rows.rows == rows or (left_out and 0 < found.rows.rows < rows)


def test_the_same_seed_gives_the_same_drive(car: wc.Car, drive_file: str, run: wc.Simulation) -> None:
    assert wc.simulate(car, drive_file).measured == run.measured
    assert run.shifts > 10 and run.distance_m > 1000.0
    truth, measured = run
    assert truth is run.truth and measured is run.measured


def test_threads_estimate_at_the_same_time(car: wc.Car, measured: wc.Table) -> None:
    expected = wc.estimate(car, measured).rows
    with concurrent.futures.ThreadPoolExecutor(20) as pool:
        for found in pool.map(lambda _: wc.estimate(car, measured), range(20)):
            assert found.rows == expected


def test_processes_estimate_after_a_fork(car: wc.Car, measured: wc.Table) -> None:
    expected = wc.estimate(car, measured).rows
    with concurrent.futures.ProcessPoolExecutor(2) as pool:
        for found in pool.map(wc.estimate, [car] * 2, [measured] * 2):
            assert found.rows == expected


def test_other_threads_of_python_run_meanwhile(car: wc.Car, drive_file: str) -> None:
    ticks = 0
    is_done = threading.Event()

    def tick() -> None:
        nonlocal ticks
        while not is_done.wait(0.005):
            ticks += 1

    thread = threading.Thread(target=tick)
    thread.start()
    wc.simulate(car, drive_file)
    is_done.set()
    thread.join()
    assert ticks > 10


def test_progress_comes_at_most_ten_times_a_second(car: wc.Car, measured: wc.Table, drive_file: str) -> None:
    rows = {name: list(measured[name]) * 10 for name in measured if name != "time_s"}
    log = wc.read({"time_s": [0.01 * at for at in range(10 * measured.rows)], **rows})
    for call in (lambda progress: wc.estimate(car, log, progress=progress), lambda progress: wc.simulate(car, drive_file, progress=progress)):
        times: list[float] = []
        reports: list[tuple[str, float | None]] = []

        def progress(words: str, fraction: float | None) -> None:
            times.append(time.monotonic())
            reports.append((words, fraction))

        call(progress)
        assert reports and all(later - before > 0.09 for before, later in zip(times, times[1:]))
        assert all(fraction is None or 0.0 <= fraction <= 1.0 for _, fraction in reports)
        assert all(words.endswith(("rows", "s")) for words, _ in reports)

        def failing(words: str, fraction: float | None) -> None:
            raise LookupError(words)

        with pytest.raises(LookupError):
            call(failing)


def test_only_the_initialiser_is_exported() -> None:
    from wetclutch import _wetclutch

    nm = subprocess.run(["nm", "-D", "--defined-only", _wetclutch.__file__], capture_output=True, text=True)
    if nm.returncode != 0 or sys.platform != "linux":
        pytest.skip("there is no nm")
    names = {line.split()[-1].split("@")[0] for line in nm.stdout.splitlines()}
    assert names == {"PyInit__wetclutch"}


def test_importing_loads_no_other_package() -> None:
    code = "import sys; before = set(sys.modules); import wetclutch; print(*(set(sys.modules) - before))"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    others = {name.split(".")[0] for name in loaded} - set(sys.stdlib_module_names) - {"wetclutch"}
    assert "wetclutch" in {name.split(".")[0] for name in loaded} and not others


def test_a_drive_is_drawn(car: wc.Car, measured: wc.Table) -> None:
    pytest.importorskip("matplotlib").use("Agg")
    found = wc.estimate(car, measured)
    axes = found.plot(shift=None)
    assert [axis.get_ylabel() for axis in axes] == ["gear", "turbine torque, N m", "pressure, MPa"]
    # Shading, one for each shift, and curves.
    assert len(axes[0].patches) == found.shifts.rows and len(axes[2].lines) == 5
    with pytest.raises(KeyError, match="a plot of the drive needs"):
        wc.estimate(car, measured, columns=["health"]).plot(shift=None)


def test_a_shift_is_drawn_by_its_number(car: wc.Car, measured: wc.Table) -> None:
    pytest.importorskip("matplotlib").use("Agg")
    found = wc.estimate(car, measured, shifts=["2-3", "4-5"])
    numbers = [int(number) for number in found.shifts["number"]]
    assert numbers[0] > 1
    for number, begin_s in zip(numbers, found.shifts["time_s"], strict=True):
        title = found.plot(number)[0].get_title()
        assert title.startswith(f"shift {number}: ") and begin_s > 0.0
    assert found.plot()[0].get_title() == found.plot(numbers[0])[0].get_title()
    with pytest.raises(IndexError, match=f"from {numbers[0]} to {numbers[-1]}"):
        found.plot(1)


def test_a_frame_of_any_layout_is_estimated_where_it_stands(car: wc.Car, measured: wc.Table) -> None:
    expected = wc.estimate(car, measured)
    frame = measured.to_polars()
    words = pl.selectors.categorical()
    chunked = pl.concat([frame[:5000], frame[5000:]], rechunk=False)
    narrow = chunked.with_columns(pl.col("lock_up_applied").cast(pl.Boolean), pl.col("gear").cast(pl.String).cast(pl.Int8))
    for given in (frame, chunked, chunked.with_columns(words.cast(pl.String)), narrow, frame.to_arrow(), measured.to_pandas()):
        assert wc.estimate(car, given).rows == expected.rows
    is_lost = pl.int_range(pl.len()) == 7000
    with_gap = chunked.with_columns(pl.when(is_lost).then(None).otherwise(pl.col("time_s")).alias("time_s"))
    with pytest.raises(wc.InputError, match="the table:7002: the time is missing"):
        wc.estimate(car, with_gap)
