"""Figures of estimates; they need matplotlib."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ._estimate import Estimates

#: Time before and after a shift that is drawn, s.
_AROUND_S = (0.4, 0.6)
_COLOURS = {"offgoing": "#b5541c", "oncoming": "#1f6fb4"}


def plot_shift(estimates: Estimates, number: int) -> Any:
    """Pressures and torques of both clutches of a shift, with their guaranteed ranges."""
    import matplotlib.pyplot as plt
    import numpy as np

    if not 1 <= number <= estimates.shifts.rows:
        raise IndexError(f"there is no shift {number}: the log has {estimates.shifts.rows}")
    rows, shifts, at = estimates.rows, estimates.shifts, number - 1
    begin_s = float(shifts["time_s"][at])
    length_s = float(shifts["length_s"][at]) if "length_s" in shifts else 1.0
    time_s = np.asarray(rows["time_s"])
    part = (time_s >= begin_s - _AROUND_S[0]) & (time_s <= begin_s + length_s + _AROUND_S[1])
    figure, axes = plt.subplots(2, 1, sharex=True, figsize=(8, 6), layout="constrained")
    quantities = (("pressure", "pa", 1e-6, "pressure, MPa"), ("torque", "n_m", 1.0, "torque, N m"))
    for axis, (quantity, unit, scale, label) in zip(axes, quantities, strict=True):
        for clutch, colour in _COLOURS.items():
            name = f"{clutch}_{quantity}_estimate_{unit}"
            if name not in rows:
                continue
            values = [
                scale * np.asarray(rows[f"{clutch}_{quantity}_{end}_{unit}"])[part] for end in ("least", "greatest")
                if f"{clutch}_{quantity}_{end}_{unit}" in rows
            ]
            if len(values) == 2:
                axis.fill_between(time_s[part], *values, color=colour, alpha=0.15, linewidth=0)
            axis.plot(time_s[part], scale * np.asarray(rows[name])[part], color=colour, label=clutch)
        axis.set_ylabel(label)
        axis.grid(alpha=0.3)
    gears = "-".join(str(shifts[name][at]) for name in ("from_gear", "to_gear") if name in shifts)
    axes[0].set_title(f"shift {number}: {gears}" if gears else f"shift {number}")
    axes[0].legend(loc="upper left")
    axes[1].set_xlabel("time, s")
    del figure
    return axes
