#!/usr/bin/env python3
"""Makes the files of this folder with the libraries that others use.

    pip install asammdf python-can cantools pyarrow polars && python make.py

The tests read the files and know the formulas below, so they need no Python. `formulas` is stated again in
`tests/formats.rs`; nothing here comes from our own readers. Versions that made the files stand in `made_with.txt`.
"""

import struct
from decimal import Decimal
from pathlib import Path

import asammdf
import can
import cantools
import numpy as np
import polars
import pyarrow as pa
import pyarrow.parquet as pq
from asammdf import MDF, Signal
from asammdf.blocks import v4_constants as v4c
from asammdf.blocks.source_utils import Source

HERE = Path(__file__).parent
ROWS = 40


def fast():
    """Time and engine speed in rpm of the fast group: every 10 ms."""
    i = np.arange(ROWS)
    return i * 0.01, 800.0 + 10.0 * i


def slow():
    """Time, turbine speed in rpm (16 bits, 0.25 rpm) and gear of the slow group: every 25 ms from 5 ms."""
    i = np.arange(ROWS // 2)
    return 0.005 + i * 0.025, (4 * (700 + 3 * i)).astype("<u2"), (1 + i // 10).astype("u1")


def signals(invalid=False, conversions=False):
    t, engine = fast()
    s, turbine, gear = slow()
    bits = (np.arange(ROWS) % 5 == 3) if invalid else None
    first = [Signal(engine, t, name="N_Eng", unit="1/min", invalidation_bits=bits)]
    second = [
        Signal(turbine, s, name="N_Turb", unit="1/min", conversion={"a": 0.25, "b": 0.0}),
        Signal(gear, s, name="Gear", unit=""),
    ]
    if conversions:
        i = np.arange(ROWS // 2)
        second += [
            # Rational: (P1 x^2 + P2 x + P3) / (P4 x^2 + P5 x + P6) = (2 x + 6) / 4.
            Signal(i.astype("<i4"), s, name="Rational", unit="bar",
                   conversion={"P1": 0, "P2": 2, "P3": 6, "P4": 0, "P5": 0, "P6": 4}),
            # Table with lines between its points: 0 -> 0, 10 -> 100, 20 -> 400.
            Signal(i.astype("<u2"), s, name="Table", unit="mA",
                   conversion={"raw_0": 0, "phys_0": 0, "raw_1": 10, "phys_1": 100, "raw_2": 20, "phys_2": 400,
                               "interpolation": True}),
            Signal((i - 5).astype("<i2"), s, name="Signed", unit="Nm"),
            Signal((i / 8).astype("<f4"), s, name="Single", unit="V"),
            # Text: the number before it is what a log can give.
            Signal((i % 2).astype("u1"), s, name="Lever", unit="",
                   conversion={"val_0": 0, "text_0": b"N", "val_1": 1, "text_1": b"D", "default": b"?"}),
        ]
    return first, second


def mdf():
    for version in ("4.00", "4.10", "4.20"):
        with MDF(version=version) as file:
            for group in signals():
                file.append(group, acq_name="fast" if len(group) == 1 else "slow", common_timebase=True)
            file.save(HERE / f"plain_{version.replace('.', '')}.mf4", overwrite=True)
    with MDF(version="4.10") as file:
        for group in signals(conversions=True):
            file.append(group, acq_name="fast" if len(group) == 1 else "slow", common_timebase=True)
        file.save(HERE / "deflate.mf4", overwrite=True, compression=1)
        file.save(HERE / "transposed.mf4", overwrite=True, compression=2)
        # Groups in several blocks each, as they are from 4 MiB on.
        file.configure(write_fragment_size=128)
        file.save(HERE / "blocks.mf4", overwrite=True, compression=2)
        for name, algorithm in [("zstd", v4c.CompressionAlgorithm.TRANSPOSED_ZSTD), ("lz4", v4c.CompressionAlgorithm.LZ4)]:
            file.save(HERE / f"{name}.mf4", overwrite=True, compression=algorithm)
    with MDF(version="4.10") as file:
        for group in signals(invalid=True):
            file.append(group, acq_name="fast" if len(group) == 1 else "slow", common_timebase=True)
        file.save(HERE / "invalidation.mf4", overwrite=True)
    with MDF(version="4.10") as file:
        t, engine = fast()
        file.append([Signal((engine / 10).astype("<f2"), t, name="Half", unit="V"), Signal(engine.astype(">f4"), t, name="Big", unit="V")])
        file.save(HERE / "half.mf4", overwrite=True)
    remote()
    unsorted()


def remote():
    """Columns in groups of their own, whose time is in another group. The writer of asammdf 8.8 asks a signal for what it has not."""

    class Whole(Signal):
        axes, conversions, units, comments, display_names_ = {}, {}, {}, {}, {}

    t, engine = fast()
    with MDF(version="4.20") as file:
        file._mdf._column_storage = file._mdf._use_ld_blocks = True
        file.append([Whole(engine, t, name="N_Eng", unit="1/min"), Whole(engine, t, name="N_Turb", unit="1/min")], common_timebase=True)
        file.save(HERE / "remote.mf4", overwrite=True)


def unsorted():
    """Two channel groups in one data group, their records mixed, as bus loggers write them. asammdf sorts what it
    writes, so the blocks are put together by hand; asammdf then has to read the same values."""
    t, engine = fast()
    s, turbine, _ = slow()
    out = bytearray()

    def put(block):
        while len(out) % 8:
            out.append(0)
        at = len(out)
        out.extend(block)
        return at

    def block(name, links, data):
        return struct.pack("<4sIQQ", name, 0, 24 + 8 * len(links) + len(data), len(links)) + struct.pack(
            f"<{len(links)}Q", *links) + data

    def text(words):
        data = words.encode() + b"\0"
        return put(block(b"##TX", [], data + b"\0" * (-len(data) % 8)))

    out.extend(struct.pack("<8s8s8s4sHHxxxx26sHH", b"MDF     ", b"4.10    ", b"make.py ", b"\0" * 4, 410, 0, b"\0" * 26, 0, 0)[:64])
    while len(out) < 64:
        out.append(0)
    hd = put(block(b"##HD", [0] * 6, struct.pack("<QhhBBBBdd", 0, 0, 0, 0, 0, 0, 0, 0.0, 0.0)))
    assert hd == 64

    def channel(name, unit, kind, sync, dtype, offset, bits, after, conversion=0):
        return put(block(b"##CN", [after, 0, text(name), 0, conversion, 0, text(unit), 0], struct.pack(
            "<BBBBIIIIBBHdddddd", kind, sync, dtype, 0, offset, bits, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0)))

    linear = put(block(b"##CC", [0, 0, 0, 0], struct.pack("<BBHHHdddd", 1, 0, 0, 0, 2, 0, 0, 0.0, 0.25)))
    value = channel("N_Eng", "1/min", 0, 0, 4, 8, 64, 0)
    first = channel("time", "s", 2, 1, 4, 0, 64, value)
    value = channel("N_Turb", "1/min", 0, 0, 0, 8, 16, 0, linear)
    second = channel("time", "s", 2, 1, 4, 0, 64, value)

    def group(record, cycles, size, first_channel, after, name):
        return put(block(b"##CG", [after, first_channel, text(name), 0, 0, 0], struct.pack(
            "<QQHHIII", record, cycles, 0, 0, 0, size, 0)))

    slow_group = group(2, len(s), 10, second, 0, "slow")
    fast_group = group(1, len(t), 16, first, slow_group, "fast")
    records = [(time, struct.pack("<Bdd", 1, time, rpm)) for time, rpm in zip(t, engine)]
    records += [(time, struct.pack("<BdH", 2, time, raw)) for time, raw in zip(s, turbine)]
    data = put(block(b"##DT", [], b"".join(record for _, record in sorted(records, key=lambda pair: pair[0]))))
    dg = put(block(b"##DG", [0, fast_group, data, 0], struct.pack("<B7x", 1)))
    history = put(block(b"##FH", [0, text("<FHcomment><TX>made by make.py</TX></FHcomment>")], struct.pack("<QhhB3x", 0, 0, 0, 0)))
    struct.pack_into("<QQ", out, hd + 24, dg, history)
    (HERE / "unsorted.mf4").write_bytes(bytes(out))
    with MDF(HERE / "unsorted.mf4") as file:
        assert np.array_equal(file.get("N_Eng").samples, engine) and np.array_equal(file.get("N_Eng").timestamps, t)
        assert np.array_equal(file.get("N_Turb").samples, turbine * 0.25)


DBC = '''VERSION ""

NS_ :

BS_:

BU_: TCU ECU

BO_ 256 Engine: 8 ECU
 SG_ N_Eng : 0|16@1+ (0.25,0) [0|16383.75] "rpm" TCU
 SG_ Tq_Eng : 23|16@0- (0.1,0) [-3276|3276] "Nm" TCU
 SG_ Throttle : 32|8@1+ (0.4,0) [0|100] "%" TCU
 SG_ Mode M : 40|2@1+ (1,0) [0|3] "" TCU
 SG_ T_Oil m0 : 48|8@1+ (1,-40) [-40|215] "degC" TCU
 SG_ T_Air m1 : 48|8@1+ (0.5,-40) [-40|87] "degC" TCU

BO_ 2566834709 Gearbox: 8 TCU
 SG_ N_Turb : 7|16@0+ (0.25,0) [0|16383.75] "rpm" ECU
 SG_ Gear : 19|4@1+ (1,0) [0|15] "" ECU
 SG_ P_Clutch : 32|32@1- (1,0) [0|0] "bar" ECU

SIG_VALTYPE_ 2566834709 P_Clutch : 1;
'''


def frames():
    """Frames of the two messages, every 10 ms and, for the second, 2 ms later. cantools encodes them."""
    database = cantools.database.load_file(HERE / "bus.dbc")
    for i in range(ROWS):
        engine = {"N_Eng": 800 + 10 * i, "Tq_Eng": 2.5 * i - 20, "Throttle": 0.4 * i, "Mode": i % 2}
        engine["T_Oil" if i % 2 == 0 else "T_Air"] = 60 if i % 2 == 0 else 21.5
        gearbox = {"N_Turb": 700 + 3 * i, "Gear": 1 + i // 20, "P_Clutch": i / 8}
        for message, values, shift in (("Engine", engine, 0.0), ("Gearbox", gearbox, 0.002)):
            encoded = database.encode_message(message, values)
            yield can.Message(timestamp=1000.0 + i * 0.01 + shift, arbitration_id=database.get_message_by_name(message).frame_id,
                              is_extended_id=message == "Gearbox", data=encoded, channel=0, is_rx=True)
    # A message that the DBC does not have, and one that is too short for its signals.
    yield can.Message(timestamp=1001.0, arbitration_id=0x7df, is_extended_id=False, data=[1, 2, 3], channel=0, is_rx=True)
    yield can.Message(timestamp=1001.01, arbitration_id=256, is_extended_id=False, data=[0, 4], channel=0, is_rx=True)


def bus():
    # cantools writes the DBC from what it read, in its own layout.
    (HERE / "bus.dbc").write_text(cantools.database.load_string(DBC, "dbc").as_dbc_string().replace("\r\n", "\n"))
    writers = (("bus.blf", can.BLFWriter), ("bus.asc", can.ASCWriter), ("bus.log", can.CanutilsLogWriter), ("bus.mf4", can.MF4Writer))
    for name, writer in writers:
        with writer(str(HERE / name)) as log:
            for message in frames():
                log.on_message_received(message)
    with can.BLFWriter(str(HERE / "fd.blf")) as blf, can.ASCWriter(str(HERE / "fd.asc")) as asc:
        for i in range(8):
            data = bytes([0x40 + i, 0x0C]) + bytes(10)
            message = can.Message(timestamp=1000.0 + i * 0.01, arbitration_id=256, is_extended_id=False, is_fd=True,
                                  bitrate_switch=True, data=data, channel=0, is_rx=True)
            blf.on_message_received(message)
            asc.on_message_received(message)


def parquet():
    i = np.arange(ROWS)
    engine = [None if k % 7 == 2 else 800.0 + 10 * k for k in range(ROWS)]
    table = pa.table({
        "time_s": pa.array(i * 0.01),
        "N_Eng [rpm]": pa.array(engine, pa.float64()),
        "gear": pa.array((1 + i // 20).astype("int8")),
        "locked": pa.array((i % 2 == 0)),
        "note": pa.array([f"row {k}" for k in range(ROWS)]),
        "turbine_speed_rpm": pa.array((700 + 3 * i).astype("float32")),
    })
    pq.write_table(table, HERE / "snappy.parquet", row_group_size=16)
    pq.write_table(table, HERE / "gzip.parquet", compression="gzip", use_dictionary=False, data_page_version="2.0")
    pq.write_table(table, HERE / "lz4.parquet", compression="lz4")
    pq.write_table(table.slice(0, 3), HERE / "brotli.parquet", compression="brotli")
    # Zstandard is what polars takes by itself.
    pq.write_table(table, HERE / "zstd.parquet", compression="zstd")
    pq.write_table(table.slice(0, 0), HERE / "no_rows.parquet")
    polars.from_arrow(table).write_parquet(HERE / "polars.parquet")
    stamps = table.set_column(0, "when", pa.array(i * 10_000, pa.timestamp("us")))
    pq.write_table(stamps, HERE / "stamps.parquet", compression="none")
    types()


def types():
    """Every way in which Parquet stores a number."""
    i = np.arange(ROWS)
    stamps = 1_700_000_000_000_000_000 + i * 10_000_000
    cents = pa.array([Decimal(12 * k - 100) / 4 for k in range(ROWS)], pa.decimal128(9, 2))
    table = pa.table({
        "when": pa.array(stamps, pa.timestamp("ns")),
        "u8": pa.array((i * 6).astype("uint8")),
        "u32": pa.array((2**32 - 1 - i).astype("uint32")),
        "u64": pa.array(np.uint64(2**63) + (i * 4096).astype("uint64")),
        "half": pa.array((i / 4).astype("float16")),
        "single": pa.array((i / 8).astype("float32")),
        "cents": cents,
        "inner": pa.array([{"x": float(k)} for k in range(ROWS)]),
        "list": pa.array([[1.0, 2.0]] * ROWS),
    })
    pq.write_table(table, HERE / "types.parquet")
    pq.write_table(table, HERE / "types_old.parquet", store_decimal_as_integer=True, use_deprecated_int96_timestamps=True, use_dictionary=False)
    day = table.set_column(0, "time", pa.array(i * 10_000, pa.time64("us")))
    pq.write_table(day, HERE / "types_day.parquet")


if __name__ == "__main__":
    mdf()
    bus()
    parquet()
    versions = {"asammdf": asammdf.__version__, "python-can": can.__version__, "cantools": cantools.__version__, "pyarrow": pa.__version__, "polars": polars.__version__}
    (HERE / "made_with.txt").write_text("".join(f"{name} {version}\n" for name, version in versions.items()))
