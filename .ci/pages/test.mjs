// Pages in a browser, as their readers work with them: node test.mjs FOLDER, which .ci/pages/run fills.
import assert from "node:assert/strict";
import { readFileSync, statSync } from "node:fs";
import { join } from "node:path";
import { test } from "node:test";
import { close, download, frame, launch, open } from "./browser.mjs";

const folder = process.env.PAGES;
const SHIFT = join(folder, "shift/report.html");
const DRIVE = join(folder, "drive/report.html");
const LOG = join(folder, "<img src=x onerror=alert(1)>_report.html");
const HOUR = join(folder, "hour_report.html");
const COMPARED = join(folder, "compare.html");
const WORST = join(folder, "worst/worst_case.html");
const OTHERS = [
  "check", "check_maps", "design", "fit", "study/study", "cars/study", "bounds", "bench/bench", "matrix/bench", "sensitivity/sensitivity", "car_sensitivity/sensitivity",
  "reproduction/reproduction", "compare_files",
];
const PAGES = [SHIFT, DRIVE, LOG, HOUR, COMPARED, WORST, ...OTHERS.map((name) => join(folder, `${name}.html`))];

const { browser, end } = await launch();
test.after(end);

// The time that each panel of the first figure shows first and last, from the ticks' scale.
const views = (page, at = 0) => page.evaluate((at) => {
  const plots = document.querySelectorAll("div.figure")[at].querySelectorAll(".uplot");
  return [...plots].map((plot) => plot.dataset.view);
}, at);
const timeRead = (page) => page.$eval(".plots .time", (time) => time.textContent);
const middle = async (page, selector) => {
  const element = await page.$(selector);
  await element.scrollIntoView();
  const box = await element.boundingBox();
  return { x: box.x + box.width / 2, y: box.y + box.height / 2, width: box.width, height: box.height };
};
const span = (view) => { const [from, to] = view.split(" ").map(Number); return to - from; };

async function on(file, work, options) {
  const page = await open(browser, file, options);
  await work(page);
  await close(page);
}

test("wheel, drag, keys and buttons zoom all panels alike, and a double click shows the whole", () => on(SHIFT, async (page) => {
  const [whole] = await views(page);
  const isZoomed = async (message) => {
    await frame(page);
    const [first, ...others] = await views(page);
    assert(span(first) < span(whole), message);
    assert(others.every((view) => view === first), message);
    const { x, y } = await middle(page, ".u-over");
    await page.mouse.click(x, y, { count: 2 });
    await frame(page);
    assert.equal((await views(page))[0], whole, "the whole again");
  };
  const { x, y } = await middle(page, ".u-over");
  await page.mouse.move(x, y);
  // The page scrolls until the figure is chosen.
  await page.mouse.wheel({ deltaY: 40 });
  await frame(page);
  assert.equal((await views(page))[0], whole);
  await page.mouse.click(x, y);
  await page.mouse.wheel({ deltaY: -300 });
  await isZoomed("wheel");
  const drag = await middle(page, ".u-over");
  await page.mouse.move(drag.x - 50, drag.y);
  await page.mouse.down();
  await page.mouse.move(drag.x + 50, drag.y, { steps: 4 });
  await page.mouse.up();
  await isZoomed("drag");
  await page.keyboard.press("+");
  await isZoomed("key");
  await page.click("button[aria-label='zoom in']");
  await isZoomed("button");
}));

test("a drag with shift and the keys move the view", () => on(SHIFT, async (page) => {
  await page.keyboard.press("+");
  await frame(page);
  const [before] = await views(page);
  const { x, y } = await middle(page, ".u-over");
  await page.keyboard.down("Shift");
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x - 80, y, { steps: 4 });
  await page.mouse.up();
  await page.keyboard.up("Shift");
  await frame(page);
  const [moved] = await views(page);
  assert(Number(moved.split(" ")[0]) > Number(before.split(" ")[0]), `${before} -> ${moved}`);
  assert(Math.abs(span(moved) - span(before)) < 1e-6);
  await page.keyboard.press(",");
  await frame(page);
  assert(Number((await views(page))[0].split(" ")[0]) < Number(moved.split(" ")[0]));
}));

