// Plays a session on the participant's page in headless Chromium, in three languages, two by
// touch and one by keys alone, and has axe-core check every page in light and dark for WCAG 2.2 AA.
// Then it plays one whose trials have a picture and a sound, and prints how late and how evenly they came in 200 onsets;
// a page out of sight and a slow network have to fail or to wait.
//
//   node .ci/page.mjs STUDY MODULES [PICTURES]
//
// STUDY is the program, MODULES a folder in which `npm install puppeteer-core axe-core`
// was run, PICTURES a folder for pictures of every page at six sizes. Sounds go to the system's sound device; without one
// Chromium plays them to nobody, at the same pace.
import { spawn } from "node:child_process";
import { cpSync, existsSync, mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { deflateSync } from "node:zlib";

const [study, modules, pictures] = process.argv.slice(2).map((path) => path && resolve(path));
const require = createRequire(join(modules, "x.js"));
const puppeteer = require("puppeteer-core");
const axe = require("axe-core");
const chromium = process.env.CHROMIUM ?? ["/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"].find(existsSync);
const SIZES = [[320, 568], [375, 667], [667, 375], [768, 1024], [1280, 800], [800, 1280]];
const RULES = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"];

const TEXTS = {
  en: {
    welcome: "Welcome. In this session you feel switches.\n\nTake your time.",
    prompts: ["How old are you?", "Which of these have you used?", "Your hand", "How firm did it feel?", "How pleasant was it?", "How often do you drive?", "How realistic did it feel?", "Comments"],
    labels: ["not at all realistic", "very realistic", "soft", "firm", "never", "seldom", "sometimes", "often", "always"],
    options: ["a gamepad", "a steering wheel with force feedback", "none of these"], unit: "years",
  },
  ar: {
    welcome: "مرحبًا بكم. في هذه الجلسة ستتحسسون مفاتيح.\n\nخذوا وقتكم.",
    prompts: ["كم عمرك؟", "أي من هذه الأشياء استخدمت؟", "يدك", "ما مدى صلابته؟", "ما مدى راحته؟", "كم مرة تقود السيارة؟", "ما مدى واقعيته؟", "ملاحظات"],
    labels: ["غير واقعي إطلاقًا", "واقعي جدًا", "لين", "صلب", "أبدًا", "نادرًا", "أحيانًا", "كثيرًا", "دائمًا"],
    options: ["ذراع تحكم", "عجلة قيادة", "لا شيء مما سبق"], unit: "سنة",
  },
  ja: {
    welcome: "ようこそ。この実験では、スイッチに触れていただきます。\n\nゆっくり進めてください。",
    prompts: ["年齢を入力してください。", "使ったことがあるものはどれですか。", "利き手", "どのくらい硬く感じましたか。", "どのくらい快適でしたか。", "どのくらい運転しますか。", "どのくらい本物らしく感じましたか。", "ご意見"],
    labels: ["まったく本物らしくない", "とても本物らしい", "柔らかい", "硬い", "まったくない", "まれに", "ときどき", "よく", "いつも"],
    options: ["ゲームパッド", "力覚フィードバック付きハンドル", "どれもない"], unit: "歳",
  },
};

function protocol(lang) {
  const { welcome, prompts: p, labels: l, options, unit } = TEXTS[lang];
  const s = JSON.stringify;
  const likert = l.slice(4).map((label, at) => `${at + 1} = ${s(label)}`).join(", ");
  return `format = "study-protocol/1"
[study]
id = "page"
title = "Page"
seed = 1
[text]
lang = "${lang}"
welcome = ${s(welcome)}
[consent]
document = "Information.pdf"
version = "2"
[design]
participants = 2
repetitions = 1
order = "blocked"
breaks = { every = 1, at_least_s = 2 }
[device]
kind = "simulated"
limits = { force_n = 12.0, velocity_mm_s = 1000.0 }
uncertified = { play = true, force_n = 9.0, reason = "a test" }
[trial]
reference_min_s = 2
[[models]]
id = "one"
file = "models/lambda-0.9991.toml"
[[models]]
id = "two"
file = "models/lambda-0.9993.toml"
[[intake]]
id = "age"
kind = "number"
prompt = ${s(p[0])}
unit = ${s(unit)}
min = 18
max = 99
[[intake]]
id = "used"
kind = "choice"
prompt = ${s(p[1])}
options = ${s(options)}
multiple = true
[[intake]]
id = "hand"
kind = "choice"
prompt = ${s(p[2])}
options = ["A", "B"]
[[questions]]
id = "realism"
kind = "rating"
prompt = ${s(p[6])}
from = 1
to = 7
labels = { 1 = ${s(l[0])}, 7 = ${s(l[1])} }
[[questions]]
id = "comment"
kind = "text"
prompt = ${s(p[7])}
[[questions]]
id = "firm"
kind = "slider"
prompt = ${s(p[3])}
from = 0
to = 100
step = 5
labels = { 0 = ${s(l[2])}, 20 = ${s(l[4])}, 40 = ${s(l[5])}, 60 = ${s(l[6])}, 80 = ${s(l[7])}, 100 = ${s(l[3])} }
[[questions]]
id = "pleasant"
kind = "rating"
prompt = ${s(p[4])}
from = 0
to = 10
labels = { 0 = ${s(l[2])}, 10 = ${s(l[3])} }
[[questions]]
id = "often"
kind = "rating"
prompt = ${s(p[5])}
from = 1
to = 5
labels = { ${likert} }
[analysis]
primary = "realism"
`;
}

const sleep = (ms) => new Promise((done) => setTimeout(done, ms));
let findings = 0;
const found = (what) => { findings += 1; console.error(`FOUND ${what}`); };

async function check(page, name) {
  for (const scheme of ["light", "dark"]) {
    await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: scheme }, { name: "prefers-reduced-motion", value: "reduce" }]);
    const { violations } = await page.evaluate((rules) => window.axe.run(document, { runOnly: rules }), RULES);
    for (const v of violations) found(`${name} (${scheme}): ${v.id}: ${v.help}: ${v.nodes.map((n) => n.html).join(" | ")}`);
  }
  await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: "light" }, { name: "prefers-reduced-motion", value: "reduce" }]);
  for (const [width, height] of SIZES) {
    await page.setViewport({ width, height });
    // Buttons and boxes are large enough for a finger, and nothing is wider than the page.
    const small = await page.evaluate(() => {
      const shown = (n) => n.getClientRects().length;
      const targets = [...document.querySelectorAll("button, .box, textarea, input[type=text], input[type=range]")].filter(shown);
      const bad = targets.filter((n) => { const r = n.getBoundingClientRect(); return r.width < 44 || r.height < 44; });
      const wide = document.documentElement.scrollWidth > innerWidth ? ["the page is wider than the screen"] : [];
      // No label is printed over another one, and no box of a scale is beyond the edge.
      const boxes = [...document.querySelectorAll(".box")].filter(shown).filter((n) => { const r = n.getBoundingClientRect(); return r.left < 0 || r.right > innerWidth; });
      if (boxes.length) wide.push(`${boxes.length} boxes are off the screen`);
      const ticks = [...document.querySelectorAll(".ticks span, .ends span")].filter(shown).map((n) => n.getBoundingClientRect());
      const over = (a, b) => a.left < b.right - 1 && b.left < a.right - 1 && a.top < b.bottom - 1 && b.top < a.bottom - 1;
      if (ticks.some((a, n) => ticks.slice(n + 1).some((b) => a.width && b.width && over(a, b)))) wide.push("labels overprint");
      return bad.map((n) => `${n.outerHTML.slice(0, 80)} ${n.getBoundingClientRect().width}×${n.getBoundingClientRect().height}`).concat(wide);
    });
    for (const what of small) found(`${name} at ${width}×${height}: ${what}`);
    if (pictures) await page.screenshot({ path: join(pictures, `${name}-${width}x${height}.png`) });
  }
}

