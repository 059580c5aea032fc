// A figure as SVG, its visible values as CSV and as a table.

const escaped = (text) => String(text).replace(/[&<>"']/g, (c) => `&#${c.charCodeAt(0)};`);
const shownLines = (figure, panel) =>
  [...panel.lines, ...panel.bands.flat()].filter((line) => !figure.hidden.has(line.name));

// The name of a line among those of a figure, with its unit.
const columnName = (panel, line) => {
  const end = panel.bands.find((ends) => ends.includes(line))?.indexOf(line) ?? -1;
  return `${panel.quantity}: ${line.name}${["", " lower", " upper"][end + 1]}${panel.unit ? ` (${panel.unit})` : ""}`;
};

// The visible part as a drawing, on white.
function svgOf(figure) {
  const [WIDTH, RIGHT, FONT] = [900, 12, 'font-family="Helvetica, Arial, sans-serif"'];
  const [from, to] = figure.view;
  const x = (time) => LEFT + ((time - from) / (to - from)) * (WIDTH - LEFT - RIGHT);
  const text = (at, y, anchor, words, more = "") =>
    `<text x="${at.toFixed(1)}" y="${y.toFixed(1)}" text-anchor="${anchor}" ${more}>${escaped(words)}</text>`;
  const parts = [];
  let y = 4;
  const measure = document.createElement("canvas").getContext("2d");
  measure.font = "12px Helvetica, Arial, sans-serif";
  const ticksOf = (low, high, count) => {
    const step = niceStep((high - low) / count);
    const first = Math.ceil(low / step - 1e-9);
    return Array.from({ length: Math.floor(high / step + 1e-9) - first + 1 }, (_, i) => +((first + i) * step).toPrecision(10));
  };
  figure.panels.forEach(({ panel }, n) => {
    const [low, high] = figure.heights(panel);
    const lines = panel.lines.filter((line) => !figure.hidden.has(line.name));
    const bands = panel.bands.filter(([{ name }]) => !figure.hidden.has(name));
    const isEnd = new Set(bands.map(([lower]) => lower));
    // Names above the panel, in as many rows as they need.
    let at = LEFT;
    y += 14;
    parts.push(text(at, y, "start", panel.name, 'font-weight="bold"'));
    at += measure.measureText(panel.name).width * 1.1 + 14;
    for (const line of [...lines, ...isEnd]) {
      const wide = 28 + measure.measureText(line.name).width;
      if (at + wide > WIDTH - RIGHT && at > LEFT) [at, y] = [LEFT, y + 16];
      parts.push(isEnd.has(line)
        ? `<rect x="${at}" y="${y - 9}" width="22" height="10" fill="${line.colour}" opacity=".16"/>`
        : `<path d="M${at} ${y - 4}h22" ${stroke(line)}/>`);
      parts.push(text(at + 26, y, "start", line.name));
      at += wide + 12;
    }
    const [top, height] = [y + 6, panel.height];
    const up = (value) => top + (1 - (Math.min(Math.max(value, 2 * low - high), 2 * high - low) - low) / (high - low)) * height;
    parts.push(`<clipPath id="p${n}"><rect x="${LEFT}" y="${top}" width="${WIDTH - LEFT - RIGHT}" height="${height}"/></clipPath>`);
    parts.push(`<g clip-path="url(#p${n})">`);
    for (const span of figure.data.spans) {
      parts.push(`<rect x="${x(span.from).toFixed(1)}" y="${top}" width="${Math.max(x(span.to) - x(span.from), 0.5).toFixed(1)}" height="${height}" fill="${span.colour}" opacity=".5"/>`);
    }
    for (const ends of bands) parts.push(`<path d="${bandPath(ends, from, to, x, up)}" fill="${ends[0].colour}" opacity=".16"/>`);
    for (const line of panel.drawn.filter((line) => lines.includes(line))) parts.push(`<path d="${linePath(line, from, to, x, up)}" ${stroke(line)}/>`);
    parts.push("</g>");
    parts.push(`<rect x="${LEFT}" y="${top}" width="${WIDTH - LEFT - RIGHT}" height="${height}" fill="none" stroke="#888" stroke-width=".6"/>`);
    if (panel.marked) {
      for (const tick of ticksOf(low, high, height / 34)) parts.push(text(LEFT - 5, up(tick) + 4, "end", tickText(tick)));
    }
    y = top + height + 8;
  });
  for (const tick of ticksOf(from, to, 8)) parts.push(text(x(tick), y + 8, "middle", tickText(tick)));
  parts.push(text((LEFT + WIDTH - RIGHT) / 2, y + 26, "middle", figure.data.x));
  return `<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 ${WIDTH} ${y + 34}" font-size="12" fill="#222" ${FONT}>` +
    `<rect width="100%" height="100%" fill="#fff"/>${parts.join("")}</svg>`;
}

const stroke = ({ colour, width, dash }) =>
  `fill="none" stroke="${colour}" stroke-width="${width}"${dash ? ` stroke-dasharray="${dash}"` : ""} stroke-linejoin="round"`;

// The visible points of a line, with one beyond each end of the view.
function* visible({ times, values }, from, to) {
  const first = placeOf(times, from);
  for (let i = first; i < times.length && (i === 0 || times[i - 1] <= to); i++) yield [times[i], values[i]];
}

function linePath(line, from, to, x, y) {
  let [path, pen] = ["", "M"];
  for (const [time, value] of visible(line, from, to)) {
    if (Number.isNaN(value)) pen = "M";
    else [path, pen] = [`${path}${pen}${x(time).toFixed(1)} ${y(value).toFixed(1)}`, "L"];
  }
  return path;
}

// The area between both ends of a range, piece by piece.
function bandPath([lower, upper], from, to, x, y) {
  const pieces = [[]];
  for (const [time, high] of visible(upper, from, to)) {
    const low = valueAt(lower, time);
    if (Number.isNaN(high) || Number.isNaN(low)) pieces.push([]);
    else pieces.at(-1).push([x(time).toFixed(1), y(low).toFixed(1), y(high).toFixed(1)]);
  }
  return pieces.filter((piece) => piece.length > 1).map((piece) =>
    `M${piece.map(([at, , high]) => `${at} ${high}`).join("L")}L${piece.reverse().map(([at, low]) => `${at} ${low}`).join("L")}Z`).join("");
}

// The visible values of the shown curves as text: a row for each time of any of them.
function csvOf(figure) {
  const [from, to] = figure.view;
  const columns = figure.panels.flatMap(({ panel }) => shownLines(figure, panel).map((line) => [columnName(panel, line), line]));
  const times = new Set(columns.flatMap(([, line]) => Array.from(line.times).filter((time) => time >= from && time <= to)));
  const quoted = (name) => `"${name.replaceAll('"', '""')}"`;
  const head = [figure.data.x, ...columns.map(([name]) => name)].map(quoted).join(",");
  const sorted = [...times].sort((a, b) => a - b);
  const cell = ({ times, values }, time) => {
    const at = placeOf(times, time);
    return times[at] === time && !Number.isNaN(values[at]) ? +values[at].toPrecision(6) : "";
  };
  const row = (time) => [+time.toPrecision(9), ...columns.map(([, line]) => cell(line, time))].join(",");
  return `${[head, ...sorted.map(row)].join("\n")}\n`;
}

// The visible values at a few times, for those who do not see the figure.
function tableOf(figure) {
  const ROWS = 25;
  const [from, to] = figure.view;
  const columns = figure.panels.flatMap(({ panel }) =>
    panel.marked ? shownLines(figure, panel).map((line) => [columnName(panel, line), line, panel.high - panel.low]) : []);
  const head = make("tr", {}, ...[figure.data.x, ...columns.map(([name]) => name)].map((name) => make("th", { scope: "col" }, name)));
  const rows = Array.from({ length: ROWS }, (_, i) => {
    const time = from + ((to - from) * i) / (ROWS - 1);
    const cells = columns.map(([, line, size]) => make("td", {}, shown(valueAt(line, time), size)));
    return make("tr", {}, make("th", { scope: "row" }, shown(time, (to - from) / 10)), ...cells);
  });
  return make("table", {}, make("caption", {}, "Values of the figure, evenly over the visible part"), make("thead", {}, head), make("tbody", {}, ...rows));
}

// Gives the reader a file, named after the page.
function save(text, type, ending) {
  const name = document.title.replace(/[^\p{L}\p{N}]+/gu, "_").replace(/^_|_$/g, "").slice(0, 60) || "figure";
  saveAs(text, type, `${name}.${ending}`);
}

function saveAs(text, type, name) {
  const link = make("a", { download: name, href: URL.createObjectURL(new Blob([text], { type })) });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}
