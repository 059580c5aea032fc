from __future__ import annotations

import math
import pickle
from datetime import date, datetime, timedelta, timezone
from decimal import Decimal
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import wetclutch as wc

np = pytest.importorskip("numpy")
pd = pytest.importorskip("pandas")
pl = pytest.importorskip("polars")
pa = pytest.importorskip("pyarrow")


def frame() -> dict[str, list[Any]]:
    return {"time_s": [0.0, 0.01, 0.02], "output_speed_rad_s": [1.5, None, math.inf], "gear": ["1", None, "N"]}


@pytest.mark.parametrize(
    "make",
    [
        lambda data: data,
        lambda data: pl.DataFrame(data),
        lambda data: pl.DataFrame(data).with_columns(pl.col("gear").cast(pl.Categorical)),
        lambda data: pa.table(data),
        lambda data: pa.RecordBatch.from_pydict(data),
        lambda data: pd.DataFrame(data),
        lambda data: pa.concat_tables([pa.table(data).slice(0, 1), pa.table(data).slice(1)]),
    ],
)
def test_every_kind_of_frame_gives_the_same_table(make: Any) -> None:
    table = wc.Table(make(frame()))
    assert list(table) == ["time_s", "output_speed_rad_s", "gear"]
    speeds = list(table["output_speed_rad_s"])
    assert speeds[0] == 1.5 and math.isnan(speeds[1]) and speeds[2] == math.inf
    assert table["gear"] == ["1", "", "N"]
    assert table.units == {"time_s": "s", "output_speed_rad_s": "rad/s", "gear": None}


def test_tables_leave_with_units_to_every_library() -> None:
    table = wc.Table(frame())
    arrow = pa.table(table)
    assert arrow.schema.field("output_speed_rad_s").metadata == {b"unit": b"rad/s"}
    assert arrow["gear"].to_pylist() == ["1", "", "N"]
    assert pl.DataFrame(table).shape == (3, 3)
    assert table.to_pandas().shape == (3, 3)
    assert wc.Table(pl.DataFrame(table)) == table == wc.Table(arrow) == wc.Table(table.to_pandas())
    assert wc.Table(table.to_numpy()) == table
    assert pickle.loads(pickle.dumps(table)) == table
    empty = wc.Table(pl.DataFrame({"time_s": pl.Series([], dtype=pl.Float64), "gear": pl.Series([], dtype=pl.String)}))
    assert pickle.loads(pickle.dumps(empty)) == empty and empty["gear"] == []


def test_columns_are_seen_without_a_copy_and_cannot_be_written() -> None:
    table = wc.Table({"time_s": np.arange(1000.0)})
    first, second = table["time_s"], table["time_s"]
    assert np.shares_memory(first, second)
    with pytest.raises(ValueError):
        first[0] = 1.0
    del table
    assert first[999] == 999.0


@pytest.mark.parametrize("kind", ["float32", "int8", "int64", "uint16", "bool"])
def test_every_width_of_numbers_is_taken(kind: str) -> None:
    values = np.array([0, 1, 1, 0], dtype=kind)
    assert list(wc.Table({"x": values})["x"]) == [0.0, 1.0, 1.0, 0.0]
    assert list(wc.Table(pa.table({"x": values}))["x"]) == [0.0, 1.0, 1.0, 0.0]


def test_strided_and_empty_columns() -> None:
    assert list(wc.Table({"x": np.arange(10.0)[::-3]})["x"]) == [9.0, 6.0, 3.0, 0.0]
    assert wc.Table({"x": []}).rows == 0 and wc.Table({}).rows == 0
    assert pa.table(wc.Table({"x": np.array([])})).num_rows == 0


def test_a_column_without_a_type_has_missing_numbers() -> None:
    for frame in (pl.DataFrame({"x": [None, None], "y": [1.0, 2.0]}), pa.table({"x": [None, None], "y": [1.0, 2.0]})):
        table = wc.Table(frame)
        assert np.isnan(table["x"]).all() and list(table["y"]) == [1.0, 2.0]
    assert wc.Table(pl.DataFrame({"x": []})).rows == 0


def test_times_of_day_are_seconds() -> None:
    times = pd.to_datetime(["2026-01-01 00:00:00.250", "2026-01-01 00:00:01.000"])
    expected = [1767225600.25, 1767225601.0]
    assert list(wc.Table(pd.DataFrame({"time_s": times}))["time_s"]) == expected
    assert list(wc.Table(pa.table({"time_s": pa.array(times)}))["time_s"]) == expected


def test_what_is_no_table_is_refused() -> None:
    for wrong in (3, "log.csv", [1, 2], {"x": [object()]}, {"x": [[1.0]]}):
        with pytest.raises((TypeError, wc.InputError)):
            wc.Table(wrong)
    with pytest.raises(ValueError, match="has 1 values"):
        wc.Table({"x": [1.0, 2.0], "y": [1.0]})
    with pytest.raises(ValueError, match="one dimension"):
        wc.Table({"x": np.zeros((2, 2))})
    with pytest.raises(KeyError):
        wc.Table({"x": [1.0]})["y"]


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(width=64), max_size=40), st.lists(st.one_of(st.none(), st.text(max_size=5)), max_size=40))
def test_numbers_and_words_come_back_as_they_were(numbers: list[float], words: list[str | None]) -> None:
    count = min(len(numbers), len(words))
    if not any(words[:count]):
        words = ["w"] * count
    table = wc.Table({"x": numbers[:count], "word": words[:count]})
    again = wc.Table(pl.DataFrame(table))
    assert again == table
    if count:
        assert table["word"] == [word or "" for word in words[:count]]


