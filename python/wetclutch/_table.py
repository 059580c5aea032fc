"""Tables: Arrow data with units."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator, Mapping
from datetime import datetime, timedelta, timezone
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
                to NumPy arrays, lists of numbers, times or words. None, NaN and masked values are missing. Times are seconds since
                1970, those without a time zone in UTC. Columns of Arrow data of other kinds, such as dates or lists, are left out with a
                warning.

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
    if type(data).__name__ == "LazyFrame":
        raise TypeError("a LazyFrame has no rows yet: give its `.collect()`")
    is_pandas = hasattr(data, "columns") and hasattr(data, "iloc")
    if is_pandas:
        _refuse_twice([str(name) for name in data.columns])
    if hasattr(data, "iloc") and not is_pandas:
        raise InputError(f"a {type(data).__name__} is one column", hint="give a data frame, such as `series.to_frame()`")
    if hasattr(data, "__arrow_c_stream__"):
        try:
            return _of_arrow(_plain_columns(data))
        except ImportError:
            pass  # pandas exports Arrow data with pyarrow only.
        except WetclutchError:
            raise
        except Exception as error:
            if not is_pandas:
                raise InputError(f"the table cannot be read: {error}", hint="give columns of numbers, times or words") from error
            # A column of numbers and words is no Arrow data.
            try:
                return _of_arrow(_of_words(data))
            except WetclutchError:
                raise
            except Exception:
                pass  # Column by column then, which says which of them cannot be read.
    elif hasattr(data, "__arrow_c_array__"):
        return _of_arrow(data)
    if is_pandas:
        named = [name for name in data.index.names if name is not None and name not in data.columns]
        if named:
            data = data.reset_index(level=named)
        return _of_columns({str(name): data.iloc[:, at] for at, name in enumerate(data.columns)})
    if isinstance(data, Mapping):
        return _of_columns(data)
    raise TypeError(
        f"a {type(data).__name__} is no table: give a data frame, Arrow data, or a mapping from names to columns"
    )


def _of_arrow(data: Any) -> native.Table:
    table = native.Table.from_arrow(data)
    if table.left_out:
        warnings.warn(
            f"columns that are neither numbers, times nor words are left out: {', '.join(table.left_out)}", stacklevel=4
        )
    return table


def _of_words(data: Any) -> Any:
    """A pandas data frame with words where a column has values of several kinds."""
    import pandas as pd

    mixed = [at for at in range(data.shape[1]) if pd.api.types.infer_dtype(data.iloc[:, at]) in ("mixed", "mixed-integer", "unknown-array")]
    data = data.copy()
    for at in mixed:
        words = [None if _is_missing(value) else str(value) for value in data.iloc[:, at]]
        data.isetitem(at, pd.Series(words, index=data.index, dtype=object))
    return data


def _of_columns(columns: Mapping[Any, Any]) -> native.Table:
    read: dict[Any, Any] = {}
    for name, values in columns.items():
        try:
            read[name] = _column(values)
        except (TypeError, ValueError) as error:
            if isinstance(error, WetclutchError):
                raise
            raise InputError(f"column `{name}`: {error}", hint=_COLUMNS) from error
    try:
        return native.Table.from_columns(read)
    except (TypeError, ValueError) as error:
        raise InputError(str(error), hint=_COLUMNS) from error


_COLUMNS = "give columns of numbers, times or words, all of one length"


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
    if kind is None or kind not in "fiubMm":
        return [_plain_value(value) for value in values]
    import numpy as np

    is_missing = np.ma.getmaskarray(values) if isinstance(values, np.ma.MaskedArray) else None
    numbers = np.ma.getdata(values)
    if kind in "Mm":
        is_missing = np.isnat(numbers) if is_missing is None else is_missing | np.isnat(numbers)
        # In us the years of all calendars have numbers.
        numbers = numbers.astype("datetime64[us]" if kind == "M" else "timedelta64[us]").astype(np.int64) / 1e6
    numbers = np.ascontiguousarray(numbers, dtype=np.float64)
    return numbers if is_missing is None else np.where(is_missing, np.nan, numbers)


def _plain_value(value: Any) -> Any:
    """A value of a list: a number, a word, or None."""
    if _is_missing(value):
        return None
    if isinstance(value, datetime):
        return (value if value.tzinfo else value.replace(tzinfo=timezone.utc)).timestamp()
    return value.total_seconds() if isinstance(value, timedelta) else value


def _is_missing(value: Any) -> bool:
    # Pandas' NA is not equal to itself, and not unequal either; a masked value of NumPy neither.
    return value is None or type(value).__name__ in ("NAType", "NaTType", "MaskedConstant") or (isinstance(value, (float, int)) or hasattr(value, "dtype")) and value != value


def _plain(table: Table, name: str) -> Any:
    numbers = table._table.numbers(name)
    return table._table.words(name) if numbers is None else bytes(memoryview(numbers))


def _bytes(table: Table, name: str) -> Any:
    return _plain(table, name)


def _unpickled(columns: dict[str, Any]) -> Table:
    # A column of words is a tuple, since there may be none.
    given = {name: memoryview(of).cast("d") if isinstance(of, bytes) else tuple(of) for name, of in columns.items()}
    return Table(native.Table.from_columns(given))
