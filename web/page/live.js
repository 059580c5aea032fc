// The live page: settings, the run that they ask for, and its figures.

// What is set: how it is shown, and in SI. A slider has [from, to, step] in the shown unit and the size of that unit.
const CHOICES = [
  ["Car and shift", [
    { key: "car", label: "car", options: [] },
    { key: "shift", label: "shift", options: [] },
    { key: "has_stroke", label: "pistons have a stroke (fill takes time)", check: true },
  ]],
  ["Driver and road", [
    { key: "throttle", label: "throttle", unit: "%", range: [0, 100, 1], size: 0.01 },
    { key: "turbine_rad_s", label: "turbine speed at the start", unit: "rpm", range: [1000, 5500, 50], size: Math.PI / 30 },
    { key: "grade_rad", label: "grade, uphill", unit: "%", range: [-8, 8, 0.5], size: 0.01 },
    { key: "mass_kg", label: "mass", unit: "kg", range: [1000, 3000, 25], size: 1 },
  ]],
  ["Clutches and valves, relative to the vehicle file", [
    { key: "friction_factor", label: "friction", unit: "%", range: [-25, 25, 1], size: 0.01, zero: 1 },
    { key: "valve_gain_factor", label: "valve gain", unit: "%", range: [-15, 15, 1], size: 0.01, zero: 1 },
    { key: "valve_delay_s", label: "valve delay", unit: "ms", range: [-10, 40, 1], size: 0.001 },
    { key: "oil_degc", label: "oil temperature", unit: "°C", range: [-20, 120, 5], size: 1 },
  ]],
  ["Sensors", [
    { key: "noise_rad_s", label: "noise of the speeds (1-sigma)", unit: "rad/s", range: [0, 3, 0.05], size: 1 },
    { key: "delay_s", label: "delay of the speeds", unit: "ms", range: [0, 60, 1], size: 0.001 },
    { key: "fault", label: "fault", options: [
      ["none", "none"], ["turbine_lost", "turbine speed lost for 0.2 s"], ["turbine_frozen", "turbine speed frozen for 0.2 s"],
      ["turbine_outliers", "six wrong turbine speeds"], ["readings_lost", "30 % of all readings lost"], ["wheel_scale", "wheel speed 3 % too high"],
    ] },
    { key: "seed", label: "seed of the noise", unit: "", range: [1, 100, 1], size: 1 },
  ]],
];
const SETTINGS = CHOICES.flatMap(([, settings]) => settings);
const DEFAULTS = {
  car: "eight_speed", shift: "1-2", has_stroke: false, throttle: 0.3, turbine_rad_s: (2400 * Math.PI) / 30, grade_rad: 0, mass_kg: 1500, friction_factor: 1.1,
  valve_gain_factor: 1.05, valve_delay_s: 0, oil_degc: 80, noise_rad_s: 0.1, delay_s: 0, fault: "none", seed: 7,
};
const byId = (id) => document.getElementById(id);

// The sensor: questions as JSON, with a log; answers as bytes.
class Sensor {
  static async load() {
    const packed = new Blob([bytesOf(byId("wasm").textContent.trim())]).stream().pipeThrough(new DecompressionStream("gzip"));
    const module = await WebAssembly.compile(await new Response(packed).arrayBuffer());
    const sensor = new Sensor();
    sensor.module = module;
    await sensor.start();
    return sensor;
  }

  async start() {
    this.exports = (await WebAssembly.instantiate(this.module, {})).exports;
  }

  ask(question, log = new Uint8Array()) {
    const json = new TextEncoder().encode(JSON.stringify(question));
    const { memory, question: place, log_bytes: placeOfLog, answer, answer_bytes: bytes } = this.exports;
    for (const [part, room] of [[json, place], [log, placeOfLog]]) {
      const at = room(part.length);
      new Uint8Array(memory.buffer, at, part.length).set(part);
    }
    const from = answer();
    return new TextDecoder().decode(new Uint8Array(memory.buffer, from, bytes()));
  }

  // The answer as an object; `error` where there is none.
  read(question) {
    try {
      return JSON.parse(this.ask(question));
    } catch (error) {
      // What fails in the sensor itself may leave its memory in disorder.
      this.start();
      return broken(error);
    }
  }