def address(column: Any) -> int:
    return int(np.asarray(column).__array_interface__["data"][0])


def test_numbers_leave_without_a_copy() -> None:
    table = wc.Table({"time_s": np.arange(1000.0), "gear": ["1"] * 1000})
    own = address(table["time_s"])
    arrow, polars = pa.table(table), pl.DataFrame(table)
    assert own == arrow["time_s"].chunk(0).buffers()[1].address == address(polars["time_s"].to_numpy())
    del table
    assert arrow["time_s"][999].as_py() == polars["time_s"][999] == 999.0


def test_a_table_of_a_frame_lives_as_long_as_it_is_needed() -> None:
    data = pl.concat([pl.DataFrame(frame()), pl.DataFrame(frame())], rechunk=False)
    table, whole = wc.Table(data), wc.Table(data.rechunk())
    del data
    assert table.rows == 6 and table == whole and table["gear"][3:] == ["1", "", "N"]


def test_a_table_has_its_columns_as_a_dict() -> None:
    table = wc.Table(frame())
    assert table.keys() == list(table) == list(dict(table)) and "gear" in table and 3 not in table
    assert [name for name, _ in table.items()] == list(table) and len(list(table.values())) == len(table) == 3
    assert table.get("gear") == ["1", "", "N"] and table.get("none") is None and table.get("none", 1) == 1
    with pytest.raises(KeyError):
        table["none"]


def test_missing_times_and_masked_values_are_no_numbers() -> None:
    times = np.array(["2020-01-01", "NaT", "3020-01-01"], dtype="datetime64[s]")
    first, second, third = wc.Table({"t": times})["t"]
    assert first == 1_577_836_800.0 and math.isnan(second) and third == 33_134_745_600.0
    lengths = np.array([1500, "NaT"], dtype="timedelta64[ms]")
    assert wc.Table({"t": lengths})["t"][0] == 1.5 and math.isnan(wc.Table({"t": lengths})["t"][1])
    masked = np.ma.masked_array([1.0, -999.0, 3.0], mask=[False, True, False])
    one, none, three = wc.Table({"x": masked})["x"]
    assert (one, three) == (1.0, 3.0) and math.isnan(none)
    words = wc.Table({"gear": pd.array(["1", None], dtype="string")})
    assert words["gear"] == ["1", ""]
    day = datetime(2020, 1, 1)
    listed = wc.Table({"t": [day, None, day.replace(tzinfo=timezone(timedelta(hours=1)))], "d": [timedelta(seconds=2)] * 3})
    assert listed["t"][0] == 1_577_836_800.0 and math.isnan(listed["t"][1]) and listed["t"][2] == 1_577_833_200.0
    assert list(listed["d"]) == [2.0] * 3


def test_columns_of_other_kinds_are_left_out_with_a_warning() -> None:
    frame = pl.DataFrame({"time_s": [0.0, 0.01], "day": [date(2024, 1, 1)] * 2, "tags": [["a"], []]})
    with pytest.warns(UserWarning, match=r"day \(Date32\), tags"):
        table = wc.Table(frame)
    assert list(table) == ["time_s"]
    decimals = pa.table({"x": pa.array([Decimal("1.25"), None]), "g": pa.array([1.5, None]).dictionary_encode()})
    numbers = wc.Table(decimals)
    assert numbers["x"][0] == 1.25 and math.isnan(numbers["x"][1])
    assert numbers["g"][0] == 1.5 and math.isnan(numbers["g"][1])


def test_a_mixed_column_of_pandas_leaves_index_times_and_words_as_they_are() -> None:
    times = pd.to_datetime(["2020-01-01T00:00:00", None, "2020-01-01T00:00:01"], utc=True)
    words = pd.array(["1", None, "2"], dtype="string")
    frame = pd.DataFrame({"when": times, "gear": words, "comment": [1, "a", None]})
    table = wc.Table(frame.set_index(pd.Index([0.0, 0.01, 0.02], name="time_s")))
    assert list(table["time_s"]) == [0.0, 0.01, 0.02] and table["gear"] == ["1", "", "2"]
    assert table["comment"] == ["1", "a", ""]
    assert table["when"][2] - table["when"][0] == 1.0 and math.isnan(table["when"][1])


def test_every_unit_of_a_name_is_known() -> None:
    names = ["w_j", "m_kg", "k_n_m_rad", "d_m", "x_rad", "t_n_m", "jerk_m_s3", "dose_m_s1_75", "count"]
    units = wc.Table({name: [1.0] for name in names}).units
    assert list(units.values()) == ["J", "kg", "N m/rad", "m", "rad", "N m", "m/s^3", "m/s^1.75", None]


def test_what_is_no_table_is_named() -> None:
    with pytest.raises(TypeError, match="collect"):
        wc.Table(pl.LazyFrame({"time_s": [0.0]}))
    with pytest.raises(wc.InputError, match="time_s"):
        wc.Table({"time_s": 1.0})
