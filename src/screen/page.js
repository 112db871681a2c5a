"use strict";
// Shows the page that the program sends and sends back what is chosen. All texts are put
// in as text, never as markup.
(() => {
  const $ = (id) => document.getElementById(id);
  const words = document.body.dataset;
  const main = $("page");
  /** Pictures, videos and sounds, if the study has them (media.js). */
  const media = window.studyMedia ?? null;
  /** Taps within this time after a page appeared are meant for the page before, ms. */
  const UNREAD = 400;
  let page = null;      // what is shown
  let since = 0;        // when it appeared, on the page's own clock
  let busy = false;     // a reply is under way
  let fields = [];      // reads the answers of the form
  let draft = null;     // what was entered into a form that a pause hides
  let update = () => {};

  const make = (tag, props = {}, ...children) => {
    const node = Object.assign(document.createElement(tag), props);
    node.append(...children.filter((c) => c !== null && c !== ""));
    return node;
  };
  const state = (text) => { if ($("state").textContent !== text) $("state").textContent = text; };
  const sleep = (ms) => new Promise((done) => setTimeout(done, ms));
  const request = async (path, options = {}, limit = 25000) => {
    const stop = new AbortController();
    const timer = setTimeout(() => stop.abort(), limit);
    try {
      const answer = await fetch(path, { ...options, signal: stop.signal, cache: "no-store" });
      return { status: answer.status, text: await answer.text() };
    } finally { clearTimeout(timer); }
  };
  const post = (path, body, limit) => request(path, {
    method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body),
  }, limit);
  const newKey = () => {
    const bytes = crypto.getRandomValues(new Uint8Array(16));
    return Array.from(bytes, (b) => b.toString(16).padStart(2, "0")).join("");
  };

  // --- sending ---

  async function stopDevice() {
    const id = page.id;
    // Until it has arrived, or the page has nothing more to stop.
    while (page && page.id === id && page.stop) {
      try {
        const { status } = await post("/reply", { page: id, key: newKey(), shown_ms: 0, does: "stop" }, 3000);
        if (status === 200) return;
      } catch { state(words.lost); }
      await sleep(200);
    }
  }

  async function send(does, more = {}) {
    const shown = Math.round(performance.now() - since);
    if (busy || shown < UNREAD) return;
    busy = true;
    const reply = { page: page.id, key: newKey(), shown_ms: shown, does, ...more };
    const problem = document.querySelector(".problem");
    if (problem) problem.textContent = "";
    state(words.saving);
    // The same key each time: it counts once, however often it arrives.
    for (;;) {
      let answer;
      try { answer = await post("/reply", reply); } catch { answer = { status: 0 }; }
      if (answer.status === 200) {
        draft = null;
        state(does === "answer" || does === "decline" || does === "agree" || does === "refuse" ? words.saved : "");
        break;
      }
      if (answer.status === 422) {
        state("");
        complain(answer.text || words.needed);
        break;
      }
      if (answer.status === 401) { closed(); break; }
      if (answer.status === 0) state(words.lost);
      // 202: not yet on disk; 429, 503: too much at once.
      else if (![202, 429, 503].includes(answer.status)) { state(""); break; }
      await sleep(500);
    }
    busy = false;
  }

  function complain(text) {
    const problem = document.querySelector(".problem");
    if (!problem) return;
    problem.textContent = text;
    const first = main.querySelector("form input, form textarea");
    if (first) { first.setAttribute("aria-describedby", "problem"); first.focus(); }
  }

  // --- the page ---

  const button = (does, label, cls) => {
    const node = make("button", { type: "button", className: cls, textContent: label });
    node.dataset.does = does;
    node.addEventListener("click", () => send(does));
    return node;
  };

  function boxes(ask, n, heading) {
    const { boxes } = ask.field;
    const inner = boxes.slice(1, -1).some(([, label]) => label);
    const row = make("div", { className: `boxes${boxes.length <= 7 ? " few" : ""}${inner ? " named" : ""}` });
    row.style.setProperty("--count", boxes.length);
    for (const [value, label] of boxes) {
      const input = make("input", { type: "radio", name: `q${n}`, value: String(value) });
      const face = make("span", { className: "face" }, make("span", { textContent: String(value) }),
        label ? make("span", { className: inner ? "" : "sr", textContent: label }) : null);
      row.append(make("label", { className: "box" }, input, face));
    }
    const [first, last] = [boxes[0], boxes[boxes.length - 1]];
    const ends = inner || (!first[1] && !last[1]) ? null : make("p", { className: "ends" },
      make("span", { textContent: first[1] ? `${first[0]} – ${first[1]}` : "" }),
      make("span", { textContent: last[1] ? `${last[0]} – ${last[1]}` : "" }));
    if (ends) ends.setAttribute("aria-hidden", "true");
    row.dir = page.scales;
    if (ends) ends.dir = page.scales;
    const node = make("fieldset", {}, make("legend", {}, heading), row, ends);
    return [node, () => node.querySelector("input:checked")?.value ?? "",
      (value) => { const box = [...node.querySelectorAll("input")].find((i) => i.value === value); if (box) box.checked = true; }];
  }

  function choice(ask, n, heading) {
    const { options, multiple } = ask.field;
    const list = make("div", { className: "options" });
    options.forEach((option, at) => {
      const input = make("input", { type: multiple ? "checkbox" : "radio", name: `q${n}`, value: String(at) });
      list.append(make("label", { className: "box" }, input, make("span", { className: "face", textContent: option })));
    });
    const node = make("fieldset", {}, make("legend", {}, heading), list);
    return [node, () => [...node.querySelectorAll("input:checked")].map((i) => Number(i.value)),
      (chosen) => { for (const i of node.querySelectorAll("input")) i.checked = chosen.includes(Number(i.value)); }];
  }

  function slider(ask, n, heading) {
    const { from, to, step, ends, labels } = ask.field;
    const input = make("input", { type: "range", id: `q${n}`, className: "slide unset" });
    Object.assign(input, { min: from, max: to, step });
    input.value = (from + to) / 2;
    let set = false;
    const shown = make("output", { htmlFor: `q${n}` });
    const mark = () => {
      set = true;
      input.classList.remove("unset");
      input.removeAttribute("aria-valuetext");
      shown.textContent = input.value;
    };
    // Nothing is preset: a screen reader hears that an answer is missing.
    input.setAttribute("aria-valuetext", "–");
    input.addEventListener("input", mark);
    input.addEventListener("pointerup", mark);
    input.addEventListener("keydown", (e) => {
      if (!set && e.key.startsWith("Arrow")) { e.preventDefault(); mark(); }
    });
    input.dir = page.scales;
    const below = make("p", { className: "ends", dir: page.scales },
      make("span", { dir: "auto", textContent: ends[0] }), make("span", { dir: "auto", textContent: ends[1] }));
    // Labels between the ends, at their numbers: the thumb keeps half its width from the ends.
    const between = make("div", { className: "ticks", dir: page.scales });
    for (const [at, label] of labels) {
      const tick = make("span", { dir: "auto", textContent: `${at}: ${label}` });
      tick.style.setProperty("--at", (at - from) / (to - from));
      between.append(tick);
    }
    const node = make("div", {}, make("label", { className: "ask", htmlFor: `q${n}` }, heading), input,
      labels.length ? between : null, below, shown);
    return [node, () => (set ? input.value : ""), (value) => { if (value !== "") { input.value = value; mark(); } }];
  }

  function typed(ask, n, heading) {
    const text = ask.field.kind === "text";
    const input = make(text ? "textarea" : "input", { id: `q${n}`, maxLength: 4096, autocomplete: "off" });
    if (!text) Object.assign(input, { type: "text", inputMode: "decimal", maxLength: 40 });
    const unit = !text && ask.field.unit ? make("span", { id: `u${n}`, textContent: ask.field.unit }) : null;
    const hint = ask.hint ? make("p", { className: "hint", id: `h${n}`, textContent: ask.hint }) : null;
    const about = [unit && unit.id, hint && hint.id].filter(Boolean).join(" ");
    if (about) input.setAttribute("aria-describedby", about);
    const node = make("div", {}, make("label", { className: "ask", htmlFor: `q${n}` }, heading), hint,
      text ? input : make("div", { className: "number" }, input, unit));
    return [node, () => input.value, (value) => { input.value = value; }];
  }

  function form(now) {
    const node = make("form", { noValidate: true });
    fields = now.questions.map((ask, n) => {
      const prompt = n === 0 && !now.title
        ? make("span", { className: "h1", textContent: ask.prompt }) : make("span", { textContent: ask.prompt });
      const heading = n === 0 ? make("h1", { tabIndex: -1 }, prompt) : prompt;
      const whole = make("span", {}, heading, ask.optional ? make("span", { className: "optional", textContent: ` (${ask.optional})` }) : null);
      const kind = { boxes, choice, slider, number: typed, text: typed }[ask.field.kind];
      const [field, read, fill] = kind(ask, n, n === 0 && !ask.optional ? heading : whole);
      node.append(field);
      return { id: ask.id, read, fill };
    });
    const key = JSON.stringify([now.questions, now.progress, now.sheet]);
    now.questions.forEach((ask, n) => { if (ask.given !== null) fields[n].fill(ask.given); });
    if (draft && draft.key === key) for (const f of fields) f.fill(draft.values[f.id]);
    const keep = () => { draft = { key, values: answers() }; };
    for (const kind of ["input", "change", "pointerup", "keyup"]) node.addEventListener(kind, keep);
    const problem = make("p", { className: "problem", id: "problem" });
    problem.setAttribute("role", "alert");
    const save = now.buttons.find((b) => b.does === "answer");
    const row = make("div", { className: "buttons" }, make("button", { type: "submit", className: "main", textContent: save.label }));
    for (const b of now.buttons) if (b !== save) row.append(button(b.does, b.label, ""));
    node.append(problem, row);
    node.addEventListener("submit", (e) => { e.preventDefault(); send("answer", { answers: answers() }); });
    return node;
  }
  const answers = () => Object.fromEntries(fields.map((f) => [f.id, f.read()]));

  /** A question before something that cannot be undone, below the page. */
  function dialog(asked, does, withReason) {
    const open = make("button", { type: "button", className: withReason ? "quiet" : "", textContent: asked.open });
    open.setAttribute("aria-expanded", "false");
    const text = make("p", { className: "text", id: "sure", textContent: asked.title });
    const reason = make("textarea", { maxLength: 4096 });
    reason.setAttribute("aria-labelledby", "sure");
    const back = make("button", { type: "button", textContent: asked.back });
    const sure = make("button", { type: "button", textContent: asked.confirm });
    const problem = make("p", { className: "problem" });
    const box = make("div", { hidden: true, className: "dialog" }, text, withReason ? reason : null, problem, make("div", { className: "buttons" }, sure, back));
    const toggle = (on) => {
      box.hidden = !on; open.hidden = on;
      open.setAttribute("aria-expanded", String(on));
      (on ? (withReason ? reason : back) : open).focus();
    };
    open.addEventListener("click", () => toggle(true));
    back.addEventListener("click", () => toggle(false));
    sure.addEventListener("click", () => {
      if (withReason && !reason.value.trim()) { reason.focus(); return; }
      const rest = Object.fromEntries(fields.slice(1).map((f) => [f.id, f.read()]));
      send(does, withReason ? { answers: rest, reason: reason.value } : {});
    });
    return make("div", {}, open, box);
  }

  function render(now) {
    const isNew = !page || page.id !== now.id;
    page = now;
    const where = [now.progress, now.sheet].filter((part) => part);
    $("where").textContent = where.map((part) => part.words).join(" · ");
    $("bar").hidden = !(where.length && where[0].of);
    if (where.length && where[0].of) { $("bar").max = where[0].of; $("bar").value = where[0].at; }
    $("banner").textContent = now.banner ?? "";
    if (!isNew) { update(now); return; }
    since = performance.now();
    fields = [];
    const stage = media ? media.render(now.media ?? null) : null;
    // A pause or a fault hides a form; whatever can be acted on has taken its place.
    if (!now.questions.length && (now.buttons.length || now.stop)) draft = null;
    const nodes = [];
    if (!now.questions.length) {
      // A text without a title is the heading if it is short.
      const short = !now.title && now.text.length < 120;
      const [title, text] = short ? [now.text, ""] : [now.title, now.text];
      if (title) nodes.push(make("h1", { tabIndex: -1, textContent: title }));
      const body = make("p", { className: "text", textContent: text });
      if (!title) body.tabIndex = -1;
      const clock = make("p", { className: "clock", ariaHidden: "true" });
      const wait = make("p", { className: "wait" });
      wait.setAttribute("role", "timer");
      if (stage) nodes.push(stage);
      nodes.push(body, clock, wait);
      const row = make("div", { className: "buttons" });
      now.buttons.forEach((b, at) => row.append(button(b.does, b.label, at === 0 ? "main" : "")));
      if (now.buttons.length) nodes.push(row);
      update = (view) => {
        if (!short) body.textContent = view.text;
        body.hidden = !body.textContent;
        clock.textContent = view.clock ?? ""; clock.hidden = !view.clock;
        wait.textContent = view.wait ?? ""; wait.hidden = !view.wait;
        view.buttons.forEach((b, at) => { row.children[at].disabled = !b.enabled; });
      };
    } else {
      nodes.push(form(now));
      update = () => {};
    }
    if (now.refuse) nodes.push(dialog(now.refuse, "refuse", false));
    if (now.decline) nodes.push(dialog(now.decline, "decline", true));
    if (now.stop) {
      const stop = make("button", { type: "button", className: "stop", textContent: now.stop });
      // At the touch, not at its end.
      stop.addEventListener("pointerdown", stopDevice);
      stop.addEventListener("click", (e) => { if (e.detail === 0) stopDevice(); });
      nodes.push(stop);
    }
    main.replaceChildren(...nodes);
    update(now);
    const head = main.querySelector("h1") ?? main.firstElementChild;
    document.title = head ? head.textContent.split("\n")[0].slice(0, 80) : "";
    if (head) head.focus({ preventScroll: true });
    scrollTo(0, 0);
    if (stage) stage.scrollIntoView({ block: "nearest" });
  }

  function closed() {
    page = null;
    if (media) media.render(null);
    main.replaceChildren(make("h1", { tabIndex: -1, textContent: words.closed }));
    state("");
    document.title = words.closed;
  }

  document.addEventListener("keydown", (e) => {
    if (!page) return;
    const idle = e.target === document.body || e.target.tagName === "H1";
    if (page.stop && (e.key === "Escape" || (e.key === " " && idle))) {
      e.preventDefault();
      if (!e.repeat) stopDevice();
    } else if (e.key === "Enter") {
      if (e.repeat) e.preventDefault();
      else if (idle) main.querySelector(".buttons .main:not(:disabled)")?.click();
    } else if (idle && !e.repeat && (e.key === "ArrowLeft" || e.key === "ArrowRight")) {
      const does = e.key === "ArrowLeft" ? "lower" : "higher";
      main.querySelector(`.buttons [data-does="${does}"]:not(:disabled)`)?.click();
    }
  });

  (async () => {
    const token = location.hash.slice(1);
    // The link is not left in the address line, where it could be read.
    if (token) history.replaceState(null, "", "/");
    for (let opened = !token; !opened;) {
      try {
        const { status } = await post("/open", token);
        if (status === 403) break;
        opened = status === 200;
      } catch { state(words.lost); }
      if (!opened) await sleep(500);
    }
    if (media) media.begin();
    let revision = 0, lost = false;
    for (;;) {
      try {
        const { status, text } = await request(`/view?after=${revision}`);
        if (status === 401) { closed(); return; }
        if (status === 200 && text) {
          if (lost) { state(""); lost = false; }
          const now = JSON.parse(text);
          const same = now.revision === revision;
          revision = now.revision;
          if (!same) render(now);
          if (now.over) return;
          if (same) await sleep(200);
        } else await sleep(300);
      } catch {
        lost = true;
        state(words.lost);
        await sleep(700);
      }
    }
  })();
})();
