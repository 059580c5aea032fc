"""Of a rival: least time of the processor for all channels of a log on one thread, s; least time by the clock on all threads that it takes, s;
the sum of the values; least time of the processor for the decompression of the deflated blocks alone, s, or 0. LOG.mf4 or LOG.parquet, and the
number of tries."""
import os
import struct
import sys
import time

import numpy


def asammdf_channels(path, threads):
    from asammdf import MDF
    from asammdf.blocks import mdf_v4

    # By itself it takes one less than there are processors.
    mdf_v4.THREAD_COUNT = threads

    arrays = []
    with MDF(path) as mdf:
        for group, blocks in enumerate(mdf.groups):
            names = [(None, group, i) for i, channel in enumerate(blocks.channels) if channel.channel_type not in (2, 3)]
            # One call for a group, so that its blocks are unpacked once.
            for signal in mdf.select(names):
                assert len(signal.samples) == len(signal.timestamps)
                arrays.append(signal.samples)
    return arrays


def pyarrow_channels(path, threads):
    import pyarrow
    import pyarrow.parquet

    pyarrow.set_cpu_count(threads)
    table = pyarrow.parquet.read_table(path, use_threads=threads > 1)
    arrays = [column.to_numpy() for column in table.columns]
    return arrays[1:]


def fastest(job, tries, clock=time.process_time):
    times = []
    for _ in range(tries):
        began = clock()
        result = job()
        times.append(clock() - began)
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
    seconds, arrays = fastest(lambda: job(path, 1), tries)
    by_clock, _ = fastest(lambda: job(path, os.cpu_count()), tries, time.perf_counter)
    total = sum(float(numpy.nansum(array, dtype=float)) for array in arrays)
    inflate_s = 0.0
    if is_mdf:
        # What asammdf itself unpacks with: ISA-L where it is installed.
        from asammdf.blocks import utils

        blocks = list(deflated(open(path, "rb").read()))
        inflate_s, _ = fastest(lambda: [utils.zlib_decompress(block) for block in blocks], tries)
    print(seconds, by_clock, total, inflate_s)


main(sys.argv[1], int(sys.argv[2]))
