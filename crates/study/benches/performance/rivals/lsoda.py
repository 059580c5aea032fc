"""Two seconds in first gear with SciPy's LSODA: a rival for `cargo bench -p study --bench performance`.

Reads the car's parameters, one field in a line: its name and its numbers. Prints the derivative at the start, then the
fastest time in s with the end state.
"""

import sys
import time
from math import tanh

import numpy as np
from scipy.integrate import solve_ivp

p = {name: list(map(float, values)) for name, *values in map(str.split, sys.stdin)}
engine_map = np.reshape(p["engine_map"], (len(p["engine_speed"]), -1))
engine_torques = [np.interp(p["constant"][0], p["throttle"], row) for row in engine_map]
inertia, drag = p["engine"]
lever, area, spring = p["clutch"]
ratio, stiffness, damping, wheel_inertia = p["driveline"]
force_max, slip_scale, floor = p["tyre"]
mass, radius, drag_area, rolling, grade = p["road"]


def rates(_, x):
    engine, turbine, output, twist, wheel, vehicle, offgoing, oncoming = x
    speed_ratio = turbine / engine
    pump = np.interp(speed_ratio, p["speed_ratio"], p["capacity"]) * engine**2
    turbine_torque = np.interp(speed_ratio, p["speed_ratio"], p["torque_ratio"]) * pump
    engine_torque = np.interp(engine, p["engine_speed"], engine_torques)
    slip = p["slip_row"][0] * turbine + p["slip_row"][1] * output
    friction = np.interp(abs(slip), p["friction_slip"], p["friction"])
    clutch = friction * lever * max(area * oncoming - spring, 0.0) * np.sign(slip)
    twist_rate = output / ratio - wheel
    shaft = stiffness * twist + damping * twist_rate
    rim = radius * wheel
    force = force_max * tanh(2 * (rim - vehicle) / max(abs(rim), abs(vehicle), floor) / slip_scale)
    torques = (turbine_torque, clutch, shaft / ratio)
    return [
        (engine_torque - drag * engine - pump) / inertia,
        sum(a * b for a, b in zip(p["turbine_row"], torques)),
        sum(a * b for a, b in zip(p["output_row"], torques)),
        twist_rate,
        (shaft - rolling - radius * force) / wheel_inertia,
        (force - drag_area * vehicle**2 - grade) / mass,
        (p["settled"][0] - offgoing) / np.interp(offgoing, p["lag_pressure"], p["lag"]),
        (p["settled"][1] - oncoming) / np.interp(oncoming, p["lag_pressure"], p["lag"]),
    ]


span, tolerance = p["span"]
best = float("inf")
for _ in range(5):
    began = time.perf_counter()
    atol = tolerance * np.array(p["scale"])
    solution = solve_ivp(rates, (0.0, span), p["start"], method="LSODA", rtol=tolerance, atol=atol)
    best = min(best, time.perf_counter() - began)
print(*map(repr, map(float, rates(0.0, p["start"]))))
print(repr(best), *map(repr, map(float, solution.y[:, -1])))
