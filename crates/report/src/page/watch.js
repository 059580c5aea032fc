// The page of an estimate that goes on.
(() => {
"use strict";
const settings = JSON.parse(document.body.dataset.settings);
const COLOURS = {
  engine: "#808080", turbine: "#2486c7", output: "#009E73", wheel: "#C2679A",
  offgoing: "#D55E00", oncoming: "#2486c7", "drive shafts": "#009E73",
};
const OTHER = "#808080";
// Numbers of a curve in a sample: value, lower and upper end of its range.
const WIDTH = 3;
const at = (id) => document.getElementById(id);
const colour = (name) => COLOURS[name] ?? OTHER;
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const plain = (word) => word.replaceAll("_", " ");

let samples = [];
let latest = null;
let isHeld = false;
let isDue = false;
let newsAt = 0;

const plots = settings.panels.map((panel) => {
  const figure = document.createElement("div");
  figure.className = "panel";
  const legend = document.createElement("div");
  legend.className = "legend";
  const outputs = panel.curves.map((curve) => {
    const entry = document.createElement("span");
    const key = document.createElement("i");
    key.className = "key";
    key.style.borderTop = `3px solid ${colour(curve.name)}`;
    const value = document.createElement("output");
    entry.append(key, ` ${curve.name} `, value);
    legend.append(entry);
    return value;
  });
  const title = document.createElement("strong");
  title.textContent = panel.label;
  legend.prepend(title);
  const plot = document.createElement("div");
  plot.setAttribute("role", "img");
  plot.setAttribute("aria-label", `${panel.label} over the last ${settings.window} seconds`);
  figure.append(legend, plot);
  at("panels").append(figure);
  return { panel, outputs, plot, drawn: null };
});

function draw(of) {
  const { panel, plot } = of;
  of.drawn?.destroy();
  const series = [{}];
  const bands = [];
  for (const curve of panel.curves) {
    const stroke = colour(curve.name);
    const first = series.length;
    series.push({ label: curve.name, stroke, width: 1.8, points: { show: false } });
    for (const end of ["low", "high"]) series.push({ label: `${curve.name} ${end}`, stroke: "transparent", points: { show: false } });
    bands.push({ series: [first + 2, first + 1], fill: `${stroke}33` });
  }
  const axis = { stroke: css("--ink"), grid: { stroke: css("--grid"), width: 1 }, ticks: { stroke: css("--grid"), width: 1 } };
  of.drawn = new uPlot(
    {
      width: plot.clientWidth, height: 170, series, bands,
      axes: [{ ...axis, label: panel === settings.panels.at(-1) ? "time (s)" : undefined, labelSize: 18 }, { ...axis, size: 58 }],
      scales: { x: { time: false } },
      cursor: { sync: { key: "watch" }, drag: { x: false, y: false } },
      legend: { show: false },
    },
    columns(panel),
    plot,
  );
}

function columns(panel) {
  const data = [samples.map((sample) => sample[0])];
  for (const curve of panel.curves) {
    for (let part = 0; part < WIDTH; part += 1) data.push(samples.map((sample) => sample[1 + WIDTH * curve.at + part]));
  }
  return data;
}

const number = (value, decimals) => (value === null || value === undefined ? "-" : value.toFixed(decimals));

function row(cells) {
  const line = document.createElement("tr");
  for (const text of cells) {
    const cell = document.createElement("td");
    cell.textContent = text;
    line.append(cell);
  }
  return line;
}

function show() {
  isDue = false;
  const last = samples.at(-1);
  if (!last || !latest) return;
  for (const of of plots) {
    if (of.drawn) of.drawn.setData(columns(of.panel));
    else draw(of);
    of.panel.curves.forEach((curve, k) => {
      const value = last[1 + WIDTH * curve.at];
      of.outputs[k].textContent = number(value, of.panel.decimals);
    });
  }
  at("time").textContent = `${last[0].toFixed(2)} s`;
  const { gear, target_gear: target, phase, offgoing, oncoming, health } = latest.words;
  const gears = gear === undefined ? "" : gear === target ? `gear ${gear || "N"}` : `gear ${gear || "N"} to ${target || "N"}`;
  const clutches = offgoing || oncoming ? `${offgoing || "-"} off, ${oncoming || "-"} on` : "";
  at("gear").textContent = [gears, phase ? plain(phase) : "", clutches].filter((part) => part !== "").join(", ");
  at("health").textContent = plain(health ?? "-");
  at("health").className = health && health !== "good" ? "bad" : "";
  const pressure = settings.panels[1];
  at("elements-unit").textContent = pressure.label.replace(/[()]/g, "");
  at("elements").replaceChildren(...latest.elements.map(([name, value, low, high]) =>
    row([name, number(value, pressure.decimals), `${number(low, pressure.decimals)} to ${number(high, pressure.decimals)}`])));
  document.querySelector("#shifts tbody").replaceChildren(...latest.shifts.map(([nth, gears, begin, time, words]) => {
    const line = row([nth, gears, number(begin, 2), time === null ? "goes on" : number(time, 2), words.length ? words.map(plain).join(", ") : "good"]);
    line.lastChild.className = words.length ? "left bad" : "left";
    return line;
  }));
}

function due() {
  if (isDue || isHeld) return;
  isDue = true;
  requestAnimationFrame(show);
}

at("hold").addEventListener("click", () => {
  isHeld = !isHeld;
  at("hold").setAttribute("aria-pressed", String(isHeld));
  at("hold").textContent = isHeld ? "Go on" : "Hold";
  due();
});
const redraw = () => plots.forEach((of) => of.drawn && draw(of));
new ResizeObserver(redraw).observe(at("panels"));
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);

const rows = new EventSource("/rows");
// Longer than a recorder writes at a time, ms.
const STALLED = 3000;
setInterval(() => {
  if (latest && rows.readyState === EventSource.OPEN && Date.now() - newsAt > STALLED) at("state").textContent = "no new rows";
}, 500);
rows.addEventListener("message", (event) => {
  latest = JSON.parse(event.data);
  newsAt = Date.now();
  for (const sample of latest.samples) {
    if (samples.length && sample[0] < samples.at(-1)[0]) samples = [];
    samples.push(sample);
  }
  if (!isHeld && samples.length) {
    const from = samples.at(-1)[0] - settings.window;
    const first = samples.findIndex((sample) => sample[0] >= from);
    if (first > 0) samples.splice(0, first);
  }
  at("state").textContent = latest.rate ? `${latest.rate.toFixed(0)} rows/s` : "";
  due();
});
rows.addEventListener("end", () => {
  rows.close();
  at("state").textContent = "the log has ended";
});
rows.addEventListener("error", () => {
  if (rows.readyState !== EventSource.CLOSED) at("state").textContent = "the command does not answer: it may have ended";
});
})();
