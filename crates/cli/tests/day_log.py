"""Makes a log of a day's drive from the signals of a simulated one: DRIVE.csv OUT [SEED].

Writes OUT.mf4 (asammdf) and OUT.csv with the same samples: channels at 5, 10, 20 and 100 ms, each group with a clock of its own that is
not in step with the others, single samples lost, and dropouts of up to half a second. Values are raw numbers of a bus with a scale.
"""
import csv
import sys

import numpy as np
from asammdf import MDF, Signal
from asammdf.blocks import v4_blocks, v4_constants

# The friction elements of gearboxes/8hp.toml.
ELEMENTS = "ABCDE"
RPM = 30 / np.pi


def read(path):
    with open(path, newline="") as file:
        rows = csv.reader(file)
        names = next(rows)
        columns = list(zip(*rows))
    return dict(zip(names, columns))


def numbers(cells):
    return np.array([float(cell) if cell else np.nan for cell in cells])


def main(path, out, seed="1"):
    random = np.random.default_rng(int(seed))
    drive = read(path)
    time = numbers(drive["time_s"])
    rpm = lambda name: numbers(drive[name]) * RPM
    # Group: period and offset of its clock, s; channels: name, unit, values, least step, raw type.
    groups = [
        ("TCU_fast", 0.005, 0.0, [
            ("N_Turb", "1/min", rpm("turbine_speed_rad_s"), 0.25, np.int16),
            ("N_Out", "1/min", rpm("output_speed_rad_s"), 0.25, np.int16)]),
        ("TCU", 0.010, 0.0013, [
            *[(f"I_{element}", "mA", 1e3 * numbers(drive[f"element_{element.lower()}_current_a"]), 1.0, np.uint16)
              for element in ELEMENTS],
            ("N_Eng", "1/min", rpm("engine_speed_rad_s"), 0.25, np.uint16)]),
        ("Brakes", 0.020, 0.0071, [
            ("N_Whl", "1/min", rpm("wheel_speed_rad_s"), 0.125, np.int16),
            ("Pedal", "%", 100 * numbers(drive["throttle"]), 0.4, np.uint8)]),
        ("Slow", 0.100, 0.0523, [
            ("Gear", "", numbers(drive["gear"]), 1.0, np.uint8),
            ("TargetGear", "", numbers(drive["target_gear"]), 1.0, np.uint8)]),
    ]
    mdf, rows = MDF(version="4.10"), []
    first = 1
    for name, period, offset, channels in groups:
        stamps = np.round(np.arange(offset, time[-1], period), 6)
        kept = random.random(len(stamps)) > 0.005
        for begin in random.uniform(0, time[-1], max(1, int(time[-1] / 120))):
            kept &= (stamps < begin) | (stamps > begin + random.uniform(0.05, 0.5))
        stamps = stamps[kept]
        # The newest value before each stamp, as a control unit sends it.
        at = np.searchsorted(time, stamps, side="right") - 1
        signals, cells = [], []
        for channel, unit, values, step, kind in channels:
            raw = np.round(values[at] / step).astype(kind)
            conversion = v4_blocks.ChannelConversion(conversion_type=v4_constants.CONVERSION_TYPE_LIN, a=step, b=0)
            signals.append(Signal(raw, stamps, name=channel, unit=unit, conversion=conversion))
            cells.append(raw * step)
        mdf.append(signals, acq_name=name)
        rows.append((first, stamps, cells))
        first += len(channels)
    mdf.save(out + ".mf4", compression=2, overwrite=True)
    titles = ["time [s]"] + [f"{c[0]} [{c[1]}]" for group in groups for c in group[3]]
    with open(out + ".csv", "w") as file:
        file.write(",".join(titles) + "\n")
        lines = []
        for first, stamps, cells in rows:
            before, after = "," * first, "," * (len(titles) - first - len(cells))
            for i, stamp in enumerate(stamps):
                values = ",".join(f"{cell[i]:.10g}" for cell in cells)
                lines.append((stamp, f"{stamp:.6f}{before}{values}{after}\n"))
        lines.sort(key=lambda line: line[0])
        file.writelines(line for _, line in lines)


main(*sys.argv[1:])
