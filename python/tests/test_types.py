"""What type checkers see of the package."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path


def checked(*command: str) -> str:
    """What a checker prints; it has to find nothing."""
    # pyright asks the Python that comes first on the path where packages are.
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    done = subprocess.run([sys.executable, "-m", *command], capture_output=True, text=True, env={**os.environ, "PATH": path})
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_every_public_name_has_a_type() -> None:
    report = json.loads(checked("pyright", "--verifytypes", "wetclutch", "--ignoreexternal", "--outputjson"))
    assert report["typeCompleteness"]["completenessScore"] == 1.0


def test_the_stubs_are_those_of_the_native_part(tmp_path: Path) -> None:
    settings, allowed = tmp_path / "mypy.ini", tmp_path / "allowed"
    settings.write_text("[mypy]\n")
    # Before Python 3.12 a buffer has no method of this name.
    allowed.write_text(r"wetclutch\._wetclutch\.Numbers\.__buffer__" + "\n")
    options = ["--mypy-config-file", str(settings), "--allowlist", str(allowed), "--ignore-unused-allowlist"]
    checked("mypy.stubtest", "wetclutch._wetclutch", *options)
