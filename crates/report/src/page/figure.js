// A figure: its panels by uPlot, linked in time, with one view and one cursor.

const dark = matchMedia("(prefers-color-scheme: dark)");

// A colour that shows on the background of the page, with this opacity.
function ink(colour, opacity = 1) {
  const parts = [1, 3, 5].map((at) => parseInt(colour.slice(at, at + 2), 16));
  const isGrey = Math.max(...parts) - Math.min(...parts) < 24;
  const kept = !dark.matches ? 1 : !isGrey ? 0.62 : parts[0] < 64 ? 0.12 : 0.55;
  return `rgba(${parts.map((part) => Math.round(255 - (255 - part) * kept)).join(",")},${opacity})`;
}

const pageColour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const dashOf = (dash) => (dash ? dash.split(" ").map(Number) : undefined);
const LEFT = 58;
const LEAST_VIEW = 1e-4;

class Figure {
  constructor(element, text = element.querySelector("script").textContent) {
    this.element = element;
    this.data = decoded(text);
    this.whole = [this.data.from, this.data.to];
    this.view = [...this.whole];
    this.hidden = new Set();
    this.time = null;
    this.plots = [];
    this.build();
  }

  build() {
    const name = this.element.closest("details")?.querySelector("h2")?.textContent ?? document.title;
    this.root = make("div", { class: "plots", tabindex: "0", role: "group", "aria-label": `Figure of ${name}. Press ? for its keys.` });
    const button = (text, label, click) => {
      const made = make("button", { type: "button", "aria-label": label, title: label }, text);
      made.addEventListener("click", click);
      return made;
    };
    this.readTime = make("span", { class: "time" });
    this.root.append(
      make("div", { class: "tools" },
        this.readTime,
        button("+", "zoom in", () => this.zoom(0.5)),
        button("−", "zoom out", () => this.zoom(2)),
        button("whole", "show the whole", () => this.setView(...this.whole)),
        button("SVG", "save the figure as SVG", () => save(svgOf(this), "image/svg+xml", "svg")),
        button("CSV", "save the visible values as CSV", () => save(csvOf(this), "text/csv", "csv")),
        button("?", "show the keys", showHelp),
      ),
    );
    this.panels = this.data.panels.map((panel) => this.panelElement(panel));
    this.root.append(...this.panels.map((panel) => panel.element));
    this.table = make("div", { class: "unseen" });
    this.element.append(this.root, this.table);
    this.root.addEventListener("pointerdown", () => activate(this));
    this.root.addEventListener("focusin", () => activate(this));
    this.draw();
    this.size = new ResizeObserver(() => this.resize());
    this.size.observe(this.root);
  }

  // A panel: its quantity, its legend with switches and values, and the place of its plot.
  panelElement(panel) {
    const values = [];
    const ranges = panel.bands.map((ends) => ({ line: ends[0], ends })).reverse();
    const entries = [...panel.lines.map((line) => ({ line })), ...ranges].map(({ line, ends }) => {
      const isRange = ends !== undefined;
      const check = make("input", { type: "checkbox" });
      check.checked = !this.hidden.has(line.name);
      check.addEventListener("change", () => this.show(line.name, check.checked));
      const key = make("i", { class: isRange ? "key range" : "key" });
      // Room for the value, so that nothing moves when it appears.
      const read = make("output", {});
      read.style.minWidth = `${this.widestReading(panel, isRange)}ch`;
      values.push(read);
      return { line, ends: ends ?? [line], isRange, check, key, label: make("label", {}, check, key, make("span", {}, line.name), read) };
    });
    const plot = make("div", { class: "plot" });
    const note = make("p", { class: "quiet note" });
    const legend = make("div", { class: "legend" }, make("b", {}, panel.name), ...entries.map((entry) => entry.label));
    return { panel, entries, values, plot, note, element: make("div", { class: "panel" }, legend, plot, note) };
  }

  widestReading(panel, isRange) {
    if (!panel.marked) return 4;
    const width = Math.max(...[panel.low, panel.high].map((value) => shown(value, panel.high - panel.low).length));
    return (isRange ? 2 * width + 4 : width) + panel.unit.length + 1;
  }

  // Draws all panels anew, as for another width or other colours.
  draw() {
    for (const plot of this.plots) plot.destroy();
    this.plots = this.panels.map((panel, n) => this.plotOf(panel, n + 1 === this.panels.length));
    this.refresh();
  }

