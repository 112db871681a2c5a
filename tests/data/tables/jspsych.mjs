// Makes jspsych-P01.csv … jspsych-P03.csv and jspsych-P03.json: what jsPsych 8 saves of an experiment with ratings on a
// slider and a two-interval forced choice by keys. jsPsych's own simulation mode answers; its answers are set below.
//
//     npm install jspsych@8.3.0 @jspsych/plugin-html-slider-response@2 @jspsych/plugin-html-keyboard-response@2 puppeteer-core@24
//     node jspsych.mjs NODE_MODULES OUT        (needs Chromium)

import fs from "node:fs";
import path from "node:path";
import { createRequire } from "node:module";

const [modules, out] = process.argv.slice(2).map((folder) => path.resolve(folder));
const puppeteer = createRequire(`${modules}/x.js`)("puppeteer-core");
const browser = await puppeteer.launch({
  executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
  args: ["--no-sandbox"],
});

for (const subject of ["P01", "P02", "P03"]) {
  const page = await browser.newPage();
  await page.setContent("<!doctype html><body></body>");
  for (const name of ["jspsych", "@jspsych/plugin-html-slider-response", "@jspsych/plugin-html-keyboard-response"]) {
    await page.addScriptTag({ path: `${modules}/${name}/dist/index.browser.min.js` });
  }
  const [csv, json] = await page.evaluate(async (subject) => {
    // A small generator with a seed (mulberry32), so that the files can be made again.
    let state = [...subject].reduce((sum, c) => sum * 31 + c.charCodeAt(0), 7);
    const random = () => {
      state = (state + 0x6d2b79f5) | 0;
      let t = Math.imul(state ^ (state >>> 15), 1 | state);
      t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
      return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
    };
    const shuffled = (list) => list.map((x) => [random(), x]).sort((a, b) => a[0] - b[0]).map((x) => x[1]);
    const rt = () => 400 + Math.round(1600 * random());
    const jsPsych = initJsPsych();
    jsPsych.data.addProperties({ subject });
    const timeline = [
      { type: jsPsychHtmlKeyboardResponse, stimulus: "Welcome. Press any key.", data: { task: "instructions" } },
    ];
    const quality = { soft: 2, medium: 3, crisp: 5, sharp: 6 };
    for (let repetition = 1; repetition <= 2; repetition++) {
      for (const texture of shuffled(Object.keys(quality))) {
        const rating = Math.min(7, Math.max(1, quality[texture] + Math.round(2 * random() - 1)));
        timeline.push({
          type: jsPsychHtmlSliderResponse,
          stimulus: `<p>How realistic was it, "${texture}"?</p>`,
          min: 1,
          max: 7,
          slider_start: 4,
          labels: ["not at all", "very"],
          data: { task: "rating", texture, repetition },
          simulation_options: { data: { response: rating, rt: rt() } },
        });
      }
    }
    const levels = shuffled([0.5, 1, 2, 4, 8].flatMap((level) => Array(8).fill(level)));
    for (const level of levels) {
      const right = random() < 0.5 ? "f" : "j";
      const knows = random() < 1 - Math.exp(-((level / 2.5) ** 2));
      const response = knows || random() < 0.5 ? right : right === "f" ? "j" : "f";
      timeline.push({
        type: jsPsychHtmlKeyboardResponse,
        stimulus: "Which had more friction, the first (f) or the second (j)?",
        choices: ["f", "j"],
        data: { task: "2afc", level, correct_key: right },
        on_finish: (data) => {
          data.correct = data.response === data.correct_key;
        },
        simulation_options: { data: { response, rt: rt() } },
      });
    }
    await jsPsych.simulate(timeline, "data-only");
    return [jsPsych.data.get().csv(), jsPsych.data.get().json()];
  }, subject);
  fs.writeFileSync(`${out}/jspsych-${subject}.csv`, csv);
  if (subject === "P03") fs.writeFileSync(`${out}/jspsych-${subject}.json`, json);
}
await browser.close();
