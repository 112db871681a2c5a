"use strict";
// Loads the pictures, videos and sounds of the study, shows and plays them beside what is felt, and says when each came.
// page.js has the page; this file is served only if the study has media.
window.studyMedia = (() => {
  const words = document.body.dataset;
  /** Between two signs of life, ms: the program counts on one every 2 s. */
  const BEAT = 500;
  /** Longest time between two signs of life that somebody has the page before the eyes, ms. */
  const ASLEEP = 2000;
  /** Of so many round trips the shortest tells how the clocks are related. */
  const TRIPS = 8;
  const tab = Array.from(crypto.getRandomValues(new Uint8Array(16)), (b) => b.toString(16).padStart(2, "0")).join("");
  const items = new Map();   // by name: a picture or video as a node, a sound as a buffer
  const trips = [];          // the last round trips: offset of the program's clock, and how long they took
  let audio = null;          // what plays sounds
  let loaded = false, broken = false, first = true, presents = true;
  let now = null;            // what is shown and played
  let beaten = performance.now();
  // The steps of the browser's clock, ms.
  const step = (() => {
    const begin = performance.now();
    let end = begin;
    while (end === begin) end = performance.now();
    return end - begin;
  })();

  const sleep = (ms) => new Promise((done) => setTimeout(done, ms));
  const post = async (path, body, options = {}) => {
    const stop = new AbortController();
    const timer = setTimeout(() => stop.abort(), ASLEEP);
    try {
      const answer = await fetch(path, {
        method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify({ tab, ...body }),
        cache: "no-store", signal: stop.signal, ...options,
      });
      return { status: answer.status, text: await answer.text() };
    } finally { clearTimeout(timer); }
  };
  /** Sends until it has arrived: a report counts once. */
  const report = async (body) => {
    for (let n = 0; n < 40; n += 1) {
      try {
        const { status } = await post("/media", body, { keepalive: true });
        if (status !== 503 && status !== 429) return;
      } catch { /* once more */ }
      await sleep(50);
    }
  };

  // --- loading ---

  async function fetched({ id, medium }) {
    const answer = await fetch(`/media/${id}`, { cache: "no-store" });
    if (!answer.ok) throw new Error(String(answer.status));
    const blob = await answer.blob();
    try {
      if (medium === "sound") {
        audio ??= new AudioContext({ latencyHint: "interactive" });
        return { medium, buffer: await audio.decodeAudioData(await blob.arrayBuffer()) };
      }
      const node = document.createElement(medium === "picture" ? "img" : "video");
      const src = URL.createObjectURL(blob);
      if (medium === "picture") {
        // With the frame in which it is put in, not some frames later.
        Object.assign(node, { src, decoding: "sync" });
        await node.decode();
      } else {
        Object.assign(node, { preload: "auto", playsInline: true, disablePictureInPicture: true });
        await new Promise((done, fail) => {
          Object.assign(node, { onloadeddata: done, onerror: fail, src });
          node.load();
        });
      }
      return { medium, node };
    } catch (e) { broken = true; throw e; }
  }

  async function load() {
    while (!loaded && !broken) {
      try {
        const list = await fetch("/media", { cache: "no-store" });
        if (!list.ok) throw new Error(String(list.status));
        // One after the other: a stop does not wait for them.
        for (const file of await list.json()) if (!items.has(file.id)) items.set(file.id, await fetched(file));
        loaded = true;
      } catch { if (!broken) await sleep(700); }
    }
    const moves = [...items.values()].some((item) => item.medium === "video");
    if (moves && matchMedia("(prefers-reduced-motion: reduce)").matches) {
      const told = document.createElement("p");
      Object.assign(told, { id: "motion", textContent: words.moving });
      document.querySelector("footer").append(told);
    }
  }
  for (const kind of ["pointerdown", "pointerup", "click", "keydown"]) document.addEventListener(kind, () => { if (audio && audio.state !== "running") audio.resume(); });

  // --- signs of life, and the clocks ---

  const state = () => {
    if (broken) return "broken";
    if (!loaded) return "loading";
    if (document.visibilityState !== "visible") return "hidden";
    if (audio && audio.state !== "running") return "locked";
    return trips.length < 3 ? "loading" : "ready";
  };
  const tell = (said) => {
    const line = document.getElementById("state");
    if (said === "locked" && line.textContent !== words.tap) line.textContent = words.tap;
    else if (said !== "locked" && line.textContent === words.tap) line.textContent = "";
  };

  async function beat() {
    const before = performance.now();
    if (before - beaten > ASLEEP) lose("asleep");
    beaten = before;
    const said = state();
    tell(said);
    try {
      const { status, text } = await post("/clock", { first, state: said });
      const after = performance.now();
      if (status === 409) { presents = false; lose("hidden"); }
      if (status !== 200) return;
      first = false;
      const { arrived_ms: arrived, left_ms: left } = JSON.parse(text);
      // Without the time in which the connection was made, where the browser tells it.
      await sleep(0);
      const timing = performance.getEntriesByName(`${location.origin}/clock`).at(-1);
      performance.clearResourceTimings();
      const known = timing && timing.requestStart >= before && timing.responseStart > timing.requestStart && timing.responseStart <= after;
      const [begin, end] = known ? [timing.requestStart, timing.responseStart] : [before, after];
      trips.push({ offset: (arrived - begin + left - end) / 2, took: Math.max(0, end - begin - (left - arrived)) });
      if (trips.length > TRIPS) trips.shift();
    } catch {
      // Answers that take so long say nothing of the clocks, and what is to be shown would come as late.
      trips.length = 0;
    }
  }

  async function begin() {
    load();
    for (;;) {
      if (!presents) return;
      const began = performance.now();
      await beat();
      const pause = trips.length < 3 ? 50 : BEAT;
      await sleep(Math.max(0, pause - (performance.now() - began)));
    }
  }

  document.addEventListener("visibilitychange", () => {
    if (document.visibilityState === "visible") { if (audio) audio.resume(); return; }
    lose("hidden");
    if (presents && !first) post("/clock", { first: false, state: "hidden" }, { keepalive: true }).catch(() => {});
  });
  addEventListener("pagehide", () => lose("hidden"));

  // --- showing and playing ---

  /** Something came at a time of the browser's clock. */
  function came(cue, medium, at) {
    if (!now || now.cue !== cue || !trips.length) return;
    const best = trips.reduce((a, b) => (b.took < a.took ? b : a));
    report({ says: "onset", cue, medium, at_ms: at + best.offset, uncertainty_ms: best.took / 2 + step });
  }

  /** What is shown and played was not, or not to the end. */
  function lose(why) {
    if (!now) return;
    const { cue } = now;
    leave();
    report({ says: "lost", cue, why });
  }

  /** Waits until a sound has left the computer, as far as the browser knows. */
  async function heard(cue, when) {
    while (now && now.cue === cue) {
      const stamp = audio.getOutputTimestamp ? audio.getOutputTimestamp() : null;
      const known = stamp && stamp.performanceTime > 0 && stamp.contextTime > 0;
      const out = known ? stamp.contextTime : audio.currentTime - (audio.outputLatency || audio.baseLatency || 0);
      const at = known ? stamp.performanceTime : performance.now();
      if (out >= when) { came(cue, "sound", at - (out - when) * 1000); return; }
      await sleep(4);
    }
  }

  function play(cue, item) {
    const source = audio.createBufferSource();
    source.buffer = item.buffer;
    source.connect(audio.destination);
    // The next block of samples.
    const when = audio.currentTime + 0.003;
    source.start(when);
    now.sources.push(source);
    heard(cue, when);
  }

  function show(cue, medium, node) {
    if (medium === "video") {
      if (node.requestVideoFrameCallback) {
        node.requestVideoFrameCallback((at, frame) => came(cue, medium, frame.expectedDisplayTime || at));
      } else {
        node.addEventListener("playing", () => requestAnimationFrame(() => requestAnimationFrame((at) => came(cue, medium, at))), { once: true });
      }
      node.play().catch(() => { if (now && now.cue === cue) lose("not-played"); });
    } else {
      // The first callback comes before the frame that has it, the second one when that frame is shown.
      requestAnimationFrame(() => requestAnimationFrame((at) => came(cue, medium, at)));
    }
  }

  /** Begins with what a page has, or ends what plays; returns what the page has to put in. */
  function render(told) {
    if (told && now && now.cue === told.cue) return now.box;
    leave();
    if (!told) return null;
    document.getElementById("motion")?.remove();
    const box = document.createElement("figure");
    box.className = "stage";
    now = { cue: told.cue, box, sources: [] };
    const media = told.media.map((one) => ({ ...one, item: items.get(one.id) }));
    if (!presents || document.visibilityState !== "visible" || media.some(({ item }) => !item)) {
      lose(presents && document.visibilityState === "visible" ? "not-played" : "hidden");
      return null;
    }
    for (const { medium, item, alt, caption } of media) {
      if (medium === "sound") play(told.cue, item);
      else {
        if (medium === "picture") item.node.alt = alt ?? "";
        else item.node.setAttribute("aria-label", alt ?? "");
        box.append(item.node);
        show(told.cue, medium, item.node);
      }
      if (caption && !box.querySelector("figcaption")) {
        const line = document.createElement("figcaption");
        line.textContent = caption;
        box.append(line);
      }
    }
    return box;
  }

  function leave() {
    if (!now) return;
    for (const source of now.sources) { try { source.stop(); } catch { /* it has ended */ } }
    for (const { medium, node } of items.values()) {
      if (medium !== "video") continue;
      node.pause();
      node.currentTime = 0;
    }
    now.box.remove();
    now = null;
  }

  return { begin, render };
})();
