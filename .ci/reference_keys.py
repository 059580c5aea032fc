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

# What an optional key counts as where it is left out: the first pattern that fits the key counts. Values of a complete car are taken from
# `wetclutch check`, and required keys from the schemas.
SENSOR_DEFAULTS = [
    (r"(.*\.)?scale", "1"),
    (r"(.*\.)?current\.(sample_time_s|delay_s)|(.*\.)?current$", "those of the rows"),
    (r"(.*\.)?(engine|turbine|output|wheel|current)\.(burst_s|frozen_s|missing_share|outlier_rad_s|outlier_a|outliers|offset_s)", "0"),
    (r"(.*\.)?(row_offset_s|missing_share|outliers)", "0"),
]
OFF_NOMINAL = [
    (r"(.*\.)?off_nominal\.\w+_factor", "1"),
    (r"(.*\.)?off_nominal\.(backlash_rad|clutch_drag_n_m)", "0"),
    (r"(.*\.)?off_nominal\.oil_temperature_degc", "80"),
    (r"(.*\.)?off_nominal\.tip_out_s", "none"),
    (r"(.*\.)?off_nominal\.", "that of the vehicle file"),
    (r"(.*\.)?off_nominal$", "none"),
]
OF_VEHICLE = [
    (r"(.*\.)?fill\.enabled", "true with a table `fill`"),
    (r"(.*\.)?fill\.preload_n", "0.75 of the return spring"),
    (r"clutch\.[^.]+\.(return_spring_n|static_friction|friction)", "of the gearbox file and `friction`"),
    (r"clutch\.[^.]+\.(drag_n_m|fill|valve)", "that of all elements"),
    (r"clutch\.[^.]+\.steel_mass_kg", "none: no temperature of the plates"),
    (r"(.*\.)?valve\.hysteresis_pa", "0"),
    (r"(.*\.)?valve\.kind", "`proportional`"),
    (r"(.*\.)?valve\.zero_pressure_a", "for `normally-high` alone"),
    (r"(.*\.)?valve\.(flow_sqrt_pa_s|line_pressure_pa)|(.*\.)?valve\.delay\.duty_percent", "for `pulse-width` alone"),
    (r"(.*\.)?valve\.(gain|lag|delay)", "for a valve with a current"),
    (r"driveline\.backlash_rad", "0"),
    (r"engine\.max_torque_n_m", "190: no scaling"),
    (r"launch", "`converter`"),
    (r"lock_up\.slip_rad_s", "0"),
]
DEFAULTS = {
    "car": [
        (r"(clutch\.[^.]+\.)?error_bounds\.friction_factor", "[0.85, 1.15]"),
        (r"(clutch\.[^.]+\.)?error_bounds\.valve_gain_factor", "[0.9, 1.1]"),
        (r"(clutch\.[^.]+\.)?error_bounds\.valve_lag_factor", "[0.5, 1.5]"),
        (r"(clutch\.[^.]+\.)?error_bounds\.valve_delay_s", "[0, 0.03], or 0.015 around a longer one"),
        (r"(clutch\.[^.]+\.)?error_bounds\.valve_hysteresis_pa", "1e4, or that of the valve"),
        (r"(clutch\.[^.]+\.)?error_bounds\.(current_a|duty_percent)", "1 % of the largest command"),
        (r"error_bounds\.converter_share", "0.10"),
        (r"error_bounds\.(inertia_share|shaft_stiffness_share)", "0.20"),
        (r"error_bounds\.engine_torque_share", "0.08"),
        (r"error_bounds\.wheel_scale_share", "0.02"),
        (r"error_bounds\.mass_share", "0.25"),
        (r"error_bounds\.valve_error_scale", "1"),
        (r"name|gearbox", "required"),
        (r"lock_up\.(on|off)_input_rad_s", "required with `lock_up`"),
        (r"fill", "with a table `fill`: as in the value column"),
        *OF_VEHICLE,
    ],
    "vehicle": [
        (r"design\.torque_phase\.kappa1_per_s", "searched for by the design"),
        (r"gear_train\.ratios", "of the teeth"),
        (r"gear_train", "with `ratios`: a gear train that has them"),
        (r"(.*\.)?error_matrix", "none"),
        (r"design\.error_bounds\.fill", "with a table `fill`: of its values"),
        (r"design\.error_bounds\.(duty_percent|line_pressure_pa)", "for `pulse-width` alone"),
        (r"observer\.(valve|uncertainty)\.(pressure_drop_pa|flow_sqrt_pa_s|line_pressure_pa|kind|time_constant_s)", "for `pulse-width` alone"),
        (r"oil\.temperature_degc", "80"),
        (r"name", "required"),
        (r"clutch\.[^.]+\.fill\.exhaust_factor", "1.0"),
        (r"clutch\.[^.]+\.fill\.stroke_m", "1.2e-3"),
        (r"clutch\.[^.]+\.valve\.(lag|gain|delay)$", "`[...]`"),
        *OF_VEHICLE,
    ],
    "gearbox": [
        (r"gear\[\]\.stated_ratio", "not compared"),
        (r"gear\[\]\.turbine_max_n_m", "not checked"),
        (r"gear_pair\[\]\.dog", "always in mesh"),
        (r"gear_pair\[\]\.idler", "false"),
        (r"gear_pair|planetary_set", "none"),
        (r"element\[\]\.pack", "none: no pressure"),
        (r"planetary_set\[\]\.planets", "`single`"),
        (r"planetary_set\[\]\.planet_(count|teeth)", "not checked"),
        (r"line_pressure_pa", "no check of capacities"),
        (r"", "required at its `level`"),
    ],
    "drive": [
        (r"vehicle", "given by `--vehicle`"),
        (r"sample_time_s", "0.01"),
        (r"repetitions", "1"),
        (r"controller", "`bench`"),
        (r"schedule\.time_in_gear_s", "1.0"),
        (r"schedule", "no shift by a schedule"),
        (r"segment\[\]\.(brake|grade_rad)|trace\.grade_rad|start\.vehicle_m_s|fault\[\]\.from_s", "0"),
        (r"start\.gear", "the first gear"),
        (r"fault\[\]\.command", "as it is when the fault begins"),
        (r"fault\[\]\.", "required of its kind"),
        (r"segment|trace", "one of `segment` and `trace`"),
        (r"shift", "none"),
        (r"sensors$", "none"),
        *SENSOR_DEFAULTS,
    ],
    "experiment": [
        *OFF_NOMINAL,
        (r"draws", "5"),
        (r"observer\[\]\.gains", "those of the design"),
        (r"observer\[\]\.name", "that of its kind"),
        (r"observer\[\]\.", "that of its kind"),
        (r"scenario\[\]\.sensor_noise_factor|shift\.torque_factor", "1"),
        (r"scenario\[\]\.", "as without the scenario"),
        (r"shift\.fill", "no fill"),
        (r"shift\.lead_s|shift\.inertia_phase\.throttle_\w+", "none"),
        *SENSOR_DEFAULTS,
    ],
    "study": [
        (r"runs", "all levels of a `factorial` plan"),
        (r"seed", "0"),
        (r"record_before_s", "1.2"),
        (r"observers", "all of the experiment"),
        (r"factor\[\]\.name", "its key"),
        (r"factor\[\]\.change", "`set`"),
        (r"factor\[\]\.chance", "1"),
        (r"factor\[\]\.otherwise", "that of the experiment"),
        (r"factor\[\]\.levels", "of `values`: all"),
        (r"factor\[\]\.(values|range|log_range|normal)", "one of these four"),
    ],
    "car_study": [
        (r"vehicle|runs", "required"),
        (r"drive|shifts", "one of `drive` and `shifts`"),
        (r"seed", "0"),
        (r"errors\.", "that of the error budget"),
        *SENSOR_DEFAULTS,
    ],
    "channel_map": [
        (r"channel\.NAME\.(scale)", "1"),
        (r"channel\.NAME\.(offset|delay_s|late_s)", "0"),
        (r"channel\.NAME\.unit", "that of the log"),
        (r"channel\.NAME\.combine", "`mean`"),
        (r"channel\.NAME\.sent_on_change", "false"),
        (r"channel\.NAME\.(name|names)", "one of both"),
        (r"channel\.NAME\.(group|valid_range)", "any"),
        (r"time\.", "found by name and unit"),
        (r"dbc", "none"),
        (r"gearbox", "not known"),
    ],
    "sensors": SENSOR_DEFAULTS,
    "learnt": [(r"", "required")],
}
