// The live page: its results are those of the program, and its readers can use it. .ci/pages/live runs it.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { test } from "node:test";
import { gunzipSync } from "node:zlib";
import { close, download, frame, launch, open } from "./browser.mjs";

const PAGE = resolve(import.meta.dirname, "../../web/dist/index.html");
const html = readFileSync(PAGE, "utf8");
const { browser, end } = await launch();
test.after(end);
const folder = mkdtempSync(join(tmpdir(), "live-"));
test.after(() => rmSync(folder, { recursive: true }));

// The sensor of the page, without the page.
const packed = Buffer.from(html.match(/id="wasm">([^<]*)</)[1], "base64");
const { exports: sensor } = await WebAssembly.instantiate(await WebAssembly.compile(gunzipSync(packed)), {});
function ask(question, log = Buffer.alloc(0)) {
  for (const [part, room] of [[Buffer.from(JSON.stringify(question)), sensor.question], [log, sensor.log_bytes]]) {
    const place = room(part.length);
    new Uint8Array(sensor.memory.buffer, place, part.length).set(part);
  }
  const at = sensor.answer();
  return Buffer.from(new Uint8Array(sensor.memory.buffer, at, sensor.answer_bytes())).toString();
}

const { cars } = JSON.parse(ask({ ask: "cars" }));
const program = (...words) => execFileSync(process.env.PROGRAM, words, { cwd: folder, stdio: ["ignore", "pipe", "ignore"] });

const RUNS = [
  ...cars.map(({ name }) => ({ car: name })),
  { car: "eight_speed", shift: "3-2", throttle: 0.7, has_stroke: true, oil_degc: 20, friction_factor: 0.85, valve_gain_factor: 1.1, valve_delay_s: 0.02, mass_kg: 2200, grade_rad: 0.05 },
  { car: "ten_speed", shift: "all", fault: "readings_lost", noise_rad_s: 1, delay_s: 0.03 },
  { car: "six_speed", shift: "2-3", fault: "turbine_frozen", seed: 99 },
];
for (const settings of RUNS) {
  test(`readings and estimates are the bytes of the program: ${JSON.stringify(settings)}`, () => {
    const { files, error } = JSON.parse(ask({ ask: "run", settings }));
    assert.equal(error, undefined);
    mkdirSync(join(folder, "gearboxes"), { recursive: true });
    mkdirSync(join(folder, "run"), { recursive: true });
    const { gearbox, ...others } = files;
    writeFileSync(join(folder, "gearboxes", cars.find(({ name }) => name === settings.car).gearbox), gearbox);
    for (const [name, text] of Object.entries(others)) writeFileSync(join(folder, "run", name), text);
    program("simulate", "run/drive.toml", "--vehicle", "run/driven.toml", "-o", "run");
    program("estimate", "run/live_measured.csv", "--vehicle", "run/known.toml", "-o", "run/estimates.csv");
    for (const [what, name] of [["measured", "live_measured.csv"], ["estimates", "estimates.csv"]]) {
      const ours = ask({ ask: what, settings });
      assert(ours.length > 10_000, ours.slice(0, 300));
      assert(ours === readFileSync(join(folder, "run", name), "utf8"), `${name} differs`);
    }
  });
}

test("what is no setting is an error with a hint", () => {
  const error = (settings) => JSON.parse(ask({ ask: "run", settings })).error;
  assert.match(error({ car: "tram" }), /no `tram`/);
  assert.match(error({ shift: "1-9" }), /names no two gears/);
  assert.match(error({ throttle: 7 }), /throttle/);
  assert.match(error({ mass_kg: -1 }), /mass_kg/);
  assert.match(error({ speed: 1 }), /unknown field/);
  assert.match(JSON.parse(ask("nothing")).error, /the question/);
});

const ready = (page) => page.waitForSelector("#figure .uplot");
async function on(work, options) {
  const page = await open(browser, PAGE, options);
  await ready(page);
  await work(page);
  await close(page);
}
const numbers = (page) => page.$eval("#numbers", (numbers) => numbers.textContent);
const move = (page, key, steps) => page.$eval(`#set-${key}`, (input, steps) => {
  input.value = Number(input.value) + steps * Number(input.step);
  input.dispatchEvent(new Event("input", { bubbles: true }));
}, steps);

