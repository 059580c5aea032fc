"""What the documentation shows runs."""

from __future__ import annotations

import doctest
import re
import subprocess
import sys
from pathlib import Path

import pytest

import wetclutch._car
import wetclutch._design
import wetclutch._drive
import wetclutch._estimate
import wetclutch._export
import wetclutch._sensors
import wetclutch._table

from conftest import ROOT


MODULES = [
    wetclutch,
    wetclutch._car,
    wetclutch._design,
    wetclutch._drive,
    wetclutch._estimate,
    wetclutch._export,
    wetclutch._sensors,
    wetclutch._table,
]


@pytest.mark.parametrize("module", MODULES, ids=lambda m: m.__name__)
def test_the_examples_of_the_docstrings_run(module: object) -> None:
    failed, tried = doctest.testmod(module)  # type: ignore[arg-type]
    assert tried and not failed


def test_the_page_on_python_runs(tmp_path: Path) -> None:
    page = (ROOT / "docs" / "how-to" / "use-from-python.md").read_text(encoding="utf-8")
    code = "\n".join(re.findall(r"```python\n(.*?)```", page, re.S))
    for folder in ("vehicles", "gearboxes", "drives", "experiments"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    begin = "import matplotlib\nmatplotlib.use('Agg')\n"
    done = subprocess.run([sys.executable, "-c", begin + code], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