/** Presses Tab until the focus is where it should be. */
async function tabTo(page, selector) {
  for (let n = 0; n < 40; n += 1) {
    if (await page.evaluate((s) => document.activeElement?.matches(s) ?? false, selector)) return;
    await page.keyboard.press("Tab");
  }
}

/** Answers the first question, with a finger or by keys alone. */
async function enter(page, fields, keyboard) {
  const first = fields.split(",")[0];
  const selector = { range: "[type=range]", text: "[type=text]", textarea: "textarea" }[first] ?? ".box input";
  if (!fields) return;
  if (keyboard) await tabTo(page, selector);
  else if (first !== "text") await page.click(first === "range" ? selector : ".box:nth-child(2)");
  else await page.click(selector);
  if (first === "text") {
    await page.keyboard.down("Control"); await page.keyboard.press("a"); await page.keyboard.up("Control");
    await page.keyboard.type("33");
  } else if (keyboard) await page.keyboard.press(first === "checkbox" ? "Space" : "ArrowDown");
}

async function play(lang, browser, keyboard) {
  const folder = mkdtempSync(join(tmpdir(), "page-"));
  cpSync("protocols/turn-signal", folder, { recursive: true });
  writeFileSync(join(folder, "protocol.toml"), protocol(lang));
  const child = spawn(study, ["run", folder, "--plain", "--screen"], { cwd: folder });
  let said = "";
  child.stdout.on("data", (data) => { said += data; });
  child.stderr.on("data", (data) => { said += data; });
  const ended = new Promise((done) => child.on("exit", done));
  child.stdin.write("P01\nx\n");
  for (let n = 0; n < 200 && !/http:\S+/.test(said); n += 1) await sleep(50);
  const link = said.match(/http:\S+/)[0];
  const context = await browser.createBrowserContext();
  const page = await context.newPage();
  page.on("console", (m) => { if (m.type() === "error" && !/favicon/.test(m.text() + (m.location().url ?? ""))) found(`${lang}: console: ${m.text()}`); });
  page.on("pageerror", (e) => found(`${lang}: ${e}`));
  await page.goto(link);
  await page.evaluate(axe.source);
  const seen = new Set();
  for (let n = 0; n < 400; n += 1) {
    await sleep(150);
    const now = await page.evaluate(() => ({
      title: document.title, fields: [...document.querySelectorAll("[type=range], textarea, [type=text], [type=radio], [type=checkbox]")].map((f) => f.type).join(),
      stop: !!document.querySelector(".stop"), dialogs: document.querySelectorAll("[aria-expanded]").length,
      main: document.querySelector(".buttons .main:not(:disabled)")?.textContent ?? null, wait: document.querySelector(".wait")?.textContent ?? "",
    }));
    const kind = `${now.title}|${now.fields}|${now.stop}|${now.main}`;
    if (!seen.has(kind) && (now.main || now.stop || now.wait)) {
      seen.add(kind);
      const name = `${lang}-${String(seen.size).padStart(2, "0")}`;
      await check(page, name);
      await page.setViewport({ width: 375, height: 667 });
      await enter(page, now.fields, keyboard);
      if (now.fields) await check(page, `${name}-chosen`);
      if (now.dialogs) {
        await page.click("[aria-expanded]");
        await check(page, `${name}-dialog`);
        await page.evaluate(() => [...document.querySelectorAll("button")].at(-1).click());
      }
      await sleep(450);
    } else if (now.fields) {
      await enter(page, now.fields, keyboard);
      await sleep(450);
    }
    if (keyboard && now.main) {
      await tabTo(page, ".buttons .main");
      await page.keyboard.press("Enter");
    } else if (now.main) await page.click(".buttons .main:not(:disabled)").catch(() => {});
    const over = await page.evaluate(async () => (await (await fetch("/view?after=0")).json()).over);
    if (over) {
      await sleep(300);
      await check(page, `${lang}-end`);
      break;
    }
  }
  child.stdin.write("\n");
  child.stdin.end();
  const code = await Promise.race([ended, sleep(20000)]);
  if (code !== 0) found(`${lang}: the session ended with ${code}: ${said}`);
  const ratings = readFileSync(join(folder, "results/page/ratings.csv"), "utf8");
  const [header, ...rows] = ratings.trim().split(/\r?\n/).map((line) => line.split(","));
  const rated = rows.filter((row) => row[header.indexOf("status")] === "ok");
  if (rows.length !== 2 || rated.length !== 2) found(`${lang}: ${ratings}`);
  await context.close();
  rmSync(folder, { recursive: true });
  return seen.size;
}