test("a slider changes figure, numbers and link", () => on(async (page) => {
  const picture = () => page.$eval("#figure canvas", (canvas) => canvas.toDataURL());
  for (const [key, steps] of [["throttle", 10], ["turbine_rad_s", 10], ["grade_rad", 4], ["mass_kg", 20], ["friction_factor", -20], ["valve_gain_factor", 5], ["valve_delay_s", 20], ["noise_rad_s", 30], ["delay_s", 30], ["seed", 1]]) {
    const before = [await picture(), await numbers(page)].join();
    await move(page, key, steps);
    await frame(page);
    assert.notEqual([await picture(), await numbers(page)].join(), before, key);
  }
  await page.waitForFunction(() => location.hash.includes("throttle="), { timeout: 2000 });
}));

test("what an axis leaves out follows the values", () => on(async (page) => {
  const notes = () => page.$$eval("#figure .note", (notes) => notes.map((note) => note.textContent).join());
  const before = await notes();
  assert.match(before, /values reach/);
  await move(page, "friction_factor", -35);
  await move(page, "valve_gain_factor", -15);
  await frame(page);
  assert.notEqual(await notes(), before);
}));

test("each car has its shifts, and each fault a run", () => on(async (page) => {
  for (const { name, gears } of cars) {
    await page.select("#set-car", name);
    await frame(page);
    const shifts = await page.$$eval("#set-shift option", (options) => options.map(({ value }) => value));
    assert.equal(shifts.length, 2 * (gears.length - 1) + 1);
    for (const shift of [shifts[0], shifts.at(-2), "all"]) {
      await page.select("#set-shift", shift);
      await frame(page);
      assert.equal(await page.$("#messages [role=alert]"), null, `${name} ${shift}: ${await page.$eval("#messages", (messages) => messages.textContent)}`);
    }
  }
  for (const fault of await page.$$eval("#set-fault option", (options) => options.map(({ value }) => value))) {
    await page.select("#set-fault", fault);
    await frame(page);
    assert.equal(await page.$("#messages [role=alert]"), null, fault);
  }
}));

test("a link restores the state", async () => {
  let link, seen;
  await on(async (page) => {
    await page.select("#set-car", "six_speed");
    await page.select("#set-shift", "3-4");
    await page.click("#set-has_stroke");
    await move(page, "throttle", 15);
    await page.select("#set-fault", "turbine_lost");
    await frame(page);
    [link, seen] = [await page.$eval("#settings a", (link) => link.getAttribute("href")), await numbers(page)];
  });
  await on(async (page) => {
    assert.equal(await numbers(page), seen);
    assert.equal(await page.$eval("#set-shift", (select) => select.value), "3-4");
    assert.equal(await page.$eval("#set-has_stroke", (input) => input.checked), true);
  }, { hash: link });
});

test("a link that holds anything else is the start", () => on(async (page) => {
  assert.equal(await page.$("#messages [role=alert]"), null);
  assert.equal(await page.$eval("#set-car", (select) => select.value), "eight_speed");
}, { hash: "#car=<script>alert(1)</script>&throttle=1e99&grade_rad=x&fault=%E0&seed=&shift=<b>" }));

test("sliders move by keys, and those of the figure move its cursor", () => on(async (page) => {
  await page.focus("#set-throttle");
  const before = await page.$eval("#set-throttle", (input) => input.value);
  await page.keyboard.press("ArrowRight");
  assert.notEqual(await page.$eval("#set-throttle", (input) => input.value), before);
  // The figure of the new throttle takes the place of the old one and its cursor.
  await frame(page);
  await page.focus(".plots");
  await page.keyboard.press("ArrowRight");
  await page.waitForFunction(() => /^time \d/.test(document.querySelector(".plots .time").textContent));
}));

test("a row of a drive shows its shift", () => on(async (page) => {
  await page.select("#set-shift", "all");
  await frame(page);
  assert.equal(await page.$eval("#shown-choice", (select) => select.value), "0");
  await page.click("#numbers tr:nth-of-type(2) button");
  await frame(page);
  assert.equal(await page.$eval("#shown-choice", (select) => select.value), "2");
  assert.match(await page.$eval("#figure", (figure) => figure.textContent), /oncoming/);
}));

test("a zoomed view and hidden curves stay while a slider moves", () => on(async (page) => {
  await page.focus(".plots");
  await page.keyboard.press("+");
  await page.evaluate(() => [...document.querySelectorAll(".legend label")].find((label) => label.textContent.startsWith("valve model")).click());
  await frame(page);
  const state = () => page.$eval(".uplot", (plot) => plot.dataset.view);
  const view = await state();
  await move(page, "friction_factor", -5);
  await frame(page);
  assert.equal(await state(), view);
  assert(await page.$$eval(".legend label", (labels) => labels.filter((label) => label.textContent.startsWith("valve model")).every((label) => !label.querySelector("input").checked)));
}));