test("two fingers zoom and one finger moves", () => on(SHIFT, async (page) => {
  const { x, y } = await middle(page, ".u-over");
  const [whole] = await views(page);
  const client = await page.createCDPSession();
  const touch = (type, ...places) => client.send("Input.dispatchTouchEvent", { type, touchPoints: places.map(([x, y], id) => ({ x, y, id })) });
  await touch("touchStart", [x - 30, y], [x + 30, y]);
  for (const by of [50, 80, 110]) await touch("touchMove", [x - by, y], [x + by, y]);
  await touch("touchEnd");
  await frame(page);
  const [zoomed] = await views(page);
  assert(span(zoomed) < 0.5 * span(whole), zoomed);
  await touch("touchStart", [x, y]);
  for (const by of [20, 40, 60]) await touch("touchMove", [x - by, y]);
  await touch("touchEnd");
  await frame(page);
  const [moved] = await views(page);
  assert(Number(moved.split(" ")[0]) > Number(zoomed.split(" ")[0]));
}));

test("the cursor reads values with units in every panel, by mouse and by keys", () => on(SHIFT, async (page) => {
  const { x, y } = await middle(page, ".u-over");
  await page.mouse.move(x, y);
  await frame(page);
  const readings = () => page.$eval("div.figure", (figure) => [...figure.querySelectorAll(".panel")].map((panel) => panel.querySelector("output").textContent));
  const read = await readings();
  assert.match(await timeRead(page), /^time \d+\.\d+ s$/);
  assert.match(read[0], /^\d+ rpm$/);
  assert.match(read[1], /^-?\d\.\d+ MPa$/);
  assert(read.every((text) => /\d/.test(text)), read.join("; "));
  const before = await timeRead(page);
  await page.keyboard.press("ArrowRight");
  await frame(page);
  assert.notEqual(await timeRead(page), before);
  await page.waitForFunction(() => /rpm/.test(document.querySelector("[aria-live]").textContent), { timeout: 2000 });
}));

test("a switch hides an observer in all panels", () => on(SHIFT, async (page) => {
  const isShown = () => page.$eval("div.figure", (figure) => [...figure.querySelectorAll(".legend label")]
    .filter((label) => label.querySelector("span").textContent === "open loop").map((label) => label.querySelector("input").checked));
  assert((await isShown()).length >= 3 && (await isShown()).every(Boolean));
  const switched = async () => {
    const label = await page.evaluateHandle(() => [...document.querySelectorAll(".legend label")].find((label) => label.textContent.startsWith("open loop")));
    await label.click();
    await frame(page);
  };
  await switched();
  assert((await isShown()).every((shown) => !shown));
  await page.waitForFunction(() => !document.querySelector(".figure .unseen").textContent.includes("open loop"), { timeout: 2000 });
  await switched();
  assert((await isShown()).every(Boolean));
}));

test("the table of values follows the view", () => on(SHIFT, async (page) => {
  const first = () => page.$eval(".figure .unseen tbody th", (cell) => cell.textContent);
  await page.waitForSelector(".figure .unseen table", { timeout: 2000 });
  const before = await first();
  await page.keyboard.press("+");
  await page.waitForFunction((before) => document.querySelector(".figure .unseen tbody th").textContent !== before, { timeout: 2000 }, before);
}));

test("a figure is saved as SVG, and the visible values as CSV", () => on(SHIFT, async (page) => {
  const svg = await download(page, browser, "button[aria-label='save the figure as SVG']", ".svg");
  assert(svg.startsWith("<svg xmlns") && svg.endsWith("</svg>") && svg.includes("clutch pressure (MPa)") && !svg.includes("NaN"));
  const isDrawing = await page.evaluate((svg) => new DOMParser().parseFromString(svg, "image/svg+xml").querySelector("parsererror") === null, svg);
  assert(isDrawing);
  const rows = async () => (await download(page, browser, "button[aria-label^='save the visible']", ".csv")).trim().split("\n");
  const whole = await rows();
  assert.match(whole[0], /^"time \(s\)","speed: engine \(rpm\)"/);
  assert(whole.length > 200 && whole.every((row) => row.split(",").length >= 10));
  await page.keyboard.press("+");
  await frame(page);
  assert((await rows()).length < 0.7 * whole.length);
}));