  plotOf({ panel, entries, plot, note }, isLast) {
    note.textContent = panel.note ?? "";
    for (const { key, line, isRange } of entries) {
      const style = line.dash ? "dashed" : "solid";
      if (isRange) key.style.background = ink(line.colour);
      else key.style.borderTop = `${Math.max(line.width, 1.5)}px ${style} ${ink(line.colour)}`;
    }
    const lines = [...panel.drawn, ...panel.bands.flat()];
    const grid = { stroke: pageColour("--grid"), width: 1 };
    const axis = { stroke: pageColour("--ink"), grid, ticks: grid, font: "12px Helvetica, Arial, sans-serif" };
    const ends = panel.lines.length;
    const series = lines.map((line, n) => ({
      label: line.name,
      scale: "y",
      stroke: n < ends ? ink(line.colour) : "transparent",
      width: n < ends ? line.width : 0,
      dash: dashOf(line.dash),
      show: !this.hidden.has(line.name),
      points: { show: false },
    }));
    const made = new uPlot({
      width: Math.max(plot.clientWidth, 200),
      height: panel.height + (isLast ? 54 : 10),
      padding: [6, 12, 0, 0],
      legend: { show: false },
      cursor: { y: false, drag: { x: true, y: false, setScale: false }, points: { size: 6 }, bind: { dblclick: () => () => this.setView(...this.whole) } },
      scales: { x: { time: false, range: () => this.view }, y: { range: () => this.heights(panel) } },
      series: [{}, ...series],
      bands: panel.bands.map(([{ colour }], n) => ({ series: [ends + 2 * n + 2, ends + 2 * n + 1], fill: ink(colour, 0.18) })),
      axes: [
        isLast
          ? { ...axis, size: 34, label: this.data.x, labelSize: 20, labelFont: axis.font }
          : { ...axis, size: 6, values: (_, ticks) => ticks.map(() => "") },
        { ...axis, size: LEFT, incrs: panel.isWhole ? [1, 2, 5, 10, 20] : undefined, space: panel.isWhole ? 20 : 30, values: panel.marked ? (_, ticks) => ticks.map(tickText) : () => [] },
      ],
      hooks: {
        drawClear: [(u) => this.shade(u)],
        setSelect: [(u) => this.selected(u)],
        setCursor: [(u) => this.moved(u)],
      },
    }, joined(lines), plot);
    gestures(this, made.over, made);
    return made;
  }

  // The ends of a value axis: those of the whole figure, or of what is visible.
  heights(panel) {
    const isWhole = this.view[0] === this.whole[0] && this.view[1] === this.whole[1];
    if (isWhole || !panel.free) return [panel.low, panel.high];
    const curves = panel.lines.filter((line) => !this.hidden.has(line.name));
    const found = extremes(curves.length ? curves : panel.bands.flat(), ...this.view);
    if (!found) return [panel.low, panel.high];
    let [low, high] = found.map((value) => Math.min(Math.max(value, panel.low), panel.high));
    const room = 0.08 * (high - low) || 0.02 * (panel.high - panel.low);
    return [low - room, high + room];
  }

  // Shades the phases of the shift.
  shade(u) {
    const { left, top, width, height } = u.bbox;
    u.ctx.save();
    u.ctx.beginPath();
    u.ctx.rect(left, top, width, height);
    u.ctx.clip();
    for (const span of this.data.spans) {
      const [from, to] = [span.from, span.to].map((time) => u.valToPos(time, "x", true));
      u.ctx.globalAlpha = dark.matches ? 0.1 : 0.55;
      u.ctx.fillStyle = span.colour;
      u.ctx.fillRect(from, top, Math.max(to - from, 1), height);
      if (u === this.plots[0] || !this.plots.length) this.nameSpan(u, span, from, to);
    }
    u.ctx.restore();
  }

  nameSpan({ ctx, bbox }, { name }, from, to) {
    ctx.font = `${11 * devicePixelRatio}px Helvetica, Arial, sans-serif`;
    if (ctx.measureText(name).width > to - from) return;
    ctx.globalAlpha = 1;
    ctx.fillStyle = pageColour("--quiet");
    ctx.textAlign = "center";
    ctx.textBaseline = "top";
    ctx.fillText(name, (Math.max(from, bbox.left) + Math.min(to, bbox.left + bbox.width)) / 2, bbox.top + 3);
  }

  // A drag of the mouse selects a part of the view.
  selected(u) {
    const { left, width } = u.select;
    if (width < 3) return;
    const [from, to] = [left, left + width].map((x) => u.posToVal(x, "x"));
    u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    this.setView(from, to);
  }

