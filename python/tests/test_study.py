from __future__ import annotations

import concurrent.futures
import os
import signal
import subprocess
import threading
from pathlib import Path
from typing import Any

import pytest

import wetclutch as wc
from wetclutch import _study

from conftest import ROOT

np = pytest.importorskip("numpy")

RUNS = 60


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study of the project with fewer runs."""
    folder = tmp_path_factory.mktemp("study") / "experiments"
    folder.mkdir()
    for name in ("vehicles", "gearboxes"):
        (folder.parent / name).symlink_to(ROOT / name)
    text = (ROOT / "experiments" / "combined.toml").read_text(encoding="utf-8")
    lines = [f"runs = {RUNS}" if line.startswith("runs =") else line for line in text.splitlines()]
    for other in (ROOT / "experiments").glob("*.toml"):
        (folder / other.name).symlink_to(other)
    path = folder / "small.toml"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def expected(file: Path) -> bytes:
    return wc.study(file).csv


@pytest.fixture(scope="module")
def client() -> Any:
    distributed = required("distributed")
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        with distributed.Client(cluster) as client:
            yield client


def required(module: str) -> Any:
    """A module that CI has to have."""
    return __import__(module) if os.environ.get("CI") else pytest.importorskip(module)


def test_the_rows_are_those_of_the_command(file: Path, expected: bytes, tmp_path: Path) -> None:
    command = os.environ.get("WETCLUTCH")
    if not command:
        pytest.skip("WETCLUTCH names no binary")
    subprocess.run([command, "study", file, "-o", tmp_path / "out"], check=True, capture_output=True)
    assert (tmp_path / "out" / "runs.csv").read_bytes() == expected


def test_a_study_has_rows_and_a_page(file: Path, expected: bytes) -> None:
    study = wc.study(file, page=True, shards=7, threads=2)
    assert study.csv == expected and study.rows.rows == RUNS
    assert list(study.rows["run"]) == list(range(RUNS)) and set(study.rows["status"]) <= {"ok", "tie_up", "no_lock_up"}
    assert study.page and "small.toml" in study.page
    assert len(repr(study)) < 120


def test_threads_and_processes_make_the_same_bytes(file: Path, expected: bytes) -> None:
    for pool in (concurrent.futures.ThreadPoolExecutor(3), concurrent.futures.ProcessPoolExecutor(2)):
        with pool:
            assert wc.study(file, executor=pool, shards=9).csv == expected, pool


def test_dask_makes_the_same_bytes_and_a_second_time_from_the_folder(
    file: Path, expected: bytes, client: Any, tmp_path: Path
) -> None:
    assert wc.study(file, executor=client, shards=5).csv == expected
    assert wc.study(file, executor=client, shards=5, folder=tmp_path).csv == expected
    parts = sorted(tmp_path.iterdir())
    assert len(parts) == 5
    before = parts[1].stat().st_mtime_ns
    parts[0].unlink()
    assert wc.study(file, shards=5, folder=tmp_path).csv == expected
    assert sorted(tmp_path.iterdir()) == parts and parts[1].stat().st_mtime_ns == before


def test_a_worker_that_is_killed_on_the_way_changes_no_byte(file: Path, expected: bytes, client: Any) -> None:
    killed = []

    def progress(words: str, fraction: float | None) -> None:
        if not killed:
            killed.append(next(iter(client.run(os.getpid).values())))
            os.kill(killed[0], signal.SIGKILL)

    assert wc.study(file, executor=client, shards=30, progress=progress).csv == expected
    assert killed


def _killing(where: Any, runs: tuple[int, int]) -> None:
    if runs[0] == 0:
        os.kill(os.getpid(), signal.SIGKILL)


@pytest.mark.parametrize("kind", ["processes", "dask"])
def test_a_task_that_always_kills_ends_in_a_clear_error(
    file: Path, kind: str, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_study, "_made", _killing)
    executor = request.getfixturevalue("client") if kind == "dask" else concurrent.futures.ProcessPoolExecutor(2)
    with pytest.raises(wc.WorkError, match="workers died while they made the runs") as raised:
        wc.study(file, executor=executor, shards=2)
    assert raised.value.hint and "folder" in raised.value.hint


def test_a_text_is_a_study(file: Path, expected: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(file.parent)
    assert wc.study(file.read_text(encoding="utf-8")).csv == expected


def test_tasks_are_small_and_cover_every_run() -> None:
    for runs, cells, at_once in ((1, 10, 16), (10_000, 100, 16), (1_000_000, 2000, 16), (7, 500, 1)):
        plan = _study._Plan((), "", runs, "," * (cells - 1))
        tasks = list(_study._tasks(plan, None, at_once))
        assert tasks[0][0] == 0 and tasks[-1][1] == runs
        assert all(end == begin for (_, end), (begin, _) in zip(tasks, tasks[1:]))
        assert all(0 < end - first <= 1000 and (end - first) * cells * 20 < 1_000_000 for first, end in tasks)


def test_the_window_holds_two_tasks_for_each_worker(file: Path, expected: bytes) -> None:
    running, most = 0, 0

    class Counting(concurrent.futures.ThreadPoolExecutor):
        def submit(self, *arguments: Any, **keywords: Any) -> Any:
            nonlocal running, most
            running += 1
            most = max(most, running)
            future = super().submit(*arguments, **keywords)
            future.add_done_callback(finished)
            return future

    def finished(_: Any) -> None:
        nonlocal running
        running -= 1

    with Counting(2) as pool:
        assert wc.study(file, executor=pool, shards=30).csv == expected
    assert most <= 4


def test_ctrl_c_ends_a_study() -> None:
    with pytest.raises(KeyboardInterrupt):
        threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
        wc.study(ROOT / "experiments" / "combined.toml")


def test_what_is_wrong_is_refused(file: Path) -> None:
    for shards in (0, RUNS + 1):
        with pytest.raises(wc.InputError, match="shards"):
            wc.study(file, shards=shards)
    with pytest.raises(ValueError, match="threads"):
        wc.study(file, threads=0)
    with pytest.raises(TypeError, match="no executor"):
        wc.study(file, executor=3)
    with pytest.raises(wc.InputError):
        wc.study(ROOT / "no_such.toml")
    with pytest.raises(wc.InputError) as raised:
        wc.study(file.read_text(encoding="utf-8").replace("plan =", "plan = 3 #"))
    assert raised.value.line
