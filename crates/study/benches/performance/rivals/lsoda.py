"""Two seconds in first gear with SciPy's LSODA: a rival for `cargo bench -p study --bench performance`.

Prints the derivative at the start, then the fastest time in s with the end state.
"""

import time

import numpy as np
from scipy.integrate import solve_ivp

from powertrain import Powertrain, parameters

#: The offgoing clutch sticks.
MODE = (0, 1)

p = parameters()
car = Powertrain(p)
engine_torques = car.engine_torques(p["constant"][0])


def rates(_, x):
    return car.rates(MODE, x, engine_torques, p["settled"])


span, tolerance = p["span"]
best = float("inf")
for _ in range(5):
    began = time.perf_counter()
    atol = tolerance * np.array(p["scale"])
    solution = solve_ivp(rates, (0.0, span), p["start"], method="LSODA", rtol=tolerance, atol=atol)
    best = min(best, time.perf_counter() - began)
print(*map(repr, map(float, rates(0.0, p["start"]))))
print(repr(best), *map(repr, map(float, solution.y[:, -1])))