/** Onsets that are measured: half of them pictures, half of them sounds. */
const ONSETS = 200;

/** A picture of one color. */
function png(width, height, [r, g, b]) {
  const table = Array.from({ length: 256 }, (_, n) => {
    for (let k = 0; k < 8; k += 1) n = n & 1 ? 0xedb88320 ^ (n >>> 1) : n >>> 1;
    return n >>> 0;
  });
  const crc = (bytes) => (bytes.reduce((c, byte) => table[(c ^ byte) & 255] ^ (c >>> 8), 0xffffffff) ^ 0xffffffff) >>> 0;
  const chunk = (name, data) => {
    const body = Buffer.concat([Buffer.from(name), data]);
    const out = Buffer.alloc(body.length + 8);
    out.writeUInt32BE(data.length, 0);
    body.copy(out, 4);
    out.writeUInt32BE(crc(body), body.length + 4);
    return out;
  };
  const head = Buffer.alloc(13);
  head.writeUInt32BE(width, 0);
  head.writeUInt32BE(height, 4);
  head.set([8, 2, 0, 0, 0], 8);
  const line = Buffer.concat([Buffer.from([0]), ...Array.from({ length: width }, () => Buffer.from([r, g, b]))]);
  const pixels = Buffer.concat(Array.from({ length: height }, () => line));
  return Buffer.concat([Buffer.from([0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a]), chunk("IHDR", head), chunk("IDAT", deflateSync(pixels)), chunk("IEND", Buffer.alloc(0))]);
}