  moved(u) {
    if (this.isMoving) return;
    const { left } = u.cursor;
    this.setTime(left < 0 ? null : u.posToVal(left, "x"), u);
  }

  // Moves the cursor of all panels, and shows the values there.
  setTime(time, source) {
    this.time = time;
    this.isMoving = true;
    for (const plot of this.plots) {
      const left = time === null ? -10 : plot.valToPos(time, "x");
      if (plot !== source) plot.setCursor({ left, top: time === null ? -10 : 0 });
    }
    this.isMoving = false;
    this.frame ??= requestAnimationFrame(() => this.read());
  }

  read() {
    this.frame = null;
    const [, name, unit] = this.data.x.match(/^(.*?)(?: \((.*)\))?$/);
    const decimals = this.view[1] - this.view[0];
    this.readTime.textContent = this.time === null ? "" : `${name} ${shown(this.time, decimals / 10)} ${unit ?? ""}`;
    for (const { panel, entries, values } of this.panels) {
      entries.forEach((entry, n) => (values[n].textContent = this.time === null ? "" : this.reading(panel, entry)));
    }
  }

  // What a line reads at the cursor, with its unit.
  reading(panel, { line, ends }) {
    if (!panel.marked) return Number.isNaN(valueAt(line, this.time)) ? "" : "yes";
    const size = panel.isWhole ? 1000 : panel.high - panel.low;
    const values = ends.map((line) => shown(valueAt(line, this.time), size));
    return `${values.join(" to ")} ${panel.unit}`;
  }

  // All readings in words, for those who hear them.
  words() {
    const of = ({ panel, entries }) =>
      entries.filter(({ line }) => !this.hidden.has(line.name))
        .map((entry) => `${entry.line.name} ${this.reading(panel, entry)}`).join(", ");
    this.read();
    return `${this.readTime.textContent}. ${this.panels.map((panel) => `${panel.panel.quantity}: ${of(panel)}`).join(". ")}`;
  }

  // Shows what lies between two times, within the figure.
  setView(from, to) {
    const [first, last] = this.whole;
    const length = Math.min(Math.max(to - from, LEAST_VIEW * (last - first)), last - first);
    const begin = Math.min(Math.max(from, first), last - length);
    this.view = length >= last - first ? [...this.whole] : [begin, begin + length];
    this.refresh();
  }

  refresh() {
    for (const plot of this.plots) {
      plot.setScale("x", { min: this.view[0], max: this.view[1] });
      plot.root.dataset.view = this.view.join(" ");
    }
    if (this.time !== null) this.setTime(this.time);
    clearTimeout(this.later);
    this.later = setTimeout(() => this.table.replaceChildren(tableOf(this)), 200);
  }

  // Takes another figure with as many panels, such as that of another run, and draws it in the same view; false where it has others.
  take(text) {
    const next = decoded(text);
    if (next.panels.length !== this.panels.length) return false;
    const isWhole = this.view[0] === this.whole[0] && this.view[1] === this.whole[1];
    this.whole = [next.from, next.to];
    this.view = isWhole ? [...this.whole] : this.view;
    Object.assign(this.data, { from: next.from, to: next.to, spans: next.spans });
    next.panels.forEach((panel, n) => this.takePanel(panel, n));
    this.setView(...this.view);
    return true;
  }

  // Takes new values of a panel, or a panel with other curves in its place.
  takePanel(next, n) {
    const curvesOf = ({ name, lines, bands }) => JSON.stringify([name, lines.map((line) => line.name), bands.length]);
    const panel = this.data.panels[n];
    if (curvesOf(panel) === curvesOf(next)) {
      Object.assign(panel, { low: next.low, high: next.high, note: next.note });
      this.panels[n].note.textContent = next.note ?? "";
      panel.lines.forEach((line, at) => Object.assign(line, next.lines[at]));
      panel.bands.flat().forEach((line, at) => Object.assign(line, next.bands.flat()[at]));
      this.plots[n].setData(joined([...panel.drawn, ...panel.bands.flat()]), false);
      return;
    }
    this.data.panels[n] = next;
    const made = this.panelElement(next);
    this.panels[n].element.replaceWith(made.element);
    this.plots[n].destroy();
    this.panels[n] = made;
    this.plots[n] = this.plotOf(made, n + 1 === this.panels.length);
  }

  // Zooms by a factor about a time, else about the cursor or the middle.
  zoom(factor, about) {
    const [from, to] = this.view;
    const isVisible = this.time !== null && this.time >= from && this.time <= to;
    const centre = about ?? (isVisible ? this.time : (from + to) / 2);
    this.setView(centre - (centre - from) * factor, centre + (to - centre) * factor);
  }

