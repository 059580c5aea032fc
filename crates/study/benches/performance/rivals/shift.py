"""A shift with SciPy's LSODA and its events: a rival for `cargo bench -p study --bench performance`.

The inputs change every few milliseconds, as those of a controller do; in between a clutch may stick or break away. Prints the fastest time in s
with the mode and the state at the end.
"""

import time

import numpy as np
from scipy.integrate import solve_ivp

from powertrain import Powertrain, parameters

p = parameters()
car = Powertrain(p)
piece_s, tolerance = p["piece"]
pieces = np.reshape(p["pieces"], (-1, 3)).tolist()
atol = tolerance * np.array(p["scale"])


def event(clutch, mode):
    """Where a clutch leaves its mode."""

    def margin(_, x):
        return car.margin(clutch, mode, x)

    margin.terminal, margin.direction = True, -1
    return margin


def after(clutch, mode, x):
    """The mode after this clutch has left it."""

    def with_sign(sign):
        return tuple(sign if at == clutch else other for at, other in enumerate(mode))

    stuck = with_sign(0)
    held = car.held(clutch, stuck, x)
    holds = mode[clutch] != 0 and abs(held) <= car.capacity(clutch, x)
    return stuck if holds else with_sign(1 if held >= 0 else -1)


def shift():
    x, mode = np.array(p["shift_start"]), tuple(map(int, p["shift_mode"]))
    for throttle, *settled in pieces:
        engine_torques, now = car.engine_torques(throttle), 0.0
        while now < piece_s:
            solution = solve_ivp(
                lambda _, x: car.rates(mode, x, engine_torques, settled),
                (now, piece_s),
                x,
                method="LSODA",
                rtol=tolerance,
                atol=atol,
                events=[event(clutch, mode) for clutch in range(2)],
            )
            now, x = solution.t[-1], solution.y[:, -1]
            for clutch, times in enumerate(solution.t_events):
                if len(times) > 0:
                    mode = after(clutch, mode, x)
    return x, mode


best = float("inf")
for _ in range(3):
    began = time.process_time()
    end, mode = shift()
    best = min(best, time.process_time() - began)
print(repr(best), *mode, *map(repr, map(float, end)))