/** A tenth of a second of 440 Hz, mono, 16 bits. */
function wav() {
  const rate = 44100, n = rate / 10;
  const out = Buffer.alloc(44 + 2 * n);
  out.write("RIFF", 0); out.writeUInt32LE(36 + 2 * n, 4); out.write("WAVEfmt ", 8);
  out.writeUInt32LE(16, 16); out.writeUInt16LE(1, 20); out.writeUInt16LE(1, 22);
  out.writeUInt32LE(rate, 24); out.writeUInt32LE(2 * rate, 28); out.writeUInt16LE(2, 32); out.writeUInt16LE(16, 34);
  out.write("data", 36); out.writeUInt32LE(2 * n, 40);
  for (let k = 0; k < n; k += 1) out.writeInt16LE(Math.round(12000 * Math.sin(2 * Math.PI * 440 * k / rate)), 44 + 2 * k);
  return out;
}

/** The rows of a CSV, by the names of its columns. */
function table(text) {
  const cells = (line) => [...line.matchAll(/("(?:[^"]|"")*"|[^,]*)(?:,|$)/g)].map((m) => m[1].replace(/^"|"$/g, "").replaceAll('""', '"'));
  const [header, ...rows] = text.trim().split(/\r?\n/).map(cells);
  return rows.map((row) => Object.fromEntries(header.map((name, at) => [name, row[at]])));
}

function withMedia(trials) {
  const model = (id) => `[[models]]\nid = "${id}"\nfile = "models/lambda-0.9991.toml"\npicture = "media/${id}.png"\nalt = "A colored square."\nsound = "media/click.wav"\ncaption = "A click."\n`;
  return `format = "study-protocol/3"
[study]
id = "media"
title = "Media"
seed = 1
[design]
participants = 2
repetitions = ${trials / 2}
order = "blocked"
max_attempts = 50
[device]
kind = "simulated"
limits = { force_n = 12.0, velocity_mm_s = 1000.0 }
uncertified = { play = true, force_n = 9.0, reason = "a test" }
[trial]
media_within_ms = 1000
${model("one")}${model("two")}[[questions]]
id = "realism"
kind = "rating"
prompt = "How realistic did it feel?"
from = 1
to = 7
[analysis]
primary = "realism"
`;
}

/** Plays a session with a picture and a sound in each trial; prints how they came. */
async function measure(browser) {
  const folder = mkdtempSync(join(tmpdir(), "media-"));
  cpSync("protocols/turn-signal", folder, { recursive: true });
  writeFileSync(join(folder, "protocol.toml"), withMedia(ONSETS / 2));
  mkdirSync(join(folder, "media"));
  writeFileSync(join(folder, "media/one.png"), png(600, 400, [200, 40, 40]));
  writeFileSync(join(folder, "media/two.png"), png(600, 400, [40, 40, 200]));
  writeFileSync(join(folder, "media/click.wav"), wav());
  const child = spawn(study, ["run", folder, "--plain", "--screen"], { cwd: folder });
  let said = "";
  child.stdout.on("data", (data) => { said += data; });
  child.stderr.on("data", (data) => { said += data; });
  const ended = new Promise((done) => child.on("exit", done));
  child.stdin.write("P01\nx\n");
  for (let n = 0; n < 200 && !/http:\S+/.test(said); n += 1) await sleep(50);
  const context = await browser.createBrowserContext();
  const page = await context.newPage();
  page.on("console", (m) => { if (m.type() === "error" && !/favicon|ERR_ABORTED/.test(m.text() + (m.location().url ?? ""))) found(`media: console: ${m.text()}`); });
  page.on("pageerror", (e) => found(`media: ${e}`));
  await page.setViewport({ width: 768, height: 1024 });
  await page.goto(said.match(/http:\S+/)[0]);
  await page.evaluate(axe.source);
  const shown = () => page.evaluate(() => ({
    playing: !!document.querySelector(".stage img"), enabled: !!document.querySelector(".buttons .main:not(:disabled)"),
    form: !!document.querySelector("[type=radio]"), wait: document.querySelector(".wait")?.textContent ?? "",
  }));
  const until = async (what, fine) => {
    for (let n = 0; n < 600; n += 1) {
      if (fine(await shown())) return true;
      await sleep(50);
    }
    found(`media: never ${what}: ${JSON.stringify(await shown())}: ${said}`);
    return false;
  };
  // Sounds wait for a touch.
  await sleep(1500);
  const locked = await page.$eval("#state", (line) => line.textContent);
  console.log(`media: before a touch the page says: ${locked || "nothing"}`);
  await page.mouse.click(5, 5);
  await until("ready", (now) => now.enabled && !now.wait);
  await sleep(450);
  await page.click(".buttons .main");
  await until("playing", (now) => now.playing);
  await check(page, "media-playing");
  const stop = await page.evaluate(() => { const r = document.querySelector(".stop").getBoundingClientRect(); return r.top >= 0 && r.bottom <= innerHeight; });
  if (!stop) found("media: Stop is out of sight beside a picture");
  await page.setViewport({ width: 768, height: 1024 });
  // Out of sight while it plays: the attempt fails, and nothing begins until it is back.
  const sight = (state) => page.evaluate((s) => {
    Object.defineProperty(document, "visibilityState", { value: s, configurable: true });
    document.dispatchEvent(new Event("visibilitychange"));
  }, state);
  if ((await shown()).playing) await sight("hidden");
  await until("waiting out of sight", (now) => !now.playing && !now.enabled && now.wait);
  await sight("visible");
  await until("ready again", (now) => now.enabled && !now.wait);
  // A slow network: no trial begins.
  await page.emulateNetworkConditions({ download: -1, upload: -1, latency: 2500 });
  await sleep(6000);
  if ((await shown()).enabled) found("media: a trial could begin over a slow network");
  await page.emulateNetworkConditions(null);
  await until("ready after the slow network", (now) => now.enabled && !now.wait);
  // From here on the page plays by itself.
  await page.evaluate(() => {
    setInterval(() => {
      const box = document.querySelector("[type=radio]");
      if (box) box.checked = true;
      document.querySelector(".buttons .main:not(:disabled)")?.click();
    }, 60);
  });
  for (let n = 0; n < 1800; n += 1) {
    const over = await page.evaluate(async () => (await (await fetch("/view?after=0")).json()).over);
    if (over) break;
    await sleep(500);
  }
  const latency = await page.evaluate(() => { const a = new AudioContext(); return `${a.sampleRate} Hz, base ${(a.baseLatency * 1e3).toFixed(1)} ms`; });
  child.stdin.write("\n");
  child.stdin.end();
  const code = await Promise.race([ended, sleep(20000)]);
  if (code !== 0) found(`media: the session ended with ${code}: ${said}`);
  const results = join(folder, "results/media");
  const attempts = table(readFileSync(join(results, "attempts.csv"), "utf8"));
  const ratings = table(readFileSync(join(results, "ratings.csv"), "utf8"));
  const failed = attempts.filter((row) => row.what === "failure" && row.failure === "media");
  if (!failed.length) found("media: a page out of sight failed no attempt");
  let onsets = 0;
  for (const medium of ["picture", "sound"]) {
    const own = attempts.filter((row) => row.what === "media" && row.medium === medium);
    const at = own.map((row) => Number(row.media_offset_ms)).sort((a, b) => a - b);
    onsets += at.length;
    if (!at.length) continue;
    const mean = at.reduce((a, b) => a + b, 0) / at.length;
    const sd = Math.sqrt(at.reduce((a, b) => a + (b - mean) ** 2, 0) / (at.length - 1));
    const share = (p) => at[Math.min(at.length - 1, Math.floor(p * at.length))];
    const wrong = Math.max(...own.map((row) => Number(row.media_uncertainty_ms)));
    console.log(`media: ${at.length} onsets of a ${medium}: offset ${mean.toFixed(1)} ms, jitter ${sd.toFixed(1)} ms, from ${at[0].toFixed(1)} to ${at.at(-1).toFixed(1)} ms, 95 % below ${share(.95).toFixed(1)} ms; uncertainty at most ${wrong.toFixed(2)} ms`);
  }
  console.log(`media: ${failed.length} attempts failed (${[...new Set(failed.map((row) => row.text))].join("; ")}); sound: ${latency}`);
  const rated = ratings.filter((row) => row.status === "ok");
  if (onsets < ONSETS || rated.length !== ONSETS / 2) found(`media: ${onsets} onsets, ${rated.length} rated trials`);
  if (rated.some((row) => !row.media_offset_ms || !row.media_uncertainty_ms)) found("media: a rated trial has no onset");
  await context.close();
  rmSync(folder, { recursive: true });
}

if (pictures) mkdirSync(pictures, { recursive: true });
const browser = await puppeteer.launch({ executablePath: chromium, args: ["--no-sandbox"] });
for (const lang of Object.keys(TEXTS)) console.log(`${lang}: ${await play(lang, browser, lang === "ja")} pages checked`);
await measure(browser);
await browser.close();
console.log(`findings: ${findings}`);
process.exit(findings ? 1 : 0);
