"""Figures of estimates, fits and studies; they need matplotlib."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ._estimate import Estimates
    from ._fit import Fit
    from ._study import Study

#: Time before and after a shift that is drawn, s.
_AROUND_S = (0.4, 0.6)
_COLOURS = {"offgoing": "#b5541c", "oncoming": "#1f6fb4"}
#: Ratio of the standard deviations after and before a fit below which logs identify a quantity, and its colours.
_IDENTIFIED, _PARTLY = (1.0 / 3.0, "#2e7d32"), (0.7, "#d98200")


def plot_shift(estimates: Estimates, number: int | None) -> Any:
    """Pressures and torques of both clutches of a shift, with their guaranteed ranges; of the first one if no number is given."""
    import matplotlib.pyplot as plt
    import numpy as np

    rows, shifts = estimates.rows, estimates.shifts
    numbers = [int(of) for of in shifts["number"]]
    if number is None and numbers:
        number = numbers[0]
    if number not in numbers:
        there = f"the estimates have {len(numbers)}, from {numbers[0]} to {numbers[-1]}" if numbers else "the estimates have none"
        raise IndexError(f"there is no shift {number}: {there}" if numbers else f"there is no shift: {there}")
    at = numbers.index(number)
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


def plot_drive(estimates: Estimates) -> Any:
    """Gear, torque at the gearbox input and pressures of the elements by their valve models over the whole log; its shifts are shaded."""
    import matplotlib.pyplot as plt
    import numpy as np

    rows, shifts = estimates.rows, estimates.shifts
    pressures = [name for name in rows if name.startswith("element_") and name.endswith("_valve_model_pressure_pa")]
    panels = [
        ("gear", 1.0, ["gear_number"]),
        ("turbine torque, N m", 1.0, ["turbine_torque_estimate_n_m"]),
        ("pressure, MPa", 1e-6, pressures),
    ]
    panels = [(label, scale, names) for label, scale, names in panels if names and all(name in rows for name in names)]
    if not panels:
        raise KeyError("a plot of the drive needs gears, turbine torque or pressures of a car with a gearbox")
    time_s = np.asarray(rows["time_s"])
    figure, axes = plt.subplots(len(panels), 1, sharex=True, squeeze=False, figsize=(9, 2.2 * len(panels)), layout="constrained")
    for axis, (label, scale, names) in zip(axes[:, 0], panels, strict=True):
        for name in names:
            element = name.removeprefix("element_").removesuffix("_valve_model_pressure_pa").upper()
            axis.plot(time_s, scale * np.asarray(rows[name]), linewidth=0.8, drawstyle="steps-post" if label == "gear" else None, label=element)
        for begin_s, length_s in zip(shifts["time_s"], shifts["complete_s"], strict=True):
            if np.isfinite(length_s):
                axis.axvspan(begin_s, begin_s + length_s, color="#d9d9d9", linewidth=0)
        axis.set_ylabel(label)
        axis.grid(alpha=0.3)
    if len(panels[-1][2]) > 1:
        axes[-1, 0].legend(loc="upper right", ncols=len(pressures), fontsize="small")
    axes[0, 0].set_title(f"{shifts.rows} shifts")
    axes[-1, 0].set_xlabel("time, s")
    del figure
    return axes[:, 0]


def plot_fit(fit: Fit) -> Any:
    """The intervals of a fit on those before it, in halves of these: the given car is at zero."""
    import matplotlib.pyplot as plt
    import numpy as np

    table = fit.intervals
    values, lower, upper, ratio = (
        np.asarray(table[name]) for name in ("value", "lower", "upper", "deviation_after_over_before")
    )
    # A factor is one of the given value, and its interval is one of its logarithm.
    is_factor = (np.asarray(table["unit"]) == "1") & (lower > 0.0)
    middle, low, high = (np.where(is_factor, np.log(np.where(is_factor, of, 1.0)), of) for of in (values, lower, upper))
    after = np.minimum(np.where(np.isfinite(ratio), ratio, 1.0), 1.0)
    half = np.maximum(0.5 * (high - low), np.finfo(float).tiny)
    middle = middle * after / half
    limits = (_IDENTIFIED, _PARTLY, (np.inf, "#8a8a8a"))
    colours = [next(colour for limit, colour in limits if of < limit) for of in after]
    figure, axis = plt.subplots(figsize=(8, 0.28 * table.rows + 1.0), layout="constrained")
    rows = np.arange(table.rows)
    axis.barh(rows, np.full(table.rows, 2.0), left=-1.0, color="#e6e6e6", height=0.7)
    axis.barh(rows, 2.0 * after, left=middle - after, color=colours, height=0.45)
    axis.plot(middle, rows, "k|")
    axis.set_yticks(rows, table["parameter"])
    axis.invert_yaxis()
    axis.set_xlabel("interval of 95 % after the fit, in halves of that before it (grey)")
    axis.set_title(f"fit to {fit.shifts} shifts")
    axis.grid(axis="x", alpha=0.3)
    del figure
    return axis


#: What is adapted of a clutch, with its unit for readers and the factor on its SI value.
_ADAPTED = (
    ("fill time", "fill time, ms", 1e3),
    ("kiss point", "kiss point, kPa", 1e-3),
    ("valve lag", "valve lag, ms", 1e3),
    ("valve delay", "valve delay, ms", 1e3),
    ("friction x valve gain", "friction x valve gain", 1.0),
)


def plot_adaptations(fit: Fit) -> Any:
    """Fill time, kiss point, lag, delay and friction of each clutch in all shifts, with their intervals, over the temperature of the oil."""
    import matplotlib.pyplot as plt
    import numpy as np

    table = fit.adaptations
    if table is None:
        raise ValueError("the fit has no adaptations: give oil_step to wc.fit")
    words = {name: np.asarray(table[name]) for name in ("element", "from_gear", "quantity", "verdict")}
    value, lower, upper = (np.asarray(table[name]) for name in ("value", "lower", "upper"))
    oil_degc = 0.5 * (np.asarray(table["oil_from_degc"]) + np.asarray(table["oil_to_degc"]))
    elements = sorted(set(words["element"]))
    has_oil = bool(np.isfinite(oil_degc).any())
    of_all = (words["from_gear"] == "all") & np.isfinite(value) & (np.isfinite(oil_degc) == has_oil)
    figure, axes = plt.subplots(len(_ADAPTED), 1, sharex=True, figsize=(8, 2.0 * len(_ADAPTED)), layout="constrained")
    for axis, (quantity, label, scale) in zip(axes, _ADAPTED, strict=True):
        for at, element in enumerate(elements):
            rows = of_all & (words["quantity"] == quantity) & (words["element"] == element)
            rows = np.flatnonzero(rows)[np.argsort(oil_degc[rows])]
            # Beside each other, so that no interval hides another.
            x = oil_degc[rows] + 0.4 * (at - 0.5 * (len(elements) - 1)) if has_oil else np.full(len(rows), at)
            ends = scale * np.abs(np.stack([value[rows] - lower[rows], upper[rows] - value[rows]]))
            is_identified = not np.char.startswith(words["verdict"][rows].astype(str), "not").any()
            line = "-" if has_oil else ""
            axis.errorbar(x, scale * value[rows], ends, fmt=f"o{line}", color=f"C{at}", capsize=3, alpha=1.0 if is_identified else 0.35, label=element)
        axis.set_ylabel(label)
        axis.grid(alpha=0.3)
    if has_oil:
        axes[0].legend(loc="upper right", ncols=len(elements), fontsize="small")
        axes[-1].set_xlabel("temperature of the oil, degC")
    else:
        axes[-1].set_xticks(range(len(elements)), elements)
    pale = "not identifiable at one temperature or more" if has_oil else "not identifiable"
    axes[0].set_title(f"adaptations with intervals of 95 %; pale: {pale}")
    del figure
    return axes


def plot_distribution(study: Study, column: str) -> Any:
    """The cumulative distribution of a column over the runs that have it."""
    import matplotlib.pyplot as plt
    import numpy as np

    values = np.asarray(study.rows[column])
    if values.dtype != np.float64:
        raise TypeError(f"column `{column}` has words")
    values = np.sort(values[np.isfinite(values)])
    figure, axis = plt.subplots(figsize=(7, 4), layout="constrained")
    axis.step(values, np.arange(1, len(values) + 1) / max(1, len(values)), where="post", color=_COLOURS["oncoming"])
    axis.set_xlabel(column)
    axis.set_ylabel("fraction of the runs")
    axis.set_title(f"{study.name}: {len(values)} of {study.rows.rows} runs")
    axis.grid(alpha=0.3)
    del figure
    return axis