  // The answer to a question with a log, from a thread of its own: the page stays usable, and its memory is free afterwards.
  askAside(question, log) {
    const work = `${Sensor}\nonmessage = async ({ data: { module, question, log } }) => {
      const sensor = Object.assign(new Sensor(), { module });
      await sensor.start();
      postMessage(sensor.ask(question, log));
    };`;
    const place = URL.createObjectURL(new Blob([work], { type: "text/javascript" }));
    const worker = new Worker(place);
    const answered = new Promise((done, fail) => {
      worker.onmessage = ({ data }) => done(data);
      worker.onerror = (event) => {
        event.preventDefault();
        fail(new Error(event.message));
      };
      worker.postMessage({ module: this.module, question, log });
    });
    return answered.finally(() => {
      worker.terminate();
      URL.revokeObjectURL(place);
    });
  }

  readAside(question, log) {
    return this.askAside(question, log).then(JSON.parse).catch(broken);
  }
}

const broken = (error) => ({ error: `the run failed: ${error.message}`, hint: "change a setting; what led to it is worth a report" });

// The settings, and their places in the page.
class Panel {
  constructor(form, cars, changed) {
    this.values = { ...DEFAULTS };
    this.cars = cars;
    this.changed = changed;
    this.fields = new Map();
    for (const [title, settings] of CHOICES) {
      form.append(make("fieldset", {}, make("legend", {}, title), ...settings.map((setting) => this.field(setting))));
    }
    const reset = make("button", { type: "button" }, "Start again");
    reset.addEventListener("click", () => this.take({}));
    this.link = make("a", { href: "#" }, "Link to this run");
    this.exact = make("button", { type: "button" }, "No errors");
    this.exact.addEventListener("click", () => this.take({ ...this.values, friction_factor: 1, valve_gain_factor: 1, valve_delay_s: 0, noise_rad_s: 0, delay_s: 0, fault: "none", mass_kg: DEFAULTS.mass_kg }));
    form.append(make("div", { class: "row" }, reset, this.exact, this.link));
    form.addEventListener("submit", (event) => event.preventDefault());
    this.take(this.fromHash(), false);
  }

  field(setting) {
    const { key, label, options, check, range, unit } = setting;
    const id = `set-${key}`;
    const named = make("label", { for: id }, label);
    if (options) {
      const select = make("select", { id }, ...options.map(([value, text]) => make("option", { value }, text)));
      select.addEventListener("change", () => this.set(key, select.value));
      this.fields.set(key, { input: select, row: make("div", { class: "setting wide" }, named, select), show: () => (select.value = this.values[key]) });
    } else if (check) {
      const input = make("input", { type: "checkbox", id });
      input.addEventListener("change", () => this.set(key, input.checked));
      this.fields.set(key, { input, row: make("div", { class: "setting" }, named, input), show: () => (input.checked = this.values[key]) });
    } else {
      const [min, max, step] = range;
      const input = make("input", { type: "range", id, min, max, step });
      const read = make("output", { for: id });
      input.addEventListener("input", () => this.set(key, +(Number(input.value) * setting.size + (setting.zero ?? 0)).toPrecision(12)));
      const show = () => {
        const value = (this.values[key] - (setting.zero ?? 0)) / setting.size;
        input.value = value;
        const text = `${setting.zero !== undefined && value > 0.5 * step ? "+" : ""}${shown(value, 1000 * step)} ${unit}`.trim();
        read.textContent = text;
        input.setAttribute("aria-valuetext", text);
      };
      this.fields.set(key, { input, row: make("div", { class: "setting" }, named, read, input), show });
    }
    return this.fields.get(key).row;
  }

  // Takes one value, and what follows from it.
  set(key, value) {
    this.values[key] = value;
    this.fit();
    this.tell();
  }

  // Takes these settings, the rest as at the start.
  take(settings, tell = true) {
    this.values = { ...DEFAULTS, ...settings };
    this.fit();
    if (tell) this.tell();
  }

  // Keeps the shift one of the chosen car, and shows all values.
  fit() {
    const { values } = this;
    const car = this.cars.find(({ name }) => name === values.car) ?? this.cars[0];
    values.car = car.name;
    const fill = (select, options) => {
      const texts = options.map(([value]) => value).join(" ");
      if (select.dataset.of === texts) return;
      select.dataset.of = texts;
      select.replaceChildren(...options.map(([value, text]) => make("option", { value }, text)));
    };
    fill(this.fields.get("car").input, this.cars.map(({ name, title }) => [name, title]));
    const pairs = car.gears.slice(1).map((gear, at) => [car.gears[at], gear]);
    const shifts = [...pairs.map(([from, to]) => `${from}-${to}`), ...pairs.map(([from, to]) => `${to}-${from}`).reverse()];
    fill(this.fields.get("shift").input, [...shifts.map((shift) => [shift, shift.replace("-", " → ")]), ["all", "a drive of 35 s through the gears"]]);
    if (![...shifts, "all"].includes(values.shift)) values.shift = shifts[0];
    this.fields.get("turbine_rad_s").input.disabled = values.shift === "all";
    for (const setting of SETTINGS) {
      const { row, show } = this.fields.get(setting.key);
      show();
      row.classList.toggle("changed", values[setting.key] !== DEFAULTS[setting.key]);
    }
    const changes = SETTINGS.filter(({ key }) => values[key] !== DEFAULTS[key]).map(({ key }) => `${key}=${encodeURIComponent(values[key])}`);
    this.hash = `#${changes.join("&")}`;
    this.link.href = this.hash;
  }

