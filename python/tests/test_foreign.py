"""Logs in formats that other libraries read."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest

import wetclutch as wc

np = pytest.importorskip("numpy")


def speeds() -> dict[str, Any]:
    """Times and two speeds, the second one at half the rate."""
    time = np.arange(0.0, 1.0, 0.01)
    return {"time": time, "nTurbine": 100.0 + 50.0 * time, "nOutput": 20.0 + time}


def test_channels_of_mdf_3_have_their_units_and_times(tmp_path: Path) -> None:
    asammdf = pytest.importorskip("asammdf")
    of = speeds()
    mdf = asammdf.MDF(version="3.30")
    mdf.append([asammdf.Signal(samples=of["nTurbine"], timestamps=of["time"], name="nTurbine", unit="rpm")])
    mdf.append([asammdf.Signal(samples=of["nOutput"][::2], timestamps=of["time"][::2], name="nOutput", unit="rpm")])
    path = tmp_path / "old.mdf"
    mdf.save(path)
    log = wc.read(path)
    channels = log.channels
    rows = dict(zip(channels["channel"], zip(channels["unit"], channels["samples"], strict=True), strict=True))
    assert rows == {"nTurbine": ("rpm", 100.0), "nOutput": ("rpm", 50.0)}
    assert "[channel.turbine_speed]" in log.suggest()


@pytest.mark.parametrize("version", ["5", "7.3"])
def test_vectors_of_a_mat_file_are_channels(tmp_path: Path, version: str) -> None:
    path = tmp_path / "log.mat"
    vectors = speeds()
    if version == "5":
        io = pytest.importorskip("scipy.io")
        io.savemat(path, {"time": vectors["time"], "log": {"nTurbine": vectors["nTurbine"]}, "nOutput": vectors["nOutput"], "ratios": [2.0, 1.0]})
    else:
        h5py = pytest.importorskip("h5py")
        with h5py.File(path, "w", userblock_size=512) as file:
            file.create_group("log")["nTurbine"] = vectors["nTurbine"].reshape(1, -1)
            for name in ("time", "nOutput"):
                file[name] = vectors[name].reshape(1, -1)
        with open(path, "r+b") as file:
            file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64")
    channels = wc.read(path).channels
    assert sorted(channels["channel"]) == ["log.nTurbine", "nOutput"]
    assert list(channels["maximum"]) == [pytest.approx(149.5), pytest.approx(20.99)][:: 1 if channels["channel"][0] == "log.nTurbine" else -1]


def test_a_mat_file_without_times_is_refused(tmp_path: Path) -> None:
    io = pytest.importorskip("scipy.io")
    path = tmp_path / "log.mat"
    io.savemat(path, {"nTurbine": [1.0, 2.0]})
    with pytest.raises(wc.InputError, match="no vector in it is called as a time") as caught:
        wc.read(path)
    assert caught.value.file == str(path) and caught.value.hint


def test_a_library_that_is_missing_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "old.mdf"
    path.write_bytes(b"MDF     3.30    " + bytes(100))
    monkeypatch.setitem(sys.modules, "asammdf", None)
    with pytest.raises(wc.InputError, match="asammdf") as caught:
        wc.read(path)
    assert caught.value.hint == "pip install asammdf"


def maximum_of(log: wc.Log) -> dict[str, float]:
    channels = log.channels
    return dict(zip(channels["channel"], channels["maximum"], strict=True))


def test_each_structure_of_a_mat_file_has_its_own_times(tmp_path: Path) -> None:
    io = pytest.importorskip("scipy.io")
    path = tmp_path / "log.mat"
    of = speeds()
    engine = {"time": of["time"] + 5.0, "nEngine": of["time"]}
    io.savemat(path, {"eng": engine, "gb": {"t_ms": 1e3 * of["time"], "nTurbine": of["nTurbine"]}})
    columns = wc._foreign.columns_of(str(path))
    assert columns is not None
    time = columns["time_s"]
    assert len(time) == 200 and time[0] == 0.0
    assert np.isnan(columns["eng.nEngine"][time < 4.9]).all() and columns["eng.nEngine"][time > 5.985][0] == pytest.approx(0.99)
    assert np.isnan(columns["gb.nTurbine"][time > 4.9]).all() and columns["gb.nTurbine"][0] == 100.0


def test_a_structure_with_time_of_simulink_has_its_signals(tmp_path: Path) -> None:
    io = pytest.importorskip("scipy.io")
    path = tmp_path / "log.mat"
    of = speeds()
    signals = [
        {"values": of["nTurbine"].reshape(-1, 1), "label": "nTurbine", "dimensions": 1},
        {"values": np.column_stack([of["nOutput"], of["time"]]), "label": "two", "dimensions": 2},
    ]
    io.savemat(path, {"logged": {"time": of["time"].reshape(-1, 1), "signals": signals, "blockName": "model/Scope"}, "tout": [0.0, 1.0]})
    assert maximum_of(wc.read(path)) == {
        "logged.nTurbine": pytest.approx(149.5),
        "logged.two_1": pytest.approx(20.99),
        "logged.two_2": pytest.approx(0.99),
    }


def test_what_has_no_times_in_a_mat_file_is_named(tmp_path: Path) -> None:
    io = pytest.importorskip("scipy.io")
    path = tmp_path / "log.mat"
    of = speeds()
    io.savemat(path, {"t": [0.0, 1.0, 2.0, 3.0, 4.0], "time": of["time"], "nTurbine": of["nTurbine"], "other": [1.0, 2.0, 3.0]})
    with pytest.warns(UserWarning, match="left out, as no times belong to them: t, other"):
        log = wc.read(path)
    assert maximum_of(log) == {"nTurbine": pytest.approx(149.5)}


@pytest.mark.parametrize("version", ["4", "5"])
def test_a_damaged_mat_file_is_an_error_of_the_file(tmp_path: Path, version: str) -> None:
    io = pytest.importorskip("scipy.io")
    path = tmp_path / "log.mat"
    io.savemat(path, speeds(), format=version)
    assert sorted(wc.read(path).channels["channel"]) == ["nOutput", "nTurbine"]
    path.write_bytes(path.read_bytes()[:700])
    with pytest.raises(wc.InputError) as caught:
        wc.read(path)
    assert caught.value.file == str(path) and caught.value.hint


def test_words_of_mdf_3_are_the_numbers_behind_them(tmp_path: Path) -> None:
    asammdf = pytest.importorskip("asammdf")
    of = speeds()
    gears = np.where(of["time"] < 0.5, 1, 2).astype("u1")
    words = {"val_0": 1, "text_0": b"first", "val_1": 2, "text_1": b"second", "default": b"none"}
    mdf = asammdf.MDF(version="3.30")
    mdf.append([asammdf.Signal(samples=gears, timestamps=of["time"], name="gear", conversion=words)])
    path = tmp_path / "old.mdf"
    mdf.save(path)
    assert maximum_of(wc.read(path)) == {"gear": 2.0}


def test_cells_beside_vectors_and_a_single_signal_are_read(tmp_path: Path) -> None:
    io = pytest.importorskip("scipy.io")
    path = tmp_path / "log.mat"
    of = speeds()
    cell = np.empty(2, dtype=object)
    cell[0], cell[1] = {"a": 1.0}, [1.0, 2.0]
    one = {"values": of["nTurbine"].reshape(-1, 1), "label": "nTurbine", "dimensions": 1}
    inner = {"t": [1.0, 2.0], "nOutput": of["nOutput"]}
    io.savemat(path, {"time": of["time"], "mixed": cell, "logged": {"time": of["time"], "signals": one}, "s": inner})
    with pytest.warns(UserWarning, match="left out"):
        log = wc.read(path)
    assert maximum_of(log) == {"logged.nTurbine": pytest.approx(149.5), "s.nOutput": pytest.approx(20.99)}
