"""Many logs and many cars in an executor."""

from __future__ import annotations

import concurrent.futures
import os
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import wetclutch as wc
from wetclutch import _estimate

from conftest import ROOT

pl = pytest.importorskip("polars")

EXECUTORS = ["threads", "processes", "dask"]


@pytest.fixture(scope="module")
def client() -> Iterator[Any]:
    distributed = __import__("distributed") if os.environ.get("CI") else pytest.importorskip("distributed")
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        with distributed.Client(cluster) as client:
            yield client


@pytest.fixture
def executor(request: pytest.FixtureRequest) -> Iterator[Any]:
    if request.param == "dask":
        yield request.getfixturevalue("client")
        return
    pools = {"threads": concurrent.futures.ThreadPoolExecutor, "processes": concurrent.futures.ProcessPoolExecutor}
    with pools[request.param](2) as pool:
        yield pool


@pytest.fixture(scope="module")
def logs(measured: wc.Table, tmp_path_factory: pytest.TempPathFactory) -> list[Any]:
    """A table, a data frame and a file, each with another part of the drive."""
    parts = [{name: measured[name][part] for name in measured} for part in (slice(0, 4000), slice(4000, 8000), slice(8000, 12000))]
    path = tmp_path_factory.mktemp("logs") / "log.csv"
    pl.DataFrame(wc.Table(parts[2])).write_csv(path)
    return [wc.Table(parts[0]), pl.DataFrame(wc.Table(parts[1])), path]


@pytest.mark.parametrize("executor", EXECUTORS, indirect=True)
def test_logs_are_estimated_to_the_same_bytes(car: wc.Car, logs: list[Any], executor: Any) -> None:
    alone = tuple(wc.estimate(car, log, page=True) for log in logs)
    words: list[str] = []
    found = wc.estimate(car, logs, page=True, executor=executor, progress=lambda text, _: words.append(text))
    assert found == alone and words[-1] == "3 of 3 logs"
    assert wc.estimate(car, tuple(logs), page=True) == alone


@pytest.mark.parametrize("executor", EXECUTORS, indirect=True)
def test_cars_are_fitted_to_the_same_bytes(car: wc.Car, logs: list[Any], executor: Any) -> None:
    heavier = car.replace(vehicle__mass_kg=1700.0)
    alone = (wc.fit(car, logs), wc.fit(heavier, logs[1]))
    assert wc.fit([car, heavier], [logs, logs[1]], executor=executor) == alone


def test_no_log_is_no_estimate(car: wc.Car) -> None:
    assert wc.estimate(car, []) == () and wc.fit([], []) == ()


def test_an_error_says_of_which_log_it_is(car: wc.Car, logs: list[Any]) -> None:
    with concurrent.futures.ProcessPoolExecutor(2) as pool:
        for executor in (None, pool):
            with pytest.raises(wc.InputError) as raised:
                wc.estimate(car, [logs[0], ROOT / "no_such.csv"], executor=executor)
            assert "in number 2" in raised.value.__notes__[0]


def _killing(*_: Any) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def test_workers_that_die_end_in_a_clear_error(car: wc.Car, logs: list[Any], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_estimate, "_estimated", _killing)
    with concurrent.futures.ProcessPoolExecutor(2) as pool:
        with pytest.raises(wc.WorkError, match="workers died while they worked at") as raised:
            wc.estimate(car, logs, executor=pool)
    assert raised.value.hint


def test_an_executor_that_has_nothing_to_do_is_refused(car: wc.Car, logs: list[Any]) -> None:
    with concurrent.futures.ThreadPoolExecutor(1) as pool:
        with pytest.raises(ValueError, match="many logs"):
            wc.estimate(car, logs[0], executor=pool)  # type: ignore[call-overload]
        with pytest.raises(ValueError, match="many cars"):
            wc.fit(car, logs[0], executor=pool)  # type: ignore[call-overload]
    with pytest.raises(TypeError, match="no executor"):
        wc.estimate(car, logs, executor=3)
    with pytest.raises(ValueError, match="logs for each car"):
        wc.fit([car], [])


def test_the_error_of_a_drive_has_its_line(tmp_path: Path) -> None:
    text = (ROOT / "drives" / "city.toml").read_text(encoding="utf-8")
    path = tmp_path / "drive.toml"
    path.write_text(text.replace("throttle = ", "throtle = "), encoding="utf-8")
    with pytest.raises(wc.InputError) as raised:
        wc.simulate(wc.Car.read(ROOT / "vehicles" / "six_speed.toml"), path)
    assert raised.value.line