  tell() {
    // The address follows the settings, not each step of a slider: browsers allow few changes of it a second.
    clearTimeout(this.later);
    this.later = setTimeout(() => history.replaceState(null, "", this.hash), 250);
    this.changed();
  }

  // The settings of the address; what is none of them, or outside its range, is left out.
  fromHash() {
    const found = {};
    for (const part of location.hash.slice(1).split("&")) {
      const [key, text = ""] = part.split("=");
      const setting = SETTINGS.find((setting) => setting.key === key);
      if (!setting) continue;
      if (setting.check) found[key] = text === "true";
      else if (setting.range) {
        const value = Number(text);
        const [low, high] = setting.range.map((end) => end * setting.size + (setting.zero ?? 0));
        if (text !== "" && value >= low - 1e-9 && value <= high + 1e-9) found[key] = value;
      } else if (!setting.options.length || setting.options.some(([value]) => value === decode(text))) found[key] = decode(text);
    }
    return found;
  }

  // As the sensor takes them.
  settings() {
    const { oil_degc, ...values } = this.values;
    return oil_degc === DEFAULTS.oil_degc ? values : { ...values, oil_degc };
  }
}

function decode(text) {
  try {
    return decodeURIComponent(text);
  } catch {
    return text;
  }
}

// Sentences: warnings with their hints as boxes, the others as a list.
function sentences(notes) {
  const isWarning = (note) => note.startsWith("warning: ") || note.includes("\nhint: ");
  const code = (text) => text.split("`").map((part, at) => (at % 2 ? make("code", {}, part) : part));
  const boxes = notes.filter(isWarning).map((note) => {
    const [text, ...hints] = note.replace(/^warning: /, "").split("\nhint: ");
    return make("div", { class: "warning" }, make("p", {}, make("b", {}, "Warning. "), ...code(text)),
      ...hints.map((hint) => make("p", { class: "hint" }, make("b", {}, "Hint: "), ...code(hint))));
  });
  const others = notes.filter((note) => !isWarning(note));
  return [...boxes, ...(others.length ? [make("ul", {}, ...others.map((note) => make("li", {}, ...code(note))))] : [])];
}

const failed = ({ error, hint }) => make("div", { class: "warning", role: "alert" }, make("p", {}, error), ...(hint ? [make("p", { class: "hint" }, make("b", {}, "Hint: "), hint)] : []));

// The drawn run: one figure at a time, and its numbers.
class Result {
  constructor() {
    this.element = make("div", { class: "figure" });
    byId("figure").append(this.element);
    this.select = make("select", { id: "shown-choice" });
    this.select.addEventListener("change", () => this.draw());
    this.errors = make("p", { class: "errors" });
    byId("shown").append(make("label", { for: "shown-choice" }, "shown "), this.select, this.errors);
    this.figure = null;
  }

  take({ drawn, notes }, isDrive) {
    this.drawn = drawn;
    byId("messages").replaceChildren(...sentences(isDrive ? notes : notes.filter((note) => note.startsWith("warning: "))));
    const choices = [["0", "the whole drive"], ...drawn.shifts.map(({ number, title }) => [String(number), `shift ${number}: ${title}`])];
    const before = this.select.selectedIndex;
    const texts = choices.map(([, text]) => text).join("|");
    if (this.select.dataset.of !== texts) {
      const isNew = this.select.options.length !== choices.length;
      this.select.dataset.of = texts;
      this.select.replaceChildren(...choices.map(([value, text]) => make("option", { value }, text)));
      this.select.selectedIndex = isNew ? Math.min(isDrive ? 0 : 1, choices.length - 1) : before;
    }
    this.draw();
  }

  draw() {
    const number = Number(this.select.value);
    const shift = this.drawn.shifts.find((shift) => shift.number === number);
    const text = shift ? shift.figure : this.drawn.overview;
    if (!this.figure?.take(text)) {
      const hidden = this.figure?.hidden;
      this.close();
      this.figure = new Figure(this.element, text);
      figures.set(this.element, this.figure);
      hidden?.forEach((name) => this.figure.show(name, false));
    }
    this.numbers(number);
  }

