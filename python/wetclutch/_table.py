"""Tables: Arrow data with units."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from typing import Any, ClassVar

from . import _wetclutch as native
from ._errors import InputError, WetclutchError


class Table:
    """Columns of the same length, by their names, as in a dict.

    Any library that reads Arrow data takes it without more: ``polars.DataFrame(table)``, ``pyarrow.table(table)``,
    ``pandas.DataFrame.from_arrow(table)``; units are in the metadata of the fields. ``table["time_s"]`` is a column: numbers as a
    NumPy array if NumPy is installed, else as a memoryview, in both cases without a copy; words as a list.

    >>> table = Table({"time_s": [0.0, 0.01], "gear": ["1", "1"]})
    >>> list(table), table.units["time_s"]
    (['time_s', 'gear'], 's')
    """

    # No Mapping: polars would take the columns of one by its own copies, and words as objects of Python, and not as Arrow data.
    __slots__ = ("_table",)

    _table: native.Table

    def __init__(self, data: Any) -> None:
        """A table of a data frame, of Arrow data, or of columns by their names.

        Args:
            data: Anything with Arrow data (polars, pyarrow, pandas with pyarrow, DuckDB), a pandas data frame, or a mapping from names
                to NumPy arrays, lists of numbers or lists of words. None and NaN are missing values.

        Raises:
            InputError: A column is neither of numbers, times nor words, two have one name, or they have different lengths.
            TypeError: This is no table.
        """
        self._table = _native(data)

    @property
    def units(self) -> dict[str, str | None]:
        """Units of the columns by their names; None of words and of numbers without one."""
        return dict(zip(self._table.names, self._table.units, strict=True))

    @property
    def rows(self) -> int:
        """How many rows there are."""
        return len(self._table)

    def to_pandas(self) -> Any:
        """The table as a pandas data frame."""
        import pandas as pd

        return pd.DataFrame({name: self[name] for name in self})

    def to_polars(self) -> Any:
        """The table as a polars data frame."""
        import polars as pl

        return pl.DataFrame(self)

    def to_numpy(self) -> dict[str, Any]:
        """The columns as NumPy arrays by their names, those of words as arrays of objects."""
        import numpy as np

        return {name: np.asarray(self[name], dtype=None if self._is_numbers(name) else object) for name in self}

    def _is_numbers(self, name: str) -> bool:
        return self._table.numbers(name) is not None

    def __getitem__(self, name: str) -> Any:
        numbers = self._table.numbers(name)
        if numbers is None:
            return self._table.words(name)
        try:
            import numpy as np
        except ImportError:
            return memoryview(numbers)
        return np.frombuffer(numbers, dtype=np.float64)

    def get(self, name: str, default: Any = None) -> Any:
        """A column, or the default where there is none of this name."""
        return self[name] if name in self else default

    def keys(self) -> list[str]:
        """Names of the columns."""
        return self._table.names

    def values(self) -> Iterator[Any]:
        """The columns."""
        return (self[name] for name in self)

    def items(self) -> Iterator[tuple[str, Any]]:
        """Names and columns."""
        return ((name, self[name]) for name in self)

    def __contains__(self, name: object) -> bool:
        return name in self._table.names

    def __iter__(self) -> Iterator[str]:
        return iter(self._table.names)

    def __len__(self) -> int:
        return len(self._table.names)

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object:
        return self._table.__arrow_c_stream__(requested_schema)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Table):
            return NotImplemented
        return list(self) == list(other) and all(_bytes(self, name) == _bytes(other, name) for name in self)

    __hash__: ClassVar[None] = None  # type: ignore[assignment]

    def __reduce__(self) -> tuple[Any, ...]:
        columns = {name: _plain(self, name) for name in self}
        return _unpickled, (columns,)

    def __repr__(self) -> str:
        names = ", ".join(list(self)[:6]) + (", ..." if len(self) > 6 else "")
        return f"Table({self.rows} rows: {names})"


def _native(data: Any) -> native.Table:
    if isinstance(data, native.Table):
        return data
    if isinstance(data, Table):
        return data._table
    is_pandas = hasattr(data, "columns") and hasattr(data, "iloc")
    if is_pandas:
        _refuse_twice([str(name) for name in data.columns])
    if hasattr(data, "iloc") and not is_pandas:
        raise InputError(f"a {type(data).__name__} is one column", hint="give a data frame, such as `series.to_frame()`")
    if hasattr(data, "__arrow_c_stream__"):
        try:
            return native.Table.from_arrow(_plain_columns(data))
        except ImportError:
            pass  # pandas exports Arrow data with pyarrow only.
        except WetclutchError:
            raise
        except Exception as error:
            # pandas: a column of numbers and words is no Arrow data, and is read below.
            if not is_pandas:
                raise InputError(f"the table cannot be read: {error}", hint="give columns of numbers, times or words") from error
    elif hasattr(data, "__arrow_c_array__"):
        return native.Table.from_arrow(data)
    if is_pandas:
        return _of_columns({str(name): data.iloc[:, at] for at, name in enumerate(data.columns)})
    if isinstance(data, Mapping):
        return _of_columns(data)
    raise TypeError(
        f"a {type(data).__name__} is no table: give a data frame, Arrow data, or a mapping from names to columns"
    )


def _of_columns(columns: Mapping[Any, Any]) -> native.Table:
    try:
        return native.Table.from_columns({name: _column(values) for name, values in columns.items()})
    except (TypeError, ValueError) as error:
        if isinstance(error, WetclutchError):
            raise
        raise InputError(str(error), hint="give columns of numbers, times or words, all of one length") from error


def _refuse_twice(names: list[str]) -> None:
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise InputError(f"two columns are called `{twice}`", hint="rename one of them, or leave it out", key=twice)


def _plain_columns(data: Any) -> Any:
    """The same with numbers where polars has columns without a type, which it exports with a buffer that Arrow's interface does not know, or
    decimals."""
    polars = sys.modules.get("polars")
    if polars is None or not isinstance(data, polars.DataFrame):
        return data
    odd = {kind: polars.Float64 for kind in data.dtypes if kind == polars.Null or isinstance(kind, polars.Decimal)}
    return data.cast(odd) if odd else data


def _column(values: Any) -> Any:
    """A column as a buffer of floats or a list."""
    if hasattr(values, "to_numpy"):
        values = values.to_numpy()
    kind = getattr(getattr(values, "dtype", None), "kind", None)
    if getattr(values, "ndim", 1) == 2 and 1 in values.shape:
        values = values.reshape(-1)
    if getattr(values, "ndim", 1) != 1:
        raise InputError(f"a column has one dimension, got {values.ndim}", hint="give each column of a matrix its name")
    if kind in ("f", "i", "u", "b"):
        import numpy as np

        return np.ascontiguousarray(values, dtype=np.float64)
    if kind == "M":
        return (values.astype("datetime64[ns]").astype("int64") / 1e9).tolist()
    if kind == "m":
        return (values.astype("timedelta64[ns]").astype("int64") / 1e9).tolist()
    return [None if value is None or value != value else value for value in values]


def _plain(table: Table, name: str) -> Any:
    numbers = table._table.numbers(name)
    return table._table.words(name) if numbers is None else bytes(memoryview(numbers))


def _bytes(table: Table, name: str) -> Any:
    return _plain(table, name)


def _unpickled(columns: dict[str, Any]) -> Table:
    # A column of words is a tuple, since there may be none.
    given = {name: memoryview(of).cast("d") if isinstance(of, bytes) else tuple(of) for name, of in columns.items()}
    return Table(native.Table.from_columns(given))
