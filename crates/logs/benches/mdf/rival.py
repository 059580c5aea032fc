"""Least times of the processor of asammdf for all channels of a file, and of its decompression for the deflated blocks, in s: LOG.mf4 TRIES."""
import struct
import sys
import time

from asammdf import MDF
from asammdf.blocks import utils


def channels(path):
    with MDF(path) as mdf:
        for group, blocks in enumerate(mdf.groups):
            names = [(None, group, i) for i, channel in enumerate(blocks.channels) if channel.channel_type not in (2, 3)]
            # One call for a group, so that its blocks are unpacked once.
            for signal in mdf.select(names):
                assert len(signal.samples) == len(signal.timestamps)


def fastest(job, tries):
    times = []
    for _ in range(tries):
        began = time.process_time()
        job()
        times.append(time.process_time() - began)
    return min(times)


def main(path, tries):
    # What asammdf itself unpacks with: ISA-L where it is installed.
    inflate = utils.zlib_decompress
    data = open(path, "rb").read()
    blocks = []
    for at in range(0, len(data) - 48, 8):
        if data[at : at + 4] == b"##DZ":
            (length,) = struct.unpack_from("<Q", data, at + 40)
            blocks.append(data[at + 48 : at + 48 + length])
    print(fastest(lambda: channels(path), tries), fastest(lambda: [inflate(block) for block in blocks], tries))


main(sys.argv[1], int(sys.argv[2]))
