// Opens the pages of a catalogue of stimuli from the disk, without scripts of its own, and has
// axe-core check them; .ci/site makes the catalogue.
//
//   node .ci/site.mjs MODULES SITE [PICTURES]
import { existsSync, readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join, resolve } from "node:path";

const [modules, site, pictures] = process.argv.slice(2).map((path) => path && resolve(path));
const require = createRequire(join(modules, "x.js"));
const axe = readFileSync(require.resolve("axe-core/axe.min.js"), "utf8");
const chromium = process.env.CHROMIUM ?? ["/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"].find(existsSync);
const RULES = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"];
const browser = await require("puppeteer-core").launch({ executablePath: chromium, args: ["--no-sandbox"] });
let wrong = 0;
for (const width of [320, 1200]) {
  for (const name of ["index", "by-force", "by-travel", "by-tactility"]) {
    const page = await browser.newPage();
    await page.setViewport({ width, height: 800 });
    await page.goto(`file://${site}/${name}.html`);
    const found = await page.evaluate(async () => {
      for (const image of document.images) image.loading = "eager";
      await Promise.all([...document.images].map((image) => image.decode().catch(() => {})));
      return {
        "is wider than the window": document.documentElement.scrollWidth > innerWidth,
        "has a picture that does not open": [...document.images].some((image) => image.naturalWidth === 0),
        "has no stimulus": document.querySelectorAll("article").length === 0,
      };
    });
    await page.evaluate(axe);
    const { violations } = await page.evaluate((rules) => window.axe.run({ runOnly: rules }), RULES);
    if (pictures) await page.screenshot({ path: join(pictures, `${name}-${width}.png`), fullPage: true });
    const shown = () => page.evaluate(() => [...document.querySelectorAll("article")].filter((a) => a.offsetParent).length);
    const all = await shown();
    await page.click("#feel-tactile");
    const tactile = await shown();
    const faults = Object.keys(found).filter((fault) => found[fault]);
    faults.push(...violations.map((violation) => `axe: ${violation.id}`));
    if (tactile === 0 || tactile >= all) faults.push(`shows ${tactile} of ${all} as tactile`);
    for (const fault of faults) console.error(`${name}.html at ${width} px: ${fault}`);
    wrong += faults.length;
    await page.close();
  }
}
await browser.close();
console.log(wrong ? `${wrong} faults` : "8 pages without faults");
process.exitCode = wrong ? 1 : 0;
