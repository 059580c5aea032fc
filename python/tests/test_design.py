from __future__ import annotations

import json
import os
import pickle
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import wetclutch as wc

from conftest import ROOT

EIGHT_SPEED = ROOT / "vehicles" / "eight_speed.toml"


@pytest.mark.parametrize(
    "observer, method", [("rigid", "iss"), ("rigid", "peak-to-peak"), ("compliant", "iss"), ("sliding", None)]
)
def test_the_command_gives_the_same_gains(observer: str, method: str | None) -> None:
    command = os.environ.get("WETCLUTCH")
    if not command:
        pytest.skip("WETCLUTCH names no binary")
    gains, certificate = wc.design(wc.Car.read(EIGHT_SPEED), shift="1-2", observer=observer, method=method)
    options = ["--shift", "1-2", "--observer", observer, "--json", *(["--method", method] if method else [])]
    printed = subprocess.run([command, "design", EIGHT_SPEED, *options], capture_output=True, text=True, check=True)
    command_gives = json.loads(printed.stdout)
    command_gives.pop("json_version", None)
    assert command_gives == json.loads(certificate.text)
    phases = [certificate.torque_phase, certificate.inertia_phase]
    assert all((phase is None) == (observer == "sliding") for phase in phases)
    assert gains.inertia_phase and gains.torque_phase


def test_certificates_have_bounds_and_vertices() -> None:
    gains, certificate = wc.design(wc.Car.read(EIGHT_SPEED), shift="1-2", method="peak-to-peak")
    for phase in (certificate.torque_phase, certificate.inertia_phase):
        assert phase is not None and 0.0 < phase.bound_pa <= phase.open_loop_bound_pa
        assert phase.vertices and all(margin >= 0.0 for _, margin in phase.vertices)
        assert 0.01 <= phase.longest_step_s
        assert certificate.offset_pa is not None and certificate.offset_pa >= phase.bound_pa
    assert wc.design(wc.Car.read(EIGHT_SPEED), shift="1-2", observer="sliding")[1].offset_pa is None
    exact = gains.to_hex()["inertia_phase"]["gains"][0]["normalised"]
    rows = gains.inertia_phase["gains"][0]["normalised"]
    assert [[float.fromhex(x) for x in row] for row in exact] == rows
    for value in (gains, certificate):
        assert pickle.loads(pickle.dumps(value)) == value
        assert len(repr(value)) < 120


def test_what_cannot_be_designed_is_refused() -> None:
    car = wc.Car.read(EIGHT_SPEED)
    with pytest.raises(wc.InputError) as raised:
        wc.design(car)
    assert raised.value.hint and "1-2" in raised.value.hint
    for wrong in ({"shift": "2-1"}, {"shift": "1-9"}, {"shift": "1-2", "method": "best"}, {"shift": "1-2", "observer": "x"}):
        with pytest.raises(wc.InputError):
            wc.design(car, **wrong)
    with pytest.raises(wc.InputError, match="sample_time_s has no effect"):
        wc.design(car, shift="1-2", sample_time_s=0.01)
    for value in (float("nan"), -1.0, 1.0):
        with pytest.raises(wc.InputError, match="expected 0.0001 to 0.2") as out:
            wc.design(car, shift="1-2", method="interval", sample_time_s=value)
        assert out.value.key == "sample_time_s"


def test_the_error_system_is_one_of_python_control() -> None:
    control, np = pytest.importorskip("control"), pytest.importorskip("numpy")
    gains, certificate = wc.design(wc.Car.read(EIGHT_SPEED), shift="1-2", method="peak-to-peak")
    for phase, certified in (("torque_phase", certificate.torque_phase), ("inertia_phase", certificate.inertia_phase)):
        systems = [system for system in gains.error_systems if system.phase == phase]
        assert certified is not None and len(systems) == len(certified.vertices)
        for corner in range(len(systems)):
            system = gains.to_control(phase, corner)
            assert isinstance(system, control.StateSpace) and system.dt == 0.01
            assert system.output_labels == ["pressure_pa_error"] and "mass" in system.input_labels
            # The largest error of causes at their bounds, with any signs.
            worst_pa, response = np.abs(system.D).sum(), system.C
            for _ in range(3000):
                worst_pa += np.abs(response @ system.B).sum()
                response = response @ system.A
            assert 0.0 < worst_pa <= 1.001 * certified.bound_pa
    with pytest.raises(wc.InputError, match="no corner"):
        wc.design(wc.Car.read(EIGHT_SPEED), shift="1-2")[0].to_control()


def test_a_design_uses_its_own_routines_beside_others_of_the_same_names(tmp_path: Path) -> None:
    compiler = shutil.which("cc")
    if compiler is None or sys.platform != "linux":
        pytest.skip("there is no C compiler")
    names = ("dgemm_", "dgemv_", "dsyrk_", "dsymv_", "dpotrf_", "dpotrs_", "dgesv_", "dsyevr_", "dgesdd_", "dgesvd_")
    source, library = tmp_path / "other.c", tmp_path / "other.so"
    source.write_text("#include <stdlib.h>\n" + "".join(f"void {name}(void) {{ abort(); }}\n" for name in names))
    subprocess.run([compiler, "-shared", "-fPIC", "-o", library, source], check=True)
    code = (
        "import ctypes, sys, wetclutch as wc\n"
        "others = len(sys.argv) > 2 and ctypes.CDLL(None).dgemm_\n"
        "print(wc.design(wc.Car.read(sys.argv[1]), shift='1-2', method='peak-to-peak')[1].text)"
    )
    alone = subprocess.run([sys.executable, "-c", code, EIGHT_SPEED], check=True, capture_output=True)
    environment = {**os.environ, "LD_PRELOAD": str(library)}
    beside = subprocess.run(
        [sys.executable, "-c", code, EIGHT_SPEED, "others"], check=True, capture_output=True, env=environment
    )
    assert alone.stdout == beside.stdout and alone.stdout