test("the files of the run are saved", () => on(async (page) => {
  await page.evaluate(() => (document.querySelector("#files").open = true));
  assert.match(await download(page, browser, "#saves button:nth-of-type(3)", ".toml"), /\[\[segment\]\]/);
}));

test("a redraw is quick", () => on(async (page) => {
  const times = [];
  for (let at = 0; at < 40; at++) {
    await move(page, "throttle", at % 2 ? 5 : -5);
    await frame(page);
    times.push(JSON.parse(await page.$eval("html", (root) => root.dataset.took)));
  }
  const middle = (of) => times.map(of).sort((a, b) => a - b)[20];
  const [run, draw] = [middle(({ run }) => run), middle(({ draw }) => draw)];
  console.log(`one shift: simulated and estimated in ${run.toFixed(1)} ms, drawn in ${draw.toFixed(1)} ms (medians of 40)`);
  // Of a machine that does other work besides.
  assert(run + draw < 150, `${run} + ${draw} ms`);
}));

for (const [width, scheme] of [[390, "light"], [390, "dark"], [1000, "light"], [1920, "dark"]]) {
  test(`axe finds nothing, and nothing scrolls sideways: ${width} px, ${scheme}`, () => on(async (page) => {
    await page.evaluate(() => (document.querySelector("#files").open = true));
    await page.evaluate(readFileSync(new URL("node_modules/axe-core/axe.min.js", import.meta.url), "utf8"));
    const { violations } = await page.evaluate(() => axe.run());
    assert.deepEqual(violations.map(({ id, nodes }) => [id, nodes.map(({ html }) => html.slice(0, 200))]), []);
    assert(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth), "sideways");
  }, { width, scheme }));
}

// Readings of a drive with the names of another recorder: rpm, and other words.
const measured = ask({ ask: "measured", settings: { car: "six_speed", shift: "all" } });
const LOG = join(folder, "<img src=x onerror=alert(1)>.csv");
writeFileSync(LOG, measured);
const drop = async (page, ...files) => {
  // What is awaited is the answer to these files, not the one before.
  await page.$eval("#log-messages", (messages) => messages.replaceChildren());
  const input = await page.$("#file");
  await input.uploadFile(...files);
  await page.waitForFunction(() => document.querySelector("#log-messages p b, #log-messages [role=alert]"), { timeout: 60000 });
};

test("a log is estimated as the program does, and its name is text", async () => {
  program("estimate", LOG, "--vehicle", resolve(import.meta.dirname, "../../vehicles/six_speed.toml"), "-o", "log_estimates.csv");
  const ours = ask({ ask: "log_estimates", car: "six_speed", name: "log.csv", map: null }, Buffer.from(measured));
  assert(ours === readFileSync(join(folder, "log_estimates.csv"), "utf8"), "the estimates differ");
  await on(async (page) => {
    await page.select("#set-car", "six_speed");
    await drop(page, LOG);
    assert.match(await page.$eval("#log-messages", (messages) => messages.textContent), /<img src=x onerror=alert\(1\)>\.csv with “six-speed/);
    assert.equal(await page.$("#log-messages img"), null);
    assert((await page.$$("#shown-choice option")).length > 4);
    assert(await download(page, browser, "#log-messages button", ".csv") === ours);
  });
});

test("an MDF log is estimated as the program does", async () => {
  const file = join(folder, "log.mf4");
  program("convert", LOG, "-o", file);
  program("estimate", file, "--vehicle", resolve(import.meta.dirname, "../../vehicles/six_speed.toml"), "-o", "mdf_estimates.csv");
  const ours = ask({ ask: "log_estimates", car: "six_speed", name: "log.mf4", map: null }, readFileSync(file));
  assert(ours === readFileSync(join(folder, "mdf_estimates.csv"), "utf8"), "the estimates differ");
  await on(async (page) => {
    await page.select("#set-car", "six_speed");
    await drop(page, file);
    assert.match(await page.$eval("#log-messages", (messages) => messages.textContent), /log\.mf4 with “six-speed/);
    assert((await page.$$("#shown-choice option")).length > 4);
  });
});

