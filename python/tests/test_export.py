from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

import wetclutch as wc

from conftest import ROOT

SPEED = {"teeth": 58, "timer_s": 1e-6, "periods": 2, "sample_time_s": 0.01, "delay_s": 0.02, "noise_rad_s": 0.4}
EIGHT_SPEED = ROOT / "vehicles" / "eight_speed.toml"


def content(folder: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in folder.iterdir()}


@pytest.fixture
def c_source(tmp_path: Path) -> Path:
    """What the header of ``wetclutch.c`` says, for the images of this version."""
    version = wc.export(wc.Car.read(EIGHT_SPEED), tmp_path / "first")[-1].read_bytes()[4]
    file = tmp_path / "wetclutch.c"
    file.write_text(f"/* wetclutch */\n#define IMAGE_VERSION {version}u\n#define HEAP 4096u\n#define STACK_BYTES 2048u\n/* The end of wetclutch.c. */\n")
    return file


def test_the_command_writes_the_same_files(tmp_path: Path, c_source: Path) -> None:
    command = os.environ.get("WETCLUTCH")
    if not command:
        pytest.skip("WETCLUTCH names no binary")
    files = wc.export(wc.Car.read(EIGHT_SPEED), tmp_path / "here" / "deep", name="eight_speed", shift="1-2", c=c_source)
    options = ["--shift", "1-2", "--c", c_source, "-o", tmp_path / "there"]
    subprocess.run([command, "export", EIGHT_SPEED, *options], capture_output=True, check=True)
    here = content(tmp_path / "here" / "deep")
    assert here == content(tmp_path / "there")
    assert {file.name for file in files} == here.keys() and "wetclutch.c" in here


def test_files_are_replaced_whole_and_others_stay(tmp_path: Path) -> None:
    car = wc.Car.read(EIGHT_SPEED)
    (tmp_path / "main.c").write_text("int main(void) { return 0; }")
    one = {file.name for file in wc.export(car, tmp_path, shift="1-2")}
    assert "wetclutch_eight_speed_automatic__2_0_l.h" in one
    before = content(tmp_path)
    assert before.keys() == one | {"main.c"}
    wc.export(car, tmp_path, sensors=wc.Sensors(engine=SPEED, turbine=SPEED, output=SPEED, wheel=SPEED))
    after = content(tmp_path)
    assert after.keys() == before.keys() and after["main.c"] == before["main.c"]
    name = "wetclutch_eight_speed_automatic__2_0_l_parameters.bin"
    assert after[name] != before[name]


def test_what_cannot_be_exported_is_refused_and_nothing_is_written(tmp_path: Path) -> None:
    car = wc.Car.read(EIGHT_SPEED)
    out = tmp_path / "out"
    for wrong in (
        {"shift": "1-9"},
        {"program": EIGHT_SPEED},
        {"c": EIGHT_SPEED},
        {"fmu": [EIGHT_SPEED]},
        {"car_fmu": [EIGHT_SPEED]},
    ):
        with pytest.raises(wc.InputError) as raised:
            wc.export(car, out, **wrong)  # type: ignore[arg-type]
        assert str(raised.value)
    with pytest.raises(wc.InputError):
        wc.export(wc.Car.read(ROOT / "vehicles" / "two_speed_at.toml"), out)
    with pytest.raises(FileNotFoundError):
        wc.export(car, out, c=tmp_path / "there-is-none.c")
    assert not out.exists()