test("the table of shifts is sorted and filtered", () => on(DRIVE, async (page) => {
  const column = (n) => page.$$eval("table.sortable tbody tr", (rows, n) => rows.filter((row) => !row.hidden).map((row) => row.cells[n].textContent.trim()), n);
  const numbers = (await column(3)).map(Number);
  const sort = async () => (await page.$$("table.sortable th button"))[3].click();
  await sort();
  assert.deepEqual((await column(3)).map(Number), [...numbers].sort((a, b) => a - b));
  await sort();
  assert.deepEqual((await column(3)).map(Number), [...numbers].sort((a, b) => b - a));
  const titles = await page.$$eval("table.sortable th button", (titles) => titles.map((title) => title.textContent));
  for (const score of ["rating", "response s", "step m/s^2", "torque hole", "vibration dose m/s^1.75", "jerk m/s^3"]) {
    const at = titles.indexOf(score);
    assert(at > 0, score);
    await (await page.$$("table.sortable th button"))[at].click();
    const values = (await column(at)).map(parseFloat);
    assert(values.every(Number.isFinite), `${score}: ${values}`);
    assert.deepEqual(values, [...values].sort((a, b) => a - b), score);
  }
  // What is not known stands last in either order.
  const ratios = titles.lastIndexOf("torque phase");
  for (const _ of ["up", "down"]) {
    await (await page.$$("table.sortable th button"))[ratios].click();
    const cells = await column(ratios);
    assert(cells[0] !== "–" && cells.at(-1) === "–", cells.join());
  }
  const kinds = [...new Set(await column(2))];
  assert(kinds.length > 1);
  const kind = await page.evaluateHandle(() => [...document.querySelectorAll(".filters label")].find((label) => label.textContent.startsWith("kind")).querySelector("select"));
  await kind.select(kinds[0]);
  assert.deepEqual([...new Set(await column(2))], [kinds[0]]);
  await kind.select("");
  assert.equal((await column(2)).length, numbers.length);
}));

test("a row opens its shift, n and p go on from there", () => on(DRIVE, async (page) => {
  const openShift = () => page.$$eval("details.shift[open]", (shifts) => shifts.map((shift) => shift.id));
  const row = await page.evaluateHandle(() => document.querySelector("table a[href='#shift5']").closest("tr").cells[2]);
  await row.click();
  await frame(page);
  assert.deepEqual(await openShift(), ["shift5"]);
  assert(await page.$eval("#shift5 .uplot", (plot) => plot.clientWidth > 500));
  const top = await page.$eval("#shift5", (shift) => shift.getBoundingClientRect().top);
  assert(Math.abs(top) < 100, String(top));
  const order = await page.$$eval("details.shift", (shifts) => shifts.map((shift) => shift.id));
  await page.keyboard.press("n");
  await frame(page);
  assert.deepEqual(await openShift(), [order[order.indexOf("shift5") + 1]]);
  await page.keyboard.press("p");
  await frame(page);
  assert.deepEqual(await openShift(), ["shift5"]);
}));

test("the keys are listed by ?", () => on(SHIFT, async (page) => {
  await page.keyboard.press("?");
  assert(await page.$eval("dialog", (dialog) => dialog.open));
  await page.keyboard.press("Escape");
  assert(await page.$eval("dialog", (dialog) => !dialog.open));
}));

test("without scripts there are drawings, and on paper too", async () => {
  await on(SHIFT, async (page) => {
    assert((await page.$$eval("noscript svg", (drawings) => drawings.length)) >= 2);
    assert.equal(await page.$(".uplot"), null);
  }, { scripts: false });
  await on(SHIFT, async (page) => {
    await page.evaluate(() => dispatchEvent(new Event("beforeprint")));
    assert((await page.$$(".sheet svg")).length >= 2);
    await page.evaluate(() => dispatchEvent(new Event("afterprint")));
    assert.equal((await page.$$(".sheet")).length, 0);
  });
});

