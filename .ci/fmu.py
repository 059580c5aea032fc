"""Checks the FMUs in a folder that `wetclutch export --fmu` wrote: FMPy has no message, and they have the bits of the self-test.

python3 .ci/fmu.py FOLDER
"""

import re
import struct
import sys
import time
from pathlib import Path

import fmpy
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu

CHANNELS = ["engine_rad_s", "turbine_rad_s", "output_rad_s", "wheel_rad_s", "engine_n_m", "acceleration_m_s2", "oil_degc"]
COMPARED = [
    "offgoing_pressure_pa",
    "offgoing_torque_n_m",
    "oncoming_pressure_pa",
    "oncoming_torque_n_m",
    "turbine_n_m",
    "shaft_n_m",
]


def vectors(folder):
    """Inputs of the self-test, each by names, and the expected estimates."""
    text = next(folder.glob("wetclutch_*_selftest.c")).read_text()
    inputs, expected = re.findall(r"\] = \{\n(.*?)\n\};", text, re.S)
    number = r"-?0x[0-9a-f.]+p[+-]\d+"
    rows = []
    for line in inputs.splitlines():
        readings = re.findall(rf"R\(({number})f, ({number})f\)|(NONE)", line)
        whole = [int(word) for word in re.search(r", (\d+)u, (-?\d+), (-?\d+), \{", line).groups()]
        row = dict(zip(["lock_up_applied", "gear_from", "gear_to"], whole))
        names = CHANNELS + [f"command_{at}" for at in range(len(readings) - len(CHANNELS))]
        for name, (value, age, none) in zip(names, readings):
            row[name + ".came"] = 0 if none else 1
            if not none:
                row[name + ".value"], row[name + ".age_s"] = float.fromhex(value), float.fromhex(age)
        rows.append(row)
    results = [[float.fromhex(value) for value in re.findall(number, line)] for line in expected.splitlines()]
    return rows, results


class Model:
    """An instance with its variables by name."""

    def __init__(self, path, folder):
        description = fmpy.read_model_description(str(path))
        self.variables = {variable.name: variable for variable in description.modelVariables}
        self.is_two = description.fmiVersion == "2.0"
        kind = FMU2Slave if self.is_two else FMU3Slave
        token = description.guid if self.is_two else description.instantiationToken
        identifier = description.coSimulation.modelIdentifier
        fmu = kind(guid=token, unzipDirectory=folder, modelIdentifier=identifier, instanceName="observer")
        self.fmu = fmu
        self.real = (fmu.getReal, fmu.setReal) if self.is_two else (fmu.getFloat64, fmu.setFloat64)
        self.set_whole = fmu.setInteger if self.is_two else fmu.setInt32
        fmu.instantiate()
        self.begin()

    def begin(self):
        if self.is_two:
            self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
        self.time_s = 0.0

    def step(self, row):
        for kinds, give in [(("Real", "Float64"), self.real[1]), (("Integer", "Int32"), self.set_whole)]:
            names = [name for name in row if self.variables[name].type in kinds]
            give([self.variables[name].valueReference for name in names], [row[name] for name in names])
        self.fmu.doStep(currentCommunicationPoint=self.time_s, communicationStepSize=0.01)
        self.time_s += 0.01
        return list(self.real[0]([self.variables[f"estimate.{name}"].valueReference for name in COMPARED]))

    def states(self):
        fmu = self.fmu
        if self.is_two:
            return fmu.getFMUstate, fmu.setFMUstate, fmu.serializeFMUstate, fmu.deSerializeFMUstate, fmu.freeFMUstate
        return fmu.getFMUState, fmu.setFMUState, fmu.serializeFMUState, fmu.deserializeFMUState, fmu.freeFMUState


def bits(values):
    return [struct.pack("<f", value) for value in values]


def two_instances(path, folder, rows, expected):
    """A second instance with steps at other times changes nothing in the first one."""
    one, other = Model(path, folder), Model(path, folder)
    for at, (row, result) in enumerate(zip(rows, expected)):
        assert bits(one.step(row)) == bits(result), f"step {at}"
        if at % 3 == 0:
            other.step(row)
    other.fmu.terminate()
    other.fmu.freeInstance()
    return one


def states(model, rows, expected):
    """States are kept, and written and read; what follows has the same bits."""
    get, put, serialise, deserialise, free = model.states()
    half = len(rows) // 2
    for row, result in zip(rows[:half], expected):
        assert bits(model.step(row)) == bits(result)
    state = get()
    stored = bytes(serialise(state))
    for way in ["kept", "stored", "kept"]:
        if way == "stored":
            read = deserialise(stored)
            put(read)
            free(read)
        else:
            put(state)
        for row, result in zip(rows[half:], expected[half:]):
            assert bits(model.step(row)) == bits(result), way
    free(state)


def check(path, rows, expected):
    problems = validate_fmu(str(path))
    assert not problems, problems
    folder = fmpy.extract(str(path))
    model = two_instances(path, folder, rows, expected)
    model.fmu.terminate()
    model.fmu.reset()
    model.begin()
    states(model, rows, expected)
    start = time.perf_counter()
    for at in range(10_000):
        model.step(rows[at % len(rows)])
    steps_s = time.perf_counter() - start
    model.fmu.terminate()
    model.fmu.freeInstance()
    result = fmpy.simulate_fmu(str(path), stop_time=1.0, step_size=0.01)
    assert len(result) == 101, len(result)
    print(f"{path.name}: no message, {len(rows)} steps with the bits of the self-test, 10,000 steps in {steps_s:.2f} s")


def main():
    folder = Path(sys.argv[1])
    rows, expected = vectors(folder)
    assert rows and len(rows) == len(expected)
    paths = sorted(folder.glob("*.fmu"))
    assert len(paths) == 2, paths
    for path in paths:
        check(path, rows, expected)


if __name__ == "__main__":
    main()
