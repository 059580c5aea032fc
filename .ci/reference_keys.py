"""Which commands read a key of a file: the first pattern that fits the key counts.

Of vehicle files it was measured: each value of the eight-speed car with strokes and of the two-speed car with strokes was changed by 2 %, and the outputs of
`simulate`, `estimate` and `design` were compared. Keys that those files do not have are taken with their table.
"""


def by(*commands):
    return ", ".join(f"`{command}`" for command in commands)


ALL = by("simulate", "estimate", "design")
SIMULATE, ESTIMATE, DESIGN = by("simulate"), by("estimate"), by("design")
SIMULATE_ESTIMATE, SIMULATE_DESIGN, ESTIMATE_DESIGN = by("simulate", "estimate"), by("simulate", "design"), by("estimate", "design")
SENSORS = by("simulate", "estimate --sensors", "fit --sensors", "export --sensors")

READERS = {
    "car": [
        (r"name|gearbox|launch|engine\.max_torque", ALL),
        (r"error_bounds|clutch\.[^.]+\.error_bounds", ESTIMATE_DESIGN),
        (r"engine\.torque", SIMULATE_DESIGN),
        (r"engine", SIMULATE),
        (r"converter\.capacity|hydraulics|friction\.factor|valve\.(lag|delay)|driveline\.final|vehicle\.(mass|wheel)", ALL),
        (r"clutch", ALL),
        (r"tyre|vehicle", SIMULATE),
        (r"", SIMULATE_ESTIMATE),
    ],
    "vehicle": [
        (r"name|gear_train", ALL),
        (r"engine|tyre|oil|vehicle\.grade", SIMULATE),
        (r"converter\.capacity|clutch\.b\.(mean|friction_faces|piston|return|valve\.(lag|gain))|driveline\.(final|shaft_stiffness)|vehicle\.(mass|wheel)", ALL),
        (r"converter|clutch|driveline|vehicle", SIMULATE_ESTIMATE),
        (r"observer\.(valve|uncertainty)", ESTIMATE_DESIGN),
        (r"observer\.speed_max", DESIGN),
        (r"observer", ESTIMATE),
        (r"design\.error_bounds\.(fill|wheel_scale|wheel_delay|channel_skew|shaft_stiffness|backlash|slip_rad|current|valve_hysteresis|offgoing_drain)", ESTIMATE),
        (r"design\.error_bounds\.(shift_|float32|slip_quantum|output_torque)", DESIGN),
        (r"design\.error_bounds", ESTIMATE_DESIGN),
        (r"design\.(compliant\.)?(torque|inertia)_phase\.offset_max", DESIGN),
        (r"design\.compliant", ESTIMATE_DESIGN),
        (r"design", by("design", "estimate --observer rigid")),
    ],
    "gearbox": [
        (r"gear(\[\])?\.stated_ratio", by("check")),
        (r"", by("check", "simulate", "estimate", "design")),
    ],
    "drive": [(r"", SIMULATE)],
    "experiment": [
        (r"observer|draws", by("bench", "study", "reproduce")),
        (r"(scenario\[\]\.)?sensors", SENSORS),
        (r"", by("simulate", "bench", "study", "reproduce")),
    ],
    "study": [(r"", by("study", "merge", "error-bound", "worst-case"))],
    "car_study": [(r"", by("study", "merge"))],
    "channel_map": [
        (r"gearbox\.output_rad_per_m", by("inspect --shifts")),
        (r"gearbox\.ratios", by("inspect --shifts") + "; with a vehicle file of one shift " + by("estimate", "fit")),
        (r"", by("estimate", "fit", "inspect", "convert", "init --from-log")),
    ],
    "sensors": [(r"", SENSORS)],
    "learnt": [(r"", by("estimate --learnt"))],
}
