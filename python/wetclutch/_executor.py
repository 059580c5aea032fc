"""Tasks in an executor."""

from __future__ import annotations

import itertools
import os
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

from ._errors import WorkError
from ._progress import Progress, Report, reported

if TYPE_CHECKING:
    from concurrent.futures import Executor, Future

_Of = TypeVar("_Of")
_Result = TypeVar("_Result")
#: Tasks that are given to each worker at a time: a scheduler need not know the others.
_WINDOW = 2


def in_executor(executor: Any, task: Callable[[_Of], _Result], of: Iterable[_Of], words: Callable[[_Of], str]) -> Iterator[tuple[_Of, _Result]]:
    """Does a task for each of these and yields them with their results as they are done.

    Args:
        executor: Any ``concurrent.futures.Executor``, or a ``dask.distributed.Client``; this process if it is None.
        task: What is done; it and its argument are pickled where the workers are processes.
        of: What it is done for.
        words: What its workers do, for the error of one that died.

    Raises:
        WorkError: Workers died at the same task again and again.
    """
    if executor is None:
        yield from ((one, task(one)) for one in of)
        return
    from concurrent.futures import FIRST_COMPLETED, wait

    pool, workers = _pool(executor)
    waiting = iter(of)
    running: dict[Future[_Result], _Of] = {}

    def submit(tasks: int) -> None:
        for one in itertools.islice(waiting, tasks):
            running[pool.submit(task, one)] = one

    try:
        submit(_WINDOW * workers)
        while running:
            finished, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in finished:
                one = running.pop(future)
                try:
                    result = future.result()
                except Exception as error:
                    raise _failed(error, words(one)) from error
                submit(1)
                yield one, result
    finally:
        for future in running:
            future.cancel()


def _pool(executor: Any) -> tuple[Executor, int]:
    """The executor, and how many workers it has."""
    if hasattr(executor, "get_executor"):
        return executor.get_executor(), max(1, sum(executor.nthreads().values()))
    if not hasattr(executor, "submit"):
        kind = type(executor).__name__
        raise TypeError(f"a {kind} is no executor: give a concurrent.futures.Executor or a dask.distributed.Client")
    return executor, max(1, getattr(executor, "_max_workers", None) or os.cpu_count() or 1)


def _failed(error: Exception, words: str) -> Exception:
    """The error of a task: that of its worker if that died."""
    from concurrent.futures import BrokenExecutor

    if not isinstance(error, BrokenExecutor) and type(error).__name__ != "KilledWorker":
        return error
    died, _, hint = words.partition("\n")
    message = f"workers died while they {died}: the system ended them for want of memory, or they could not start"
    start = 'processes that start anew run the script again: put its calls below `if __name__ == "__main__":`'
    return WorkError(message, hint=f"{hint}; {start}" if hint else start)


def each(executor: Any, task: Callable[[_Of], _Result], of: Sequence[_Of], progress: Progress, what: str) -> tuple[_Result, ...]:
    """The results of a task for each of these, in their order; `what` is what they are, for the words of the progress.

    An exception of a task has a note that says which one it was.
    """
    results: dict[int, _Result] = {}
    words = "worked at {} of " + f"{len(of)} {what}\nmore memory for each worker, or fewer of them"
    with reported(progress) as report:
        tell = counted(report, len(of), what)
        numbered = in_executor(executor, partial(_numbered, task), list(enumerate(of)), lambda one: words.format(one[0] + 1))
        for (at, _), result in numbered:
            results[at] = result
            tell(1)
    return tuple(results[at] for at in range(len(of)))


def _numbered(task: Callable[[_Of], _Result], one: tuple[int, _Of]) -> _Result:
    at, of = one
    try:
        return task(of)
    except Exception as error:
        error.add_note(f"in number {at + 1} of those given")
        raise


def counted(report: Report | None, all_of: int, what: str) -> Callable[[int], None]:
    """Counts what is done and reports it, at most ten times a second."""
    done, next_s = 0, 0.0

    def tell(more: int) -> None:
        nonlocal done, next_s
        done += more
        now_s = time.monotonic()
        if report is not None and (now_s >= next_s or done == all_of):
            next_s = now_s + 0.1
            report(f"{done} of {all_of} {what}", done / all_of)

    return tell
