"""Checks the FMUs of the car in a folder that `wetclutch export --car-fmu` wrote: FMPy has no message, and the car has the speeds that
`wetclutch simulate .ci/car_fmu.toml` gives in the same drive.

python3 .ci/car_fmu.py FOLDER SIMULATED.csv
"""

import csv
import sys
import time
import tomllib
from pathlib import Path

import fmpy
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu

PERIOD_S = 0.01
INPUTS = ["accelerator", "brake", "grade_rad"]
COLUMNS = {"engine_rad_s": "engine_speed_rad_s", "turbine_rad_s": "turbine_speed_rad_s", "vehicle_m_s": "vehicle_speed_m_s"}
# A recorder has an instant at the beginning of a step of the integration, the model at the end of the step before: they differ by rounding.
ROUNDING = 1e-9


class Car:
    """An instance of the car, in its start."""

    def __init__(self, path):
        description = fmpy.read_model_description(str(path))
        self.references = {variable.name: variable.valueReference for variable in description.modelVariables}
        is_two = description.fmiVersion == "2.0"
        kind = FMU2Slave if is_two else FMU3Slave
        token = description.guid if is_two else description.instantiationToken
        identifier = description.coSimulation.modelIdentifier
        fmu = kind(guid=token, unzipDirectory=fmpy.extract(str(path)), modelIdentifier=identifier, instanceName="car")
        self.fmu, self.is_two = fmu, is_two
        self.get, self.set = (fmu.getReal, fmu.setReal) if is_two else (fmu.getFloat64, fmu.setFloat64)
        self.get_whole = fmu.getInteger if is_two else fmu.getInt32
        self.state = (fmu.getFMUstate, fmu.setFMUstate) if is_two else (fmu.getFMUState, fmu.setFMUState)
        fmu.instantiate()

    def begin(self, values):
        if self.is_two:
            self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.give(values)
        self.fmu.exitInitializationMode()

    def give(self, values):
        self.set([self.references[name] for name in INPUTS], values)

    def shown(self, names):
        return list(self.get([self.references[name] for name in names]))

    def gear(self):
        return self.get_whole([self.references["gear_from"]])[0]

    def drive(self, inputs):
        """Speeds and gear before each step."""
        rows = []
        for at, values in enumerate(inputs):
            rows.append((*self.shown(COLUMNS), self.gear()))
            self.give(values)
            self.fmu.doStep(currentCommunicationPoint=at * PERIOD_S, communicationStepSize=PERIOD_S)
        return rows


def drive():
    """Inputs of each control period."""
    segments = tomllib.loads(Path(__file__).with_suffix(".toml").read_text())["segment"]
    rows = [[segment["throttle"], segment.get("brake", 0.0), 0.0] for segment in segments]
    return [row for row, segment in zip(rows, segments) for _ in range(round(segment["duration_s"] / PERIOD_S))]


def refused(act):
    try:
        act()
    except Exception:
        return
    raise SystemExit("wrong use was taken")


def check(path, inputs, simulated):
    problems = validate_fmu(str(path))
    assert not problems, problems
    car = Car(path)
    refused(lambda: car.fmu.doStep(currentCommunicationPoint=0.0, communicationStepSize=PERIOD_S))
    car.begin(inputs[0])
    start = time.perf_counter()
    rows = car.drive(inputs)
    speed = PERIOD_S * len(rows) / (time.perf_counter() - start)
    assert len(rows) == len(simulated), (len(rows), len(simulated))
    for at, (row, expected) in enumerate(zip(rows, simulated)):
        for value, column in zip(row, COLUMNS.values()):
            assert abs(value - float(expected[column])) < ROUNDING, (at, column, value, expected[column])
    gears = {row[-1] for row in rows}
    assert len(gears) >= 6, gears
    # A state that is kept leads to the same values, and wrong inputs change nothing.
    get, put = car.state
    kept = get()
    after = car.drive(inputs[:300])
    put(kept)
    for wrong in ([2.0, 0.0, 0.0], [float("nan"), 0.0, 0.0], [0.0, 0.0, 2.0]):
        refused(lambda: car.give(wrong))
    assert car.drive(inputs[:300]) == after
    car.fmu.terminate()
    car.fmu.reset()
    car.begin(inputs[0])
    assert car.drive(inputs) == rows, "another run gives other values"
    car.fmu.terminate()
    car.fmu.freeInstance()
    print(f"{path.name}: no message, speeds of `simulate` in {len(rows)} periods, {len(gears)} gears, {speed:.0f} times real time")


def main():
    folder, table = Path(sys.argv[1]), Path(sys.argv[2])
    with table.open() as file:
        simulated = list(csv.DictReader(file))
    inputs = drive()
    paths = sorted(folder.glob("*_car_fmi*.fmu"))
    assert len(paths) == 2, paths
    for path in paths:
        check(path, inputs, simulated)


if __name__ == "__main__":
    main()
