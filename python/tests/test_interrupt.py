"""Ctrl-C ends each long call within 50 ms."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import wetclutch as wc

from conftest import ROOT

LIMIT_S = 0.05


def time_to_end_s(call: Callable[[], object], after_s: float) -> float:
    """Time from Ctrl-C, which comes `after_s` after the call has begun, until it has ended, s."""
    sent_s = 0.0

    def interrupt() -> None:
        nonlocal sent_s
        sent_s = time.monotonic()
        os.kill(os.getpid(), signal.SIGINT)

    timer = threading.Timer(after_s, interrupt)
    with pytest.raises(KeyboardInterrupt):
        timer.start()
        call()
    ended_s = time.monotonic()
    timer.join()
    return ended_s - sent_s


@pytest.fixture(scope="module")
def calls(run: wc.Simulation, car: wc.Car, drive_file: str) -> dict[str, Callable[[], object]]:
    measured = run.measured
    rows = {name: list(measured[name]) * 10 for name in measured if name != "time_s"}
    log = wc.read({"time_s": [0.01 * at for at in range(10 * measured.rows)], **rows})
    other = wc.Car.read(ROOT / "vehicles" / "eight_speed.toml")
    study = ROOT / "experiments" / "combined.toml"
    return {
        "estimate": lambda: wc.estimate(car, log),
        "fit": lambda: wc.fit(car, [measured] * 20),
        "simulate": lambda: wc.simulate(car, drive_file),
        "study": lambda: wc.study(study),
        "study on two threads": lambda: wc.study(study, threads=2),
        "design": lambda: [wc.design(other, shift=shift, method="peak-to-peak") for shift in ("1-2", "2-3", "3-4", "4-5")],
        "channels": lambda: log.channels,
    }


@pytest.mark.parametrize("name", ["estimate", "fit", "simulate", "study", "study on two threads", "design", "channels"])
def test_ctrl_c_ends_a_call_soon(calls: dict[str, Any], name: str) -> None:
    # The fastest of three: another program may have the processor meanwhile.
    times_s = [time_to_end_s(calls[name], after_s) for after_s in (0.02, 0.05, 0.1)]
    assert min(times_s) < LIMIT_S, times_s


def test_a_study_that_is_ended_leaves_whole_files_alone(tmp_path: Path) -> None:
    study = ROOT / "experiments" / "combined.toml"
    with pytest.raises(KeyboardInterrupt):
        threading.Timer(2.0, os.kill, (os.getpid(), signal.SIGINT)).start()
        wc.study(study, folder=tmp_path, shards=1000)
    files = [path.name for path in tmp_path.iterdir()]
    assert files and all(name.endswith(".csv") for name in files)


def test_an_ended_call_is_followed_by_another(car: wc.Car, measured: wc.Table, calls: dict[str, Any]) -> None:
    expected = wc.estimate(car, measured).rows
    time_to_end_s(calls["simulate"], 0.05)
    assert wc.estimate(car, measured).rows == expected
