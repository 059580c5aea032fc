// The page of `watch` while a log is written, in Chromium: node --test watch.mjs, with the program in PROGRAM and a log in WATCHED.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { createReadStream, readFileSync } from "node:fs";
import { createInterface } from "node:readline";
import { test } from "node:test";
import { frame, launch } from "./browser.mjs";

const { PROGRAM, WATCHED, SHOTS } = process.env;
const ROOT = new URL("../../", import.meta.url).pathname;
const { browser, end } = await launch();
test.after(end);

const wait = (ms) => new Promise((done) => setTimeout(done, ms));

// The command with the rows of the log as they come in a car, from some seconds on, `faster` than there.
async function watched(work, { from = 7, faster = 4 } = {}) {
  const command = spawn(PROGRAM, ["watch", "-", "--vehicle", `${ROOT}vehicles/eight_speed.toml`, "--serve"], { stdio: ["pipe", "pipe", "pipe"] });
  command.stdin.on("error", () => {});
  const said = createInterface({ input: command.stderr });
  const address = await new Promise((done) => said.on("line", (line) => {
    const [, found] = line.match(/^page: (http\S+)$/) ?? [];
    if (found) done(found);
  }));
  let isOver = false;
  const feed = (async () => {
    const begin = Date.now();
    let isHead = true;
    for await (const line of createInterface({ input: createReadStream(WATCHED) })) {
      if (isOver) break;
      const late = isHead ? 0 : (Number(line.split(",", 1)[0]) - from) * 1000;
      if (isHead || late >= 0) {
        const rest = late / faster - (Date.now() - begin);
        if (rest > 5) await wait(rest);
        command.stdin.write(`${line}\n`);
      }
      isHead = false;
    }
    command.stdin.end();
  })();
  const ended = new Promise((done) => command.on("close", done));
  try {
    await work(address, () => { isOver = true; return ended; });
  } finally {
    isOver = true;
    await feed;
    await ended;
  }
}

async function open(address, { width = 1280, scheme = "light" } = {}) {
  const page = await browser.newPage();
  page.unwanted = [];
  page.on("console", (message) => page.unwanted.push(message.text()));
  page.on("pageerror", (error) => page.unwanted.push(error.stack));
  page.on("request", (request) => { if (!request.url().startsWith(address)) page.unwanted.push(request.url()); });
  await page.setViewport({ width, height: 1100 });
  await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: scheme }]);
  await page.goto(address, { waitUntil: "load" });
  return page;
}

const text = (page, selector) => page.$eval(selector, (of) => of.textContent);

test("the page shows the rows as they come, holds, and says that the log has ended", { timeout: 150000 }, () => watched(async (address, finish) => {
  const page = await open(address);
  await page.waitForFunction(() => document.querySelectorAll("#shifts tbody tr").length > 1, { timeout: 60000 });
  await frame(page);
  assert.equal(await page.$$eval("#panels .uplot", (plots) => plots.length), 4);
  assert.match(await text(page, "#gear"), /^gear /);
  assert.match(await text(page, "#panels .legend"), /speed \(rad\/s\).*engine \d+\.\d/s);
  assert.match(await text(page, "#shifts tbody"), /1-2/);
  assert.equal(await page.$$eval("#elements tr", (rows) => rows.length), 5);
  await page.evaluate(readFileSync(new URL("node_modules/axe-core/axe.min.js", import.meta.url), "utf8"));
  assert.deepEqual((await page.evaluate(() => axe.run())).violations, []);
  for (const [width, scheme] of SHOTS ? [[390, "light"], [1280, "light"], [1280, "dark"]] : []) {
    await page.setViewport({ width, height: 1100 });
    await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: scheme }]);
    await wait(500);
    await page.screenshot({ path: `${SHOTS}/watch_${width}_${scheme}.png`, fullPage: true });
  }
  await page.click("#hold");
  // A redraw that had begun.
  await wait(100);
  const held = await text(page, "#time");
  await wait(300);
  assert.equal(await text(page, "#time"), held);
  await page.click("#hold");
  await page.waitForFunction((held) => document.querySelector("#time").textContent !== held, {}, held);
  const code = await finish();
  await page.waitForFunction(() => document.querySelector("#state").textContent === "the log has ended");
  assert.equal(code, 0);
  assert.deepEqual(page.unwanted, []);
}));

test("another site gets nothing", { timeout: 60000 }, () => watched(async (address, finish) => {
  const { port } = new URL(address);
  const asked = async (headers, method = "GET", path = "/") => (await fetch(`http://127.0.0.1:${port}${path}`, { method, headers })).status;
  assert.equal(await asked({}), 200);
  assert.equal(await asked({ origin: "http://evil.example" }), 403);
  assert.equal(await asked({ "sec-fetch-site": "cross-site" }), 403);
  assert.equal(await asked({}, "POST"), 405);
  assert.equal(await asked({}, "GET", "/other"), 404);
  await finish();
}));
