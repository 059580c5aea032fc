// Reading the data of a figure, and numbers for people.

// The bytes behind a text in base64.
const bytesOf = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));

// Times of curves: even, or 32-bit steps between the first and the last.
function timesOf({ from, to, count, steps }) {
  if (steps !== undefined) {
    const codes = new Uint32Array(bytesOf(steps).buffer);
    return Float64Array.from(codes, (code) => from + ((to - from) * code) / 0xffffffff);
  }
  return Float64Array.from({ length: count }, (_, i) => from + ((to - from) * i) / Math.max(count - 1, 1));
}

// Values of a curve: 16-bit steps; the highest code is a gap.
function valuesOf({ low, step, data }) {
  const codes = new Uint16Array(bytesOf(data).buffer);
  return Float64Array.from(codes, (code) => (code === 0xffff ? NaN : low + step * code));
}

// The figure with its numbers decoded: `lines` of a panel in the order of the legend, `drawn` from the lowest to the uppermost, `bands` with
// the lower and the upper end of each range.
function decoded(text) {
  const figure = JSON.parse(text);
  const times = figure.times.map(timesOf);
  const line = (values, rest) => ({ ...rest, time: values.time, times: times[values.time], values: valuesOf(values) });
  for (const panel of figure.panels) {
    const [, quantity, unit] = panel.name.match(/^(.*?)(?: \(([^()]*)\))?$/) ?? [null, panel.name, ""];
    Object.assign(panel, { quantity, unit: /^0\s*to\s*1$/.test(unit ?? "") ? "" : (unit ?? "") });
    panel.lines = panel.curves.map((curve) => line(curve, curve));
    const isWhole = ({ values }) => values.every((value) => Number.isNaN(value) || Math.abs(value - Math.round(value)) < 1e-3);
    panel.isWhole = panel.marked && panel.lines.every(isWhole) && panel.high - panel.low < 100;
    panel.drawn = [...panel.lines].reverse().sort((a, b) => a.layer - b.layer);
    panel.bands = panel.ranges.map(({ name, colour, lower, upper }) => [lower, upper].map((end) => line(end, { name, colour })));
  }
  return figure;
}

// The place of the last time that is not later than this, at least 0.
function placeOf(times, time) {
  let [low, high] = [0, times.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time) low = middle + 1;
    else high = middle;
  }
  return Math.max(low - 1, 0);
}

// The value of a line at a time: that of the nearest sample; none before its first and after its last.
function valueAt({ times, values }, time) {
  const at = placeOf(times, time);
  const near = at + 1 < times.length && times[at + 1] - time < time - times[at] ? at + 1 : at;
  const step = times.length > 1 ? (times[times.length - 1] - times[0]) / (times.length - 1) : 0;
  return Math.abs(times[near] - time) <= 2 * step + 1e-9 ? values[near] : NaN;
}

// A value with as many decimals as a range of this size needs.
function shown(value, size) {
  if (!Number.isFinite(value)) return "–";
  if (Math.abs(value) >= 1e6) return value.toExponential(2);
  const decimals = Math.min(Math.max(3 - Math.ceil(Math.log10(size || 1)), 0), 6);
  return value.toFixed(decimals).replace(/^-(0(\.0*)?)$/, "$1");
}

// A value at an axis.
function tickText(tick) {
  const value = +tick.toPrecision(6);
  return Math.abs(value) >= 1e5 ? value.toExponential().replace("e+", "e") : String(value);
}

// The ends of the visible values of lines between two times, or null.
function extremes(lines, from, to) {
  let [low, high] = [Infinity, -Infinity];
  for (const { times, values } of lines) {
    for (let i = placeOf(times, from); i < times.length && times[i] <= to; i++) {
      if (values[i] < low) low = values[i];
      if (values[i] > high) high = values[i];
    }
  }
  return low <= high ? [low, high] : null;
}

// The next larger number of the form 1, 2 or 5 times a power of ten.
function niceStep(least) {
  const power = 10 ** Math.floor(Math.log10(least));
  return [1, 2, 5, 10].map((m) => m * power).find((step) => step >= least * 0.999) ?? least;
}

// An element with attributes, and what is in it.
function make(name, attributes = {}, ...inside) {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.append(...inside);
  return element;
}