  // The number of a shift, which shows it; of one that is not drawn the number alone.
  opener(number) {
    if (![...this.select.options].some(({ value }) => value === number)) return number;
    const button = make("button", { type: "button", "aria-label": `show shift ${number}` }, number);
    button.addEventListener("click", () => {
      this.select.value = number;
      this.draw();
    });
    return button;
  }

  close() {
    if (!this.figure) return;
    if (active === this.figure) activate(null);
    this.figure.close();
    figures.delete(this.element);
    this.figure = null;
  }

  // The numbers of a shift, each with its meaning; of the whole drive those of all shifts.
  numbers(number) {
    const { columns, rows } = this.drawn;
    const cellOf = (row, name, after) => row[columns.findIndex(([title], at) => title === name && columns[at - 1]?.[0] === after)];
    const title = ([name]) => make("th", { scope: "col" }, name);
    const row = rows.find(([first]) => first === String(number));
    const cell = (text) => make("td", {}, text);
    const errors = row ? ["inertia phase", "torque phase"].map((phase) => [cellOf(row, "N m", phase), phase]).filter(([cell]) => cell) : [];
    this.errors.textContent = errors.length ? `torque error, filter / valve model: ${errors.map(([cell, phase]) => `${cell} N m in the ${phase}`).join(", ")}` : "";
    const table = row
      ? make("table", { class: "scores one-name" },
        make("caption", { class: "unseen" }, "Numbers of the shift"),
        make("thead", {}, make("tr", {}, ...[["quantity"], ["value"], ["meaning"]].map(title))),
        make("tbody", {}, ...columns.flatMap(([name, meaning], at) =>
          at && row[at] ? [make("tr", {}, make("th", { scope: "row" }, name === "N m" ? `${columns[at - 1][0]} ${name}` : name), cell(row[at]), cell(meaning))] : [])))
      : make("table", { class: "scores two-names" }, make("caption", { class: "unseen" }, "Shifts of the drive"),
        make("thead", {}, make("tr", {}, ...columns.map(title))),
        make("tbody", {}, ...rows.map(([first, ...others]) => make("tr", {}, make("td", {}, this.opener(first)), ...others.map(cell)))));
    byId("numbers").replaceChildren(make("div", { class: "scroll", tabindex: "0", role: "group", "aria-label": "Numbers" }, table));
  }
}

// The files of the run with buttons to save them, and the commands for them.
function showFiles(files, car) {
  byId("commands").textContent =
    "wetclutch simulate drive.toml --vehicle driven.toml -o run\nwetclutch estimate run/live_measured.csv --vehicle known.toml -o run/estimates.csv";
  const gearbox = car.gearbox;
  const names = { "driven.toml": files["driven.toml"], "known.toml": files["known.toml"], "drive.toml": files["drive.toml"], [gearbox]: files.gearbox };
  const saves = Object.entries(names).map(([name, text]) => {
    const button = make("button", { type: "button" }, `Save ${name}`);
    button.addEventListener("click", () => saveAs(text, "text/plain", name));
    return button;
  });
  byId("saves").replaceChildren(...saves.flatMap((button) => [button, " "]), `${gearbox} belongs into a folder gearboxes beside that of the others.`);
}

// Begins when the page is there.
Sensor.load().then((sensor) => {
  const { cars, version } = sensor.read({ ask: "cars" });
  byId("version").textContent = version;
  const result = new Result();
  const panel = new Panel(byId("settings"), cars, () => (pending ??= requestAnimationFrame(run)));
  let pending = null;
  function run() {
    pending = null;
    const begin = performance.now();
    const answer = sensor.read({ ask: "run", settings: panel.settings() });
    const ran = performance.now() - begin;
    if (answer.error) return byId("messages").replaceChildren(failed(answer));
    result.take(answer, panel.values.shift === "all");
    showFiles(answer.files, cars.find(({ name }) => name === panel.values.car));
    // Plots are drawn behind this call.
    queueMicrotask(() => {
      const draw = performance.now() - begin - ran;
      document.documentElement.dataset.took = JSON.stringify({ run: ran, draw });
    });
  }
  addEventListener("hashchange", () => {
    if (location.hash !== panel.hash) panel.take(panel.fromHash());
  });
  run();
  logs(sensor, panel, result);
}).catch((error) => byId("messages").replaceChildren(failed({ error: `the sensor cannot be started: ${error.message}`, hint: "use a browser of 2023 or later" })));
