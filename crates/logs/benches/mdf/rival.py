"""Of a rival, on one thread: least time of the processor for all channels of a log, s; the sum of their values; least time of the
decompression of the deflated blocks alone, s, or 0. LOG.mf4 or LOG.parquet, and the number of tries."""
import struct
import sys
import time

import numpy


def asammdf_channels(path):
    from asammdf import MDF

    arrays = []
    with MDF(path) as mdf:
        for group, blocks in enumerate(mdf.groups):
            names = [(None, group, i) for i, channel in enumerate(blocks.channels) if channel.channel_type not in (2, 3)]
            # One call for a group, so that its blocks are unpacked once.
            for signal in mdf.select(names):
                assert len(signal.samples) == len(signal.timestamps)
                arrays.append(signal.samples)
    return arrays


def pyarrow_channels(path):
    import pyarrow
    import pyarrow.parquet

    pyarrow.set_cpu_count(1)
    table = pyarrow.parquet.read_table(path, use_threads=False)
    arrays = [column.to_numpy() for column in table.columns]
    return arrays[1:]


def fastest(job, tries):
    times = []
    for _ in range(tries):
        began = time.process_time()
        result = job()
        times.append(time.process_time() - began)
    return min(times), result


def deflated(data):
    at = data.find(b"##DZ\0\0\0\0")
    while at >= 0:
        (length,) = struct.unpack_from("<Q", data, at + 40)
        yield data[at + 48 : at + 48 + length]
        at = data.find(b"##DZ\0\0\0\0", at + 48 + length)


def main(path, tries):
    is_mdf = path.endswith("mf4")
    job = asammdf_channels if is_mdf else pyarrow_channels
    seconds, arrays = fastest(lambda: job(path), tries)
    total = sum(float(numpy.nansum(array, dtype=float)) for array in arrays)
    inflate_s = 0.0
    if is_mdf:
        # What asammdf itself unpacks with: ISA-L where it is installed.
        from asammdf.blocks import utils

        blocks = list(deflated(open(path, "rb").read()))
        inflate_s, _ = fastest(lambda: [utils.zlib_decompress(block) for block in blocks], tries)
    print(seconds, total, inflate_s)


main(sys.argv[1], int(sys.argv[2]))
