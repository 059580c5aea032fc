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