  // Moves the view by a part of its length.
  pan(part) {
    const by = part * (this.view[1] - this.view[0]);
    this.setView(this.view[0] + by, this.view[1] + by);
  }

  // Moves the cursor by so many steps of a three-hundredth of the view.
  step(steps) {
    const [from, to] = this.view;
    const time = this.time ?? from;
    this.setTime(Math.min(Math.max(time + (steps * (to - from)) / 300, from), to));
    announce(this.words());
  }

  // Shows or hides all curves and ranges of this name.
  show(name, isShown) {
    if (isShown) this.hidden.delete(name);
    else this.hidden.add(name);
    this.panels.forEach(({ panel, entries }, n) => {
      [...panel.drawn, ...panel.bands.flat()].forEach((line, at) => {
        if (line.name === name) this.plots[n].setSeries(at + 1, { show: isShown });
      });
      for (const entry of entries) if (entry.line.name === name) entry.check.checked = isShown;
    });
    this.refresh();
  }

  resize() {
    this.plots.forEach((plot, n) => {
      const width = this.panels[n].plot.clientWidth;
      if (width > 0 && width !== plot.width) plot.setSize({ width, height: plot.height });
    });
  }

  close() {
    this.size.disconnect();
    clearTimeout(this.later);
    for (const plot of this.plots) plot.destroy();
    this.root.remove();
    this.table.remove();
  }
}

// Lines with times of their own over common times, as uPlot takes them.
function joined(lines) {
  const numbers = (values) => Array.from(values, (value) => (Number.isNaN(value) ? null : value));
  const groups = new Map();
  lines.forEach((line, at) => groups.set(line.time, [...(groups.get(line.time) ?? []), at]));
  const tables = [...groups.values()].map((places) => [
    Array.from(lines[places[0]].times),
    ...places.map((at) => numbers(lines[at].values)),
  ]);
  const [times, ...columns] = tables.length > 1 ? uPlot.join(tables) : (tables[0] ?? [[]]);
  const places = [...groups.values()].flat();
  return [times, ...lines.map((_, at) => columns[places.indexOf(at)])];
}

// Wheel, shift-drag and fingers over a plot.
function gestures(figure, over, plot) {
  const timeAt = (x) => plot.posToVal(x - over.getBoundingClientRect().left, "x");
  over.addEventListener("wheel", (event) => {
    // The page scrolls until the figure is chosen.
    if (figure !== active && !event.ctrlKey) return;
    event.preventDefault();
    if (Math.abs(event.deltaX) > Math.abs(event.deltaY)) figure.pan(event.deltaX / over.clientWidth);
    else figure.zoom(Math.exp(0.002 * event.deltaY * (event.deltaMode ? 20 : 1)), timeAt(event.clientX));
  }, { passive: false });
  const held = new Map();
  let begin = null;
  const start = () => {
    const places = [...held.values()];
    begin = { view: [...figure.view], times: places.map(timeAt), places };
  };
  over.addEventListener("mousedown", (event) => {
    if (event.shiftKey || event.button === 1) event.stopImmediatePropagation();
  }, true);
  over.addEventListener("pointerdown", (event) => {
    if (event.pointerType === "mouse" && !event.shiftKey && event.button !== 1) return;
    event.preventDefault();
    over.setPointerCapture(event.pointerId);
    held.set(event.pointerId, event.clientX);
    start();
  });
  over.addEventListener("pointermove", (event) => {
    if (!held.has(event.pointerId)) return;
    held.set(event.pointerId, event.clientX);
    const length = begin.view[1] - begin.view[0];
    const part = (x) => (x - over.getBoundingClientRect().left) / over.clientWidth;
    const [one, two] = [...held.values()];
    if (two === undefined) {
      const from = begin.times[0] - part(one) * length;
      return figure.setView(from, from + length);
    }
    // The times under both fingers stay under them.
    const spread = part(two) - part(one);
    if (Math.abs(spread) < 0.02) return;
    const wide = (begin.times[1] - begin.times[0]) / spread;
    if (wide > 0) figure.setView(begin.times[0] - part(one) * wide, begin.times[0] + (1 - part(one)) * wide);
  });
  for (const end of ["pointerup", "pointercancel"]) {
    over.addEventListener(end, (event) => {
      held.delete(event.pointerId);
      if (held.size) start();
    });
  }
}
