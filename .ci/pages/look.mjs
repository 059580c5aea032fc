// Pictures of a page for people: node look.mjs PAGE FOLDER [#hash]
import { join } from "node:path";
import { launch, open } from "./browser.mjs";

const [file, folder, hash = ""] = process.argv.slice(2);
const { browser, end } = await launch();
for (const width of [390, 1000, 1920]) {
  for (const scheme of ["light", "dark"]) {
    const page = await open(browser, file, { width, scheme, hash });
    await page.screenshot({ path: join(folder, `${width}_${scheme}.png`), fullPage: true, captureBeyondViewport: true });
    console.log(width, scheme, ...page.unwanted);
    await page.close();
  }
}
const page = await open(browser, file, { hash });
await page.pdf({ path: join(folder, "print.pdf"), format: "A4" });
const still = await open(browser, file, { scripts: false });
await still.screenshot({ path: join(folder, "no_script.png"), fullPage: true });
await end();