test("names of files and vehicles are text", () => on(LOG, async (page) => {
  assert.equal(await page.$("main img"), null);
  assert((await page.$eval("h1", (title) => title.textContent)).includes("<img src=x"));
  assert((await page.$eval("body", (body) => body.textContent)).includes("</script><script>alert(1)</script>"));
}));

test("titles of studies and names of runs are text", async () => {
  for (const file of [WORST, COMPARED, join(folder, "study/study.html"), join(folder, "bounds.html"), join(folder, "compare_files.html")]) {
    await on(file, async (page) => {
      assert((await page.$eval("main", (main) => main.textContent)).includes("<script>alert(1)"), file);
      assert.equal(await page.$("main script:not([type='application/json'])"), null);
    });
  }
});

test("a comparison shows differences first, then the curves of both runs, which the cursor reads", () => on(COMPARED, async (page) => {
  assert.equal(await page.$$eval("div.figure", (figures) => figures.length), 9);
  const order = await page.$$eval("main > figure, main > .scroll", (all) => all.map(({ tagName }) => tagName));
  assert.deepEqual(order.slice(0, 4), ["FIGURE", "DIV", "DIV", "FIGURE"]);
  const [whole] = await views(page);
  assert.deepEqual(whole.split(" ").map(Number), [1, 28]);
  const figure = (await page.$$("div.figure"))[1];
  await figure.scrollIntoView();
  const box = await (await figure.$(".u-over")).boundingBox();
  await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
  await frame(page);
  const read = await figure.$$eval(".panel", (panels) => panels[0].querySelectorAll("output").length);
  assert.equal(read, 2);
  const column = (n) => page.$$eval("table.sortable", (tables, n) => [...tables[1].tBodies[0].rows].map((row) => Number(row.cells[n].textContent)), n);
  const sort = async () => (await (await page.$$("table.sortable"))[1].$$("th button"))[0].click();
  await sort();
  assert.deepEqual(await column(0), Array.from({ length: 28 }, (_, at) => at + 1));
}));

test("the search for a worst case is drawn before the run that it found", () => on(WORST, async (page) => {
  const heads = await page.$$eval("main h2", (heads) => heads.map(({ textContent }) => textContent));
  assert.deepEqual(heads.slice(0, 4), ["Torque phase: search", "Torque phase: worst case", "Torque phase: parameters", "Torque phase: run it again"]);
  assert.match(await page.$eval("pre", (lines) => lines.textContent), /^wetclutch study .*worst_torque_phase\.toml.* --run 0$/);
  assert.equal((await views(page, 0)).length, 2);
}));

for (const file of PAGES) {
  test(`axe finds nothing, and no width scrolls sideways: ${file}`, async () => {
    for (const [width, scheme] of [[390, "light"], [1000, "dark"], [1920, "light"]]) {
      await on(file, async (page) => {
        await page.evaluate(readFileSync(new URL("./node_modules/axe-core/axe.min.js", import.meta.url), "utf8"));
        const found = await page.evaluate(async () => {
          const { violations } = await axe.run(document, { resultTypes: ["violations"] });
          return violations.map(({ id, nodes }) => `${id}: ${nodes.slice(0, 3).map((node) => `${node.target} ${node.failureSummary}`).join(" | ")}`);
        });
        assert.deepEqual(found, []);
        const wide = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
        assert(wide <= 0, `${width}: ${wide} pixels too wide`);
      }, { width, scheme });
    }
  });
}

test("a page of an hour has 320 shifts in five megabytes, and is there within a second", () => on(HOUR, async (page) => {
  assert(statSync(HOUR).size <= 5_000_000, String(statSync(HOUR).size));
  assert.equal(await page.$$eval("details.shift", (shifts) => shifts.length), 320);
  // Figures of closed shifts are not made.
  assert((await page.$$(".uplot")).length < 20);
  const interactive = await page.evaluate(() => performance.timing.domInteractive - performance.timing.navigationStart);
  assert(interactive <= 1000, `${interactive} ms`);
}));

test("a page of a shift takes at most 350 kB", () => assert(statSync(SHIFT).size <= 350_000, String(statSync(SHIFT).size)));
