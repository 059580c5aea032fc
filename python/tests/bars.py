"""Measures the package: size, import, a step of the observer, a million rows. `python python/tests/bars.py` with the package installed.

Times are those of the processor, which other programs do not change. With the command's path in the variable WETCLUTCH the same log is estimated by
the command, too.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
import timeit
from pathlib import Path
from typing import Any

import polars as pl

import wetclutch as wc

ROOT = Path(__file__).resolve().parents[2]
ROWS = 1_000_000


def show(what: str, value: float, unit: str) -> None:
    print(f"{what:60} {value:10.2f} {unit}", flush=True)


def import_ms() -> float:
    code = "import time; begin = time.process_time(); import wetclutch; print(1e3 * (time.process_time() - begin))"
    return min(float(subprocess.check_output([sys.executable, "-c", code])) for _ in range(5))


def step_us(car: wc.Car, aged: bool) -> float:
    """A step with four speeds, the engine torque and all commands."""
    names = {"engine_speed_rad_s": 230.0, "turbine_speed_rad_s": 215.0, "output_speed_rad_s": 52.0, "wheel_speed_rad_s": 17.0}
    readings: dict[str, Any] = {**names, "engine_torque_n_m": 120.0}
    if aged:
        readings = {name: (value, 0.004) for name, value in readings.items()}
    step = {**readings, "dt_s": 0.01, "commands": {name: 0.5 for name in car.elements}, "gear": "1", "target_gear": "1"}
    observer = wc.Observer(car)
    times = timeit.repeat(lambda: observer.step(**step), timer=time.process_time, number=20_000, repeat=9)
    return 1e6 * min(times) / 20_000


def many_rows(car: wc.Car) -> pl.DataFrame:
    """A million rows of the city drive, driven again and again."""
    once = pl.DataFrame(wc.simulate(car, ROOT / "drives" / "city.toml").measured)
    times = -(-ROWS // once.height)
    drives = [once.with_columns(pl.col("time_s") + at * 0.01 * once.height) for at in range(times)]
    # Each drive with memory of its own.
    return pl.concat(drives)[:ROWS].rechunk()


def peak_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


def resident_mb() -> float:
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 1e6


def of_commands_s() -> float:
    """Processor time of the programs that have ended, s."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def main() -> None:
    library = Path(wc._wetclutch.__file__)  # type: ignore[attr-defined]
    show("native part", library.stat().st_size / 1e6, "MB")
    show("import", import_ms(), "ms")
    car = wc.Car.read(ROOT / "vehicles" / "eight_speed.toml")
    show("Observer.step, numbers", step_us(car, aged=False), "us")
    show("Observer.step, pairs of number and age", step_us(car, aged=True), "us")
    six_speed = wc.Car.read(ROOT / "vehicles" / "six_speed.toml")
    frame = many_rows(six_speed)
    frame_mb, before_mb, begin_s = frame.estimated_size() / 1e6, resident_mb(), time.process_time()
    found = pl.DataFrame(wc.estimate(six_speed, frame, threads=1).rows)
    show("estimate of a million rows from polars and back", time.process_time() - begin_s, "s")
    show("the frame", frame_mb, "MB")
    show("the estimates", found.estimated_size() / 1e6, "MB")
    show("more memory at the peak, estimates included", peak_mb() - before_mb, "MB")
    begin_s = time.perf_counter()
    pl.DataFrame(wc.estimate(six_speed, frame, threads=1).rows)
    one_s, begin_s = time.perf_counter() - begin_s, time.perf_counter()
    pl.DataFrame(wc.estimate(six_speed, frame).rows)
    show("the same on all cores, by the clock, over that on one", (time.perf_counter() - begin_s) / one_s, "")
    command = os.environ.get("WETCLUTCH")
    if not command:
        return
    with tempfile.TemporaryDirectory() as folder:
        log, out = Path(folder) / "log.csv", Path(folder) / "out.csv"
        frame.write_csv(log)
        begin_s = of_commands_s()
        vehicle = ROOT / "vehicles" / "six_speed.toml"
        subprocess.run([command, "estimate", log, "--vehicle", vehicle, "-o", out], check=True, capture_output=True)
        show("the command on the same log as CSV, with reading and writing", of_commands_s() - begin_s, "s")


if __name__ == "__main__":
    main()
