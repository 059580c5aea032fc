"""Studies, on one machine or many."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, TypeAlias

from . import _wetclutch as native
from ._errors import InputError, check_range, of_files
from ._estimate import framed
from ._executor import counted, in_executor
from ._progress import Progress, reported
from ._table import Table

if TYPE_CHECKING:
    from tempfile import TemporaryDirectory

#: Runs of a task of which each takes about a millisecond, and largest size of what a task returns, bytes.
_RUNS, _BYTES = 1000, 900_000
#: Size of a cell of the table, bytes.
_CELL_BYTES = 22
#: First run of a task, and the one after its last.
_Runs: TypeAlias = tuple[int, int]


@dataclass(frozen=True, slots=True)
class Study:
    """The rows of a study.

    Attributes:
        name: Name of the study.
        rows: A row for each run: its factors, measures of its shift, and errors of its observers. The seed is a word: a number would not be exact.
        csv: The same as a file in bytes: those of ``runs.csv`` of ``wetclutch study``.
        page: The page as HTML, if it was asked for; None of a study of cars with a gearbox.
    """

    name: str
    rows: Table
    csv: bytes
    page: str | None

    def plot(self, column: str) -> Any:
        """Draws the distribution of a column over the runs; needs matplotlib.

        Returns:
            The axes of the figure.
        """
        from ._plot import plot_distribution

        return plot_distribution(self, column)

    def _repr_html_(self) -> str | None:
        return framed(self.page)

    def __repr__(self) -> str:
        return f"Study({self.name!r}, {self.rows.rows} runs)"


@dataclass(frozen=True, slots=True)
class _Plan:
    """A study as a task gets it: the texts of its files, of which the first is the study file."""

    files: tuple[tuple[str, str], ...]
    fingerprint: str
    runs: int
    header: str


@dataclass(frozen=True, slots=True)
class _Where:
    """A study, how its tasks run, and the folder for their rows."""

    plan: _Plan
    folder: str | None
    threads: int

    def has(self, runs: _Runs) -> bool:
        """Whether the rows of these runs are in the folder."""
        return self.folder is not None and os.path.exists(self._path(runs))

    def read(self, runs: _Runs) -> bytes:
        with open(self._path(runs), "rb") as file:
            return file.read()

    def write(self, runs: _Runs, lines: bytes) -> None:
        """Writes the rows whole or not at all."""
        # Another worker may make the same rows.
        partial = f"{self._path(runs)}.{os.urandom(8).hex()}.partial"
        try:
            with open(partial, "xb") as file:
                file.write(lines)
                file.flush()
                os.fsync(file.fileno())
            os.replace(partial, self._path(runs))
        except BaseException:
            if os.path.exists(partial):
                os.unlink(partial)
            raise

    def _path(self, runs: _Runs) -> str:
        """The file of some runs: its name has everything that determines its rows."""
        made_by = f"{native.__version__}-{self.plan.fingerprint[:16]}"
        return os.path.join(self.folder or "", f"{made_by}-{runs[0]}-{runs[1]}.csv")


def study(
    study: str | os.PathLike[str],
    *,
    executor: Any = None,
    shards: int | None = None,
    folder: str | os.PathLike[str] | None = None,
    threads: int = 1,
    page: bool = False,
    progress: Progress = False,
) -> Study:
    """Makes the runs of a study. The rows are those of ``wetclutch study``, wherever they are made.

    A task makes some of the runs from the text of the study's files. With an executor each worker has at most two tasks at a time. A worker of
    Dask may die on the way: its tasks are made again.

    Args:
        study: A study file, or its text if it has more than one line; the files that a text names are in the working folder.
        executor: Where the tasks run: any ``concurrent.futures.Executor``, or a ``dask.distributed.Client``; in this process if it is None.
        shards: How many tasks there are; tasks of about 1000 runs that return less than 1 MB if it is None.
        folder: Folder, shared by all workers, in which each task writes its rows, whole or not at all. Tasks whose rows are there are not made
            again: an interrupted study goes on. Without a folder the rows come back as bytes.
        threads: Threads of each task.
        page: Whether to make the page.
        progress: True for a bar, or a function that takes words and the done fraction, at most ten times a second.

    Raises:
        InputError: A file cannot be read, something in it is wrong, or an argument is out of range.
        WorkError: Workers died again and again at the same runs, or there are no gains for the vehicle.
    """
    check_range("threads", threads, 1, 1024)
    with of_files(None if _is_text(study) else study):
        plan, name, at_once = _planned(study)
    tasks = list(_tasks(plan, shards, at_once))
    shared = None if folder is None else _prepared(folder)
    where = _Where(plan, shared, threads)
    made: dict[_Runs, bytes | None] = {runs: None for runs in tasks if where.has(runs)}
    missing = [runs for runs in tasks if runs not in made]
    with reported(progress) as report:
        tell = counted(report, plan.runs, "runs")
        for first, end in made:
            tell(end - first)
        for (first, end), lines in in_executor(executor, partial(_made, where), missing, partial(_words, folder=shared)):
            made[first, end] = lines
            tell(end - first)
    lines = b"".join(where.read(runs) if made[runs] is None else made[runs] or b"" for runs in tasks)
    shown = (name if _is_text(study) else os.fspath(study)) if page else None
    rows, html = native.study_table(_unpacked(plan), lines, shown)
    return Study(name, Table(rows), plan.header.encode() + b"\n" + lines, html)


def _is_text(study: str | os.PathLike[str]) -> bool:
    return isinstance(study, str) and "\n" in study


def _planned(study: str | os.PathLike[str]) -> tuple[_Plan, str, int]:
    path, text = ("study.toml", str(study)) if _is_text(study) else (os.fspath(study), None)
    files, name, fingerprint, runs, header, at_once = native.study_files(path, text)
    absolute = [os.path.abspath(path) for path, _ in files]
    root = os.path.commonpath([os.path.dirname(path) for path in absolute])
    relative = tuple((os.path.relpath(path, root), text) for path, (_, text) in zip(absolute, files, strict=True))
    return _Plan(relative, fingerprint, runs, header), name, at_once


def _tasks(plan: _Plan, shards: int | None, at_once: int) -> Iterator[_Runs]:
    """The first run of each task, and the one after its last."""
    if shards is None:
        row_bytes = _CELL_BYTES * (plan.header.count(",") + 1)
        shards = -(-plan.runs // max(1, min(_BYTES // row_bytes, _RUNS if at_once > 1 else 1)))
    if not 1 <= shards <= plan.runs:
        raise InputError(f"shards is {shards}, expected 1 to {plan.runs}, the number of runs")
    for task in range(shards):
        yield plan.runs * task // shards, plan.runs * (task + 1) // shards


def _words(runs: _Runs, folder: str | None) -> str:
    """What a worker does that makes these runs, and what to do if it dies."""
    kept = "with folder= nothing that is made is lost" if folder is None else "the same call goes on from the rows in the folder"
    return f"made the runs {runs[0]} to {runs[1] - 1}\nmore shards make each task smaller; {kept}"


def _made(where: _Where, runs: _Runs) -> bytes | None:
    """The task of a worker: makes runs, and returns their lines or writes them into the folder."""
    if where.has(runs):
        return None
    lines = native.study_rows(_unpacked(where.plan), *runs, where.threads)
    if where.folder is None:
        return lines
    where.write(runs, lines)
    return None


def _prepared(folder: str | os.PathLike[str]) -> str:
    folder = os.path.abspath(folder)
    os.makedirs(folder, exist_ok=True)
    return folder


#: Folders with the files of studies, by these files: each process has its own.
_FOLDERS: dict[tuple[tuple[str, str], ...], TemporaryDirectory[str]] = {}


def _unpacked(plan: _Plan) -> str:
    """The study file in a folder of this process."""
    folder = _FOLDERS.get(plan.files)
    if folder is None:
        from tempfile import TemporaryDirectory

        folder = TemporaryDirectory(prefix="wetclutch-")
        for name, text in plan.files:
            path = os.path.join(folder.name, name)
            os.makedirs(os.path.dirname(path), exist_ok=True)
            with open(path, "w", encoding="utf-8", newline="") as file:
                file.write(text)
        folder = _FOLDERS.setdefault(plan.files, folder)
    return os.path.join(folder.name, plan.files[0][0])
