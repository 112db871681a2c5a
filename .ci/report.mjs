// Opens reports from the disk: counts their pages in print, and finds what is wider than the window, letters of figures
// that are cut off, and what axe-core finds.
//
//   node .ci/report.mjs MODULES REPORT=PAGES …
import { existsSync, readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join, resolve } from "node:path";

const [modules, ...reports] = process.argv.slice(2);
const require = createRequire(join(resolve(modules), "x.js"));
const axe = readFileSync(require.resolve("axe-core/axe.min.js"), "utf8");
const chromium = process.env.CHROMIUM ?? ["/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"].find(existsSync);
const RULES = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"];
const browser = await require("puppeteer-core").launch({ executablePath: chromium, args: ["--no-sandbox"] });
let wrong = 0;

// Texts of the pictures that are shown and reach beyond them by more than half a pixel.
const cut = () => [...document.querySelectorAll("svg")].flatMap((svg) => {
  const box = svg.getBoundingClientRect();
  if (box.width === 0) return [];
  return [...svg.querySelectorAll("text")].filter((text) => {
    const own = text.getBoundingClientRect();
    return own.width > 0 && (own.left < box.left - 0.5 || own.right > box.right + 0.5 || own.top < box.top - 0.5 || own.bottom > box.bottom + 0.5);
  }).map((text) => text.textContent);
});

for (const report of reports) {
  const [, path, most] = report.match(/^(.*)=(\d+)$/);
  const faults = [];
  const page = await browser.newPage();
  await page.goto(`file://${resolve(path)}`);
  for (const width of [320, 375, 1200]) {
    await page.setViewport({ width, height: 800 });
    if (await page.evaluate(() => document.documentElement.scrollWidth > innerWidth)) faults.push(`is wider than ${width} px`);
    for (const text of await page.evaluate(cut)) faults.push(`at ${width} px cuts off “${text}”`);
  }
  await page.evaluate(axe);
  const { violations } = await page.evaluate((rules) => window.axe.run({ runOnly: rules }), RULES);
  faults.push(...violations.map((violation) => `axe: ${violation.id}`));
  // The width between the margins of A4.
  await page.setViewport({ width: 688, height: 1000 });
  await page.emulateMediaType("print");
  for (const text of await page.evaluate(cut)) faults.push(`in print cuts off “${text}”`);
  const pdf = Buffer.from(await page.pdf({ preferCSSPageSize: true, printBackground: true })).toString("latin1");
  const pages = (pdf.match(/\/Type\s*\/Page(?!s)/g) ?? []).length;
  if (pages === 0 || pages > Number(most)) faults.push(`has ${pages} pages, and at most ${most} are wanted`);
  console.log(`${path}: ${pages} pages`);
  for (const fault of faults) console.error(`${path}: ${fault}`);
  wrong += faults.length;
  await page.close();
}
await browser.close();
console.log(wrong ? `${wrong} faults` : `${reports.length} reports without faults`);
process.exitCode = wrong ? 1 : 0;
