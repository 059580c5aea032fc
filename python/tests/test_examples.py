"""The examples for clusters, as far as one machine can run them."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import wetclutch as wc

from conftest import ROOT

CLUSTER = ROOT / "examples" / "cluster"


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("cluster")
    for name in ("vehicles", "gearboxes"):
        (folder / name).symlink_to(ROOT / name)
    shutil.copytree(ROOT / "experiments", folder / "experiments")
    path = folder / "experiments" / "combined.toml"
    path.write_text(path.read_text(encoding="utf-8").replace("runs = 2000", "runs = 20"), encoding="utf-8")
    return path


def test_the_job_array_of_slurm_makes_and_merges_the_shards(study: Path, tmp_path: Path) -> None:
    command = os.environ.get("WETCLUTCH")
    if not command:
        pytest.skip("WETCLUTCH names no binary")
    (tmp_path / "wetclutch").symlink_to(command)
    path = os.pathsep.join([str(tmp_path), os.environ["PATH"]])
    for task in (3, 1, 2):
        array = {"SLURM_ARRAY_TASK_ID": str(task), "SLURM_ARRAY_TASK_COUNT": "3"}
        script = ["bash", CLUSTER / "slurm_study.sh", study, tmp_path / "out"]
        subprocess.run(script, check=True, env={**os.environ, "PATH": path, **array}, capture_output=True)
    assert (tmp_path / "out" / "whole" / "runs.csv").read_bytes() == wc.study(study).csv


def test_the_script_for_dask_makes_the_same_rows(study: Path, tmp_path: Path) -> None:
    if not os.environ.get("CI"):
        pytest.importorskip("distributed")
    subprocess.run([sys.executable, CLUSTER / "dask_study.py", study, tmp_path], check=True, capture_output=True)
    assert (tmp_path / "runs.csv").read_bytes() == wc.study(study).csv


def test_the_job_of_kubernetes_has_a_shard_for_each_index() -> None:
    yaml = pytest.importorskip("yaml")
    job = yaml.safe_load((CLUSTER / "kubernetes_study.yaml").read_text(encoding="utf-8"))
    spec = job["spec"]
    command = spec["template"]["spec"]["containers"][0]["args"][0]
    assert (job["kind"], spec["completionMode"]) == ("Job", "Indexed")
    assert f"--shard \"$((JOB_COMPLETION_INDEX + 1))/{spec['completions']}\"" in command and "--resume" in command
