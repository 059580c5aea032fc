"""The equations of the plant in Python, for SciPy's integrators.

The parameters of a car are lines on standard input, one field in each: its name and its numbers.
"""

import sys
from math import tanh

import numpy as np


def parameters():
    """The fields of standard input."""
    return {name: list(map(float, values)) for name, *values in map(str.split, sys.stdin)}


class Powertrain:
    """The car, its clutches in a mode: for the offgoing and the oncoming one the sign of its slip, or 0 where it sticks."""

    def __init__(self, p):
        self.p = p
        self.engine_map = np.reshape(p["engine_map"], (len(p["engine_speed"]), -1))
        # By which clutches stick: rows of torques of turbine, offgoing clutch, oncoming clutch and output.
        self.turbine, self.output, *self.holding = (
            dict(zip([(False, False), (True, False), (False, True), (True, True)], np.reshape(p[name], (-1, 4)).tolist()))
            for name in ("turbine_rows", "output_rows", "offgoing_rows", "oncoming_rows")
        )

    def engine_torques(self, throttle):
        """Torques of the engine over its speed at a throttle."""
        return [np.interp(throttle, self.p["throttle"], row) for row in self.engine_map]

    def slip(self, clutch, x):
        """Slip of the offgoing (0) or the oncoming clutch (1), rad/s."""
        by_turbine, by_output = self.p["slip_rows"][2 * clutch : 2 * clutch + 2]
        return by_turbine * x[1] + by_output * x[2]

    def clamp(self, clutch, pressure):
        """Lever times clamp force of a clutch, N m."""
        lever, area, spring, _ = self.p["clutches"][4 * clutch : 4 * clutch + 4]
        return lever * max(area * pressure - spring, 0.0)

    def capacity(self, clutch, x):
        """Torque that a sticking clutch can hold, N m."""
        return self.p["clutches"][4 * clutch + 3] * self.clamp(clutch, x[6 + clutch])

    def torques(self, mode, x):
        """Torque of the pump, and those on the gear train but for the clutches that stick; of the shaft."""
        p, (engine, turbine, output, twist, wheel) = self.p, x[:5]
        speed_ratio = turbine / engine
        pump = np.interp(speed_ratio, p["speed_ratio"], p["capacity"]) * engine**2
        turbine_torque = np.interp(speed_ratio, p["speed_ratio"], p["torque_ratio"]) * pump
        clutches = [0.0, 0.0]
        for clutch, sign in enumerate(mode):
            if sign != 0:
                friction = np.interp(abs(self.slip(clutch, x)), p["friction_slip"], p["friction"])
                clutches[clutch] = sign * friction * self.clamp(clutch, x[6 + clutch])
        ratio, stiffness, damping, _ = p["driveline"]
        shaft = stiffness * twist + damping * (output / ratio - wheel)
        return pump, [turbine_torque, *clutches, shaft / ratio], shaft

    def held(self, clutch, mode, x):
        """Torque by which a sticking clutch holds, N m."""
        row = self.holding[clutch][tuple(sign == 0 for sign in mode)]
        return sum(a * b for a, b in zip(row, self.torques(mode, x)[1]))

    def margin(self, clutch, mode, x):
        """How far a clutch is from another mode: its slip, rad/s, or what it could hold beyond what it does, N m."""
        if mode[clutch] != 0:
            return mode[clutch] * self.slip(clutch, x)
        return self.capacity(clutch, x) - abs(self.held(clutch, mode, x))

    def rates(self, mode, x, engine_torques, settled):
        """Time derivative of the state."""
        p, (engine, _, output, _, wheel, vehicle, *pressures) = self.p, x
        pump, torques, shaft = self.torques(mode, x)
        inertia, drag = p["engine"]
        force_max, slip_scale, floor = p["tyre"]
        mass, radius, drag_area, rolling, grade = p["road"]
        rim = radius * wheel
        force = force_max * tanh(2 * (rim - vehicle) / max(abs(rim), abs(vehicle), floor) / slip_scale)
        sticks = tuple(sign == 0 for sign in mode)
        return [
            (np.interp(engine, p["engine_speed"], engine_torques) - drag * engine - pump) / inertia,
            sum(a * b for a, b in zip(self.turbine[sticks], torques)),
            sum(a * b for a, b in zip(self.output[sticks], torques)),
            output / p["driveline"][0] - wheel,
            (shaft - rolling - radius * force) / p["driveline"][3],
            (force - drag_area * vehicle**2 - grade) / mass,
            *((to - now) / np.interp(now, p["lag_pressure"], p["lag"]) for to, now in zip(settled, pressures)),
        ]