test("frames in packed containers are read, Parquet is refused with a hint", () => on(async (page) => {
  const data = (name) => resolve(import.meta.dirname, "../../crates/logs/tests/data", name);
  await drop(page, data("bus.blf"), data("bus.dbc"));
  await page.waitForFunction(() => !document.querySelector("#log-map").hidden, { timeout: 60000 });
  await drop(page, data("snappy.parquet"));
  assert.match(await page.$eval("#log-messages", (messages) => messages.textContent), /Parquet logs are not read from memory.*convert/);
}));

test("a log with other names is mapped by suggestion", () => on(async (page) => {
  const [head, ...rows] = measured.split("\n");
  const renamed = join(folder, "bench.csv");
  writeFileSync(renamed, [head.replace("engine_speed_rad_s", "EngineSpeed [rad/s]").replace("turbine_speed_rad_s", "TurbineSpeed [rad/s]").replace("output_speed_rad_s", "OutputSpeed [rad/s]"), ...rows].join("\n"));
  await page.select("#set-car", "six_speed");
  await drop(page, renamed);
  await page.waitForFunction(() => !document.querySelector("#log-map").hidden, { timeout: 60000 });
  assert.match(await page.$eval("#log-map textarea", (map) => map.value), /TurbineSpeed/);
}));

test("a CAN log with its DBC is estimated as the program does", async () => {
  // Every row as frames with two floats each.
  const [head, ...rows] = measured.trim().split("\n").map((row) => row.split(","));
  const wanted = head.map((name, at) => [name, at]).filter(([name]) => /^(engine|turbine|output|wheel)_speed_rad_s$|^element_._current_a$|^(target_)?gear$/.test(name));
  const unit = (name) => (name.endsWith("_a") ? "A" : name.endsWith("gear") ? "" : "rad/s");
  const messages = [];
  for (let at = 0; at < wanted.length; at += 2) messages.push(wanted.slice(at, at + 2));
  const signal = ([name], place) => ` SG_ ${name} : ${32 * place}|32@1- (1,0) [0|0] "${unit(name)}" ECU`;
  const dbc = ["VERSION \"\"", "BU_: ECU", ...messages.flatMap((of, k) => [`BO_ ${256 + k} M${k}: 8 ECU`, ...of.map(signal)]),
    ...messages.flatMap((of, k) => of.map(([name]) => `SIG_VALTYPE_ ${256 + k} ${name} : 1;`)), ""].join("\n");
  const hex = (value) => { const bytes = Buffer.alloc(4); bytes.writeFloatLE(Number(value) || 0); return bytes.toString("hex").toUpperCase(); };
  const frames = rows.flatMap((row) => messages.map((of, k) =>
    `(${Number(row[0]).toFixed(6)}) can0 ${(256 + k).toString(16)}#${of.map(([, at]) => hex(row[at])).join("")}`));
  const map = wanted.map(([name]) => `[channel.${name.replace(/_rad_s$|_a$/, "")}]\nname = "${name}"\n`).join("");
  const [log, database, mapping] = ["bus.log", "bus.dbc", "bus_map.toml"].map((name) => join(folder, name));
  writeFileSync(log, frames.join("\n") + "\n");
  writeFileSync(database, dbc);
  writeFileSync(mapping, map);
  program("estimate", log, "--vehicle", resolve(import.meta.dirname, "../../vehicles/six_speed.toml"), "--dbc", database, "--map", mapping, "-o", "bus_estimates.csv");
  const ours = ask({ ask: "log_estimates", car: "six_speed", name: "bus.log", map, dbc: { name: "bus.dbc", text: dbc } }, Buffer.from(frames.join("\n") + "\n"));
  assert(ours === readFileSync(join(folder, "bus_estimates.csv"), "utf8"), "the estimates differ");
  await on(async (page) => {
    await page.select("#set-car", "six_speed");
    await drop(page, log);
    assert.match(await page.$eval("#log-messages", (messages) => messages.textContent), /drop its DBC on this page too/);
    await drop(page, log, database);
    // Its signals have the names of the program.
    assert.match(await page.$eval("#log-messages", (messages) => messages.textContent), /bus\.log with “six-speed/);
  });
});

test("what is no log is refused with a hint", () => on(async (page) => {
  const file = join(folder, "none.csv");
  writeFileSync(file, "a,b\n1,2\n");
  await drop(page, file);
  assert.match(await page.$eval("#log-messages", (messages) => messages.textContent), /Hint/);
}));
