// A browser that opens files and nothing else, and what the tests ask of a page.
import assert from "node:assert/strict";
import { existsSync, mkdtempSync, readdirSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { pathToFileURL } from "node:url";
import puppeteer from "puppeteer-core";

const BROWSER = process.env.CHROMIUM ?? "/usr/bin/chromium";
const FLAGS = [
  "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
  "--disable-component-update", "--disable-sync",
];

export async function launch() {
  if (!existsSync(BROWSER)) throw new Error(`${BROWSER}: there is no browser\nhint: install Debian's chromium, or name one in CHROMIUM`);
  const profile = mkdtempSync(join(tmpdir(), "pages-"));
  const browser = await puppeteer.launch({ executablePath: BROWSER, args: FLAGS, userDataDir: profile });
  return { browser, profile, end: async () => { await browser.close(); rmSync(profile, { recursive: true, force: true }); } };
}

// A page of a file. Its messages and its requests of other addresses are kept: there must be none.
export async function open(browser, file, { width = 1000, height = 900, scheme = "light", scripts = true, hash = "" } = {}) {
  const page = await browser.newPage();
  page.unwanted = [];
  page.on("console", (message) => page.unwanted.push(`console: ${message.text()}`));
  page.on("pageerror", (error) => page.unwanted.push(`error: ${error.stack}`));
  page.on("dialog", (dialog) => { page.unwanted.push(`dialog: ${dialog.message()}`); dialog.dismiss(); });
  page.on("request", (request) => {
    if (!/^(file|blob|data):/.test(request.url())) page.unwanted.push(`request: ${request.url()}`);
  });
  await page.setViewport({ width, height });
  await page.setJavaScriptEnabled(scripts);
  await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: scheme }]);
  await page.goto(pathToFileURL(file).href + hash, { waitUntil: "load" });
  if (scripts) await frame(page);
  return page;
}

// Waits until what was asked for is drawn.
export const frame = (page) => page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));

export async function close(page) {
  assert.deepEqual(page.unwanted, [], page.url());
  await page.close();
}

// Clicks what saves a file, and gives its text.
export async function download(page, browser, selector, ending) {
  const folder = mkdtempSync(join(tmpdir(), "saved-"));
  const client = await page.createCDPSession();
  await client.send("Browser.setDownloadBehavior", { behavior: "allow", downloadPath: folder });
  await page.evaluate((selector) => document.querySelector(selector).click(), selector);
  const until = Date.now() + 5000;
  for (;;) {
    const [name] = readdirSync(folder).filter((name) => name.endsWith(ending));
    if (name) {
      const text = readFileSync(join(folder, name), "utf8");
      rmSync(folder, { recursive: true });
      return text;
    }
    assert(Date.now() < until, `no .${ending} was saved`);
    await new Promise((done) => setTimeout(done, 20));
  }
}
