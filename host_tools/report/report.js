/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* Draws the report from the data in the page. No library, no network. Everything that came from a file enters the page as
 * text (textContent), never as markup. */
"use strict";
(() => {
const $ = (id) => document.getElementById(id);
const data = JSON.parse($("data").textContent);

/* What the page has drawn, for tests and the curious: an element that nobody sees. */
const status = { ready: false, errors: [], theme: "", plots: {}, pictures: 0, span: {} };
const tell = () => { $("status").textContent = JSON.stringify(status); };
const complain = (what) => { status.errors.push(String(what)); tell(); };
window.addEventListener("error", (e) => complain(e.message));
window.addEventListener("unhandledrejection", (e) => complain(e.reason));
document.addEventListener("securitypolicyviolation", (e) => complain("blocked: " + e.blockedURI));

function make(name, attributes, ...children) {
  const e = document.createElement(name);
  for (const [key, value] of Object.entries(attributes || {})) { e.setAttribute(key, value); }
  e.append(...children);
  return e;
}
function svg(name, attributes, text) {
  const e = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) { e.setAttribute(key, value); }
  if (text !== undefined) { e.textContent = text; }
  return e;
}

/* --- numbers ------------------------------------------------------------------------------------------------------ */

const MINUS = "\u2212";
const THIN = "\u202f";
function digits(x, n) { /* n significant digits, no exponent, a true minus sign, thin spaces between thousands */
  if (!Number.isFinite(x)) { return "\u2013"; }
  const a = Math.abs(x);
  const decimals = a === 0 ? 0 : Math.max(0, n - 1 - Math.floor(Math.log10(a)));
  const [whole, rest] = a.toFixed(Math.min(decimals, 9)).split(".");
  const grouped = whole.length > 4 ? whole.replace(/\B(?=(\d{3})+$)/g, THIN) : whole;
  return (x < 0 ? MINUS : "") + grouped + (rest ? "." + rest : "");
}
const count = (n) => String(n).replace(/\B(?=(\d{3})+$)/g, THIN);
function short(x) { /* 1.2 M */
  const a = Math.abs(x);
  if (a >= 1e9) { return digits(x / 1e9, 3) + THIN + "G"; }
  if (a >= 1e6) { return digits(x / 1e6, 3) + THIN + "M"; }
  if (a >= 1e4) { return digits(x / 1e3, 3) + THIN + "k"; }
  return digits(x, 3);
}
function seconds(s) {
  if (s < 0.9995) { return digits(s * 1e3, 3) + " ms"; }
  if (s < 120) { return digits(s, 4) + " s"; }
  return Math.floor(s / 60) + " min " + Math.round(s % 60) + " s";
}
function percent(part, whole) {
  const p = whole > 0 ? 100 * part / whole : 0;
  return p > 0 && p < 0.1 ? "<" + THIN + "0.1" + THIN + "%" : p.toFixed(p < 10 ? 1 : 0) + THIN + "%";
}
function gain(pair) { return pair[0] > 0 ? pair[1] / pair[0] : NaN; }

/* --- theme -------------------------------------------------------------------------------------------------------- */

const repaint = []; /* What has to be drawn again when colours change. */
const prefersDark = window.matchMedia("(prefers-color-scheme: dark)");
let theme = prefersDark.matches ? "dark" : "light";
let chosen = false;
function apply() {
  document.documentElement.dataset.theme = theme;
  $("theme").textContent = theme === "dark" ? "Light theme" : "Dark theme";
  $("theme").setAttribute("aria-pressed", String(theme === "dark"));
  status.theme = theme;
  for (const f of repaint) { f(); }
  tell();
}
$("theme").addEventListener("click", () => { theme = theme === "dark" ? "light" : "dark"; chosen = true; apply(); });
prefersDark.addEventListener("change", () => { if (!chosen) { theme = prefersDark.matches ? "dark" : "light"; apply(); } });
document.documentElement.dataset.theme = theme;

function rgb(name) { /* A colour of the style sheet as three numbers. */
  const hex = getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  return [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16));
}
const blend = (a, b, t) => a.map((v, i) => Math.round(v + (b[i] - v) * t));
const pack = (c) => (0xff000000 | (c[2] << 16) | (c[1] << 8) | c[0]) >>> 0; /* As ImageData holds it, little endian. */

/* The grey values of a PNG in base64. */
async function decode(base64) {
  const image = new Image();
  image.src = "data:image/png;base64," + base64;
  await image.decode();
  const c = document.createElement("canvas");
  c.width = image.naturalWidth;
  c.height = image.naturalHeight;
  const context = c.getContext("2d", { willReadFrequently: true });
  context.drawImage(image, 0, 0);
  const rgba = context.getImageData(0, 0, c.width, c.height).data;
  const grey = new Uint8Array(c.width * c.height);
  for (let i = 0; i < grey.length; i++) { grey[i] = rgba[4 * i]; }
  return { width: c.width, height: c.height, grey };
}

/* --- head --------------------------------------------------------------------------------------------------------- */

const summary = data.summary;
const numbers = data.numbers;
const settings = summary.settings;
const hasRotation = settings.attitude !== "none" && numbers.rate_deg_s !== undefined;

function head() {
  const c = settings.camera;
  $("lead").textContent = [c.width_px + "\u00d7" + c.height_px + " px", seconds(data.duration_s),
    count(summary.events.in) + " events", count(summary.windows) + " windows",
    count(summary.saccades) + (summary.saccades === 1 ? " saccade" : " saccades")].join(" \u00b7 ");
  if (summary.failure) {
    $("failure").textContent = "The run ended early: " + summary.failure;
    $("failure").hidden = false;
  }
}

function card(what, value, unit, more) {
  const v = make("div", { class: "value" }, value);
  if (unit) { v.append(" ", make("small", {}, unit)); }
  $("cards").append(make("li", {}, make("div", { class: "what" }, what), v, make("div", { class: "more" }, more)));
}

function cards() {
  const g = gain(numbers.spans_sharpness);
  const spans = numbers.spans === 1 ? "over the whole recording" : "mean of " + count(numbers.spans) + " spans of up to 120 ms";
  card("Sharpness gain", "\u00d7" + THIN + (Number.isFinite(g) ? g.toFixed(2) : "\u2013"), "",
    digits(numbers.spans_sharpness[0], 3) + " \u2192 " + digits(numbers.spans_sharpness[1], 3) + ", " + spans);
  if (hasRotation) {
    card("Rotation removed", digits(numbers.rate_deg_s[0], 3), "\u00b0/s", "mean; peak " + digits(numbers.rate_deg_s[1], 3) + " \u00b0/s");
    card("Smear without it", digits(numbers.motion_px_s[0] * 0.02, 3), "px", "in 20 ms at the image centre; peak " +
      digits(numbers.motion_px_s[1] * 0.02, 3) + " px");
  } else {
    card("Rotation removed", "none", "", "no orientation was given: the events are only undistorted");
  }
  card("Time in the library", digits(summary.library_ns_per_event, 3), "ns/event", short(1e9 / summary.library_ns_per_event) +
    " events/s on one core");
}

/* --- before and after --------------------------------------------------------------------------------------------- */

async function beforeAndAfter() {
  const s = data.span;
  if (!s) { return; }
  const [before, after] = await Promise.all([decode(s.before), decode(s.after)]);
  /* One scale for both: the brightest half percent of the stabilized pixels is full ink. */
  const histogram = new Array(256).fill(0);
  let hit = 0;
  for (const v of after.grey) { if (v > 0) { histogram[v]++; hit++; } }
  let top = 255;
  for (let above = 0; top > 4 && above + histogram[top] <= hit * 0.005; top--) { above += histogram[top]; }
  const paint = (id, picture) => {
    const canvas = $(id);
    canvas.width = picture.width;
    canvas.height = picture.height;
    const context = canvas.getContext("2d");
    const image = context.createImageData(picture.width, picture.height);
    const words = new Uint32Array(image.data.buffer);
    const ground = rgb("--picture");
    const ink = rgb("--count");
    const shade = Array.from({ length: 256 }, (_, v) => pack(blend(ground, ink, Math.min(1, Math.pow(v / top, 0.5)))));
    for (let i = 0; i < words.length; i++) { words[i] = shade[picture.grey[i]]; }
    context.putImageData(image, 0, 0);
  };
  const both = () => { paint("before", before); paint("after", after); };
  both();
  repaint.push(both);
  status.span = { before: before.grey.filter((v) => v > 0).length, after: hit };

  const span = seconds(s.to_s - s.from_s);
  const g = gain(s.sharpness);
  const why = numbers.spans === 1 ? "The whole recording," : s.shaken ? "The span (of 30 ms at least) in which the camera turned fastest," : "The span with most events";
  const rate = hasRotation ? " at " + digits(s.rate_deg_s, 3) + " \u00b0/s (" + digits(s.motion_px_s, 3) + " px/s at the image centre)" : "";
  $("before").setAttribute("aria-label", "Picture of " + count(s.n_events) + " raw events, sharpness " + digits(s.sharpness[0], 3));
  $("after").setAttribute("aria-label", "The same events stabilized, sharpness " + digits(s.sharpness[1], 3));
  $("span-caption").textContent = why + rate + ": " + count(s.n_events) + " events in " + span + ", from " + digits(s.from_s, 4) +
    " s after the first event. Sharpness " + digits(s.sharpness[0], 3) + " raw, " + digits(s.sharpness[1], 3) + " stabilized (\u00d7" +
    g.toFixed(2) + "): variance over the sensor of the picture of events, blurred by 1 px. Both pictures have one scale of ink.";

  const box = $("compare");
  const slider = $("split");
  const show = () => {
    box.style.setProperty("--split", slider.value + "%");
    slider.setAttribute("aria-valuetext", slider.value + " % raw, " + (100 - slider.value) + " % stabilized");
  };
  const drag = (e) => {
    const r = box.getBoundingClientRect();
    slider.value = String(Math.round(100 * (e.clientX - r.left) / r.width));
    show();
  };
  slider.addEventListener("input", show);
  box.addEventListener("pointerdown", (e) => { box.setPointerCapture(e.pointerId); slider.focus({ preventScroll: true }); drag(e); e.preventDefault(); });
  box.addEventListener("pointermove", (e) => { if (box.hasPointerCapture(e.pointerId)) { drag(e); } });
  show();
  $("span").hidden = false;
}

/* --- animation ---------------------------------------------------------------------------------------------------- */

/* A cell comes as 2 bits of brighter and 2 bits of darker events (0, 1, 2, more), spread over the greys of a PNG of 4 bits;
 * here it is a byte, brighter events in the low half, darker ones in the high half, so that cells can be summed. */
async function decodePicture(base64) {
  const picture = await decode(base64);
  const COUNT = [0, 1, 2, 4];
  picture.grey.forEach((v, i) => { if (v !== 0) { picture.grey[i] = COUNT[(v / 17) & 3] | (COUNT[(v / 17) >> 2] << 4); } });
  return picture;
}

function pictureColours() {
  const ground = rgb("--picture");
  const brighter = rgb("--brighter");
  const darker = rgb("--darker");
  const table = new Uint32Array(256);
  for (let v = 0; v < 256; v++) {
    const b = v & 15;
    const d = v >> 4;
    table[v] = pack(b + d === 0 ? ground : blend(ground, blend(darker, brighter, b / (b + d)), 1 - Math.pow(0.58, b + d)));
  }
  return table;
}

function sumUp(pictures, last, n) { /* Of n pictures up to `last`, 15 at most. */
  const first = Math.max(0, last - n + 1);
  if (first === last) { return pictures[last].grey; }
  const sum = new Uint8Array(pictures[last].grey);
  for (let k = first; k < last; k++) {
    const more = pictures[k].grey;
    for (let i = 0; i < sum.length; i++) {
      if (more[i] !== 0) {
        sum[i] = Math.min(15, (sum[i] & 15) + (more[i] & 15)) | (Math.min(15, (sum[i] >> 4) + (more[i] >> 4)) << 4);
      }
    }
  }
  return sum;
}

function paintPane(id, cells, stride, left, top, width, height, table) {
  const canvas = $(id);
  if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
  const context = canvas.getContext("2d");
  const image = context.createImageData(width, height);
  const words = new Uint32Array(image.data.buffer);
  for (let y = 0; y < height; y++) {
    const from = (top + y) * stride + left;
    for (let x = 0; x < width; x++) { words[y * width + x] = table[cells[from + x]]; }
  }
  context.putImageData(image, 0, 0);
  return context;
}

async function animation() {
  const clip = data.clip;
  if (!clip) { return; }
  const pictures = await Promise.all(clip.pictures.map(decodePicture));
  const w = clip.width;
  const h = clip.height;
  const n = pictures.length;
  const length_s = n * clip.picture_s;
  const calm = window.matchMedia("(prefers-reduced-motion: reduce)").matches;
  let at = 0;
  let playing = false;
  let due = 0;
  let table = pictureColours();
  status.pictures = n;

  for (let k = 0; k <= 7; k++) {
    $("speed").append(make("option", { value: String(Math.pow(2, -k)) }, k === 0 ? "real" : "1/" + Math.pow(2, k)));
  }
  $("speed").value = String(Math.pow(2, -Math.min(7, Math.max(0, Math.round(Math.log2(4 / length_s))))));
  const exposures = [2, 5, 10, 20, 40, 80].map((ms) => Math.max(1, Math.round(ms * 1e-3 / clip.picture_s)));
  for (const m of [...new Set(exposures)].filter((k) => k <= n)) {
    $("exposure").append(make("option", { value: String(m) }, digits(m * clip.picture_s * 1e3, 2) + " ms"));
  }
  $("exposure").value = String(exposures[3]);

  const draw = () => {
    const cells = sumUp(pictures, at, Number($("exposure").value) || 1);
    paintPane("pane-raw", cells, 3 * w, 0, 0, w, h, table);
    paintPane("pane-stab", cells, 3 * w, w + (w >> 1), h >> 1, w, h, table);
    const canvas = paintPane("pane-canvas", cells, 3 * w, w, 0, 2 * w, 2 * h, table);
    canvas.strokeStyle = "rgba(128,128,128,0.6)"; /* Where the stabilized pane lies. */
    canvas.setLineDash([4, 4]);
    canvas.strokeRect((w >> 1) - 0.5, (h >> 1) - 0.5, w + 1, h + 1);
    $("seek").value = String(at);
    const now = clip.from_s + (at + 1) * clip.picture_s;
    $("clock").textContent = now.toFixed(clip.picture_s < 0.01 ? 4 : 2) + " s";
    $("seek").setAttribute("aria-valuetext", $("clock").textContent);
  };
  const step = (time) => {
    if (!playing) { return; }
    const period = Math.max(33, 1e3 * clip.picture_s / Number($("speed").value)); /* ms on the screen per step */
    const skip = Math.max(1, Math.round(33 * Number($("speed").value) / (1e3 * clip.picture_s)));
    if (time >= due) {
      at = (at + skip) % n;
      due = Math.max(due + period, time - period);
      draw();
    }
    window.requestAnimationFrame(step);
  };
  const play = (on) => {
    playing = on;
    $("play").classList.toggle("playing", on);
    $("play").setAttribute("aria-label", on ? "Pause" : "Play");
    if (on) { due = performance.now(); window.requestAnimationFrame(step); }
  };
  $("seek").max = String(n - 1);
  $("seek").addEventListener("input", () => { play(false); at = Number($("seek").value); draw(); });
  $("play").addEventListener("click", () => play(!playing));
  $("exposure").addEventListener("change", draw);
  repaint.push(() => { table = pictureColours(); draw(); });

  const rate = hasRotation && length_s < data.duration_s * 0.9 && clip.rate_deg_s > 0.5 ? "The " + seconds(length_s) + " in which the camera turned fastest (" + digits(clip.rate_deg_s, 3) + " \u00b0/s in the mean). " : "";
  $("clip-caption").textContent = rate + "Blue: it got brighter; orange: darker. The dashed frame on the canvas is the stabilized pane" +
    (clip.bin > 1 ? "; " + clip.bin + "\u00d7" + clip.bin + " pixels of the sensor make one of a pane" : "") + ".";
  $("clip").hidden = false;
  at = Math.min(n - 1, Math.max(Number($("exposure").value), n >> 1)); /* A full picture, where nothing moves by itself. */
  draw();
  if (!calm && "IntersectionObserver" in window) { /* Runs while it is seen, until the reader takes over. */
    let automatic = true;
    for (const id of ["seek", "play"]) { $(id).addEventListener("pointerdown", () => { automatic = false; }); $(id).addEventListener("keydown", () => { automatic = false; }); }
    new IntersectionObserver((entries) => { if (automatic) { play(entries[0].isIntersecting); } }).observe($("pane-canvas"));
  }
}

/* --- plots -------------------------------------------------------------------------------------------------------- */

function niceStep(range, n) {
  const rough = range / Math.max(1, n);
  const power = Math.pow(10, Math.floor(Math.log10(rough)));
  return [1, 2, 5, 10].map((m) => m * power).find((s) => s >= rough * 0.999);
}
function ticks(low, high, n) {
  const step = niceStep(high - low, n);
  const list = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + step * 1e-9; i++) { list.push(i * step); }
  return { list, decimals: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)), step };
}
function range(plot) {
  let low = Infinity;
  let high = -Infinity;
  for (const c of plot.curves) {
    for (let i = 1; i < c.points.length; i += 2) { low = Math.min(low, c.points[i]); high = Math.max(high, c.points[i]); }
  }
  if (plot.base !== undefined) { low = Math.min(low, plot.base); high = Math.max(high, plot.base); }
  if (plot.curves[0].fill || plot.id === "window") { low = Math.min(low, 0); }
  if (high - low < 1e-9 * Math.max(1, Math.abs(high))) { low -= 1; high += 1; }
  const margin = 0.05 * (high - low);
  return [low === 0 ? 0 : low - margin, high + margin];
}
function tickText(v, t) {
  const k = t.step >= 5e5 ? 1e6 : t.step >= 500 ? 1e3 : 1;
  if (k > 1) { return v === 0 ? "0" : String(Number((v / k).toPrecision(4))) + THIN + (k === 1e6 ? "M" : "k"); }
  const text = Math.abs(v).toFixed(t.decimals);
  return (v < 0 && Number(text) !== 0 ? MINUS : "") + text;
}
const COLOURS = { 1: ["c-one"], 3: ["c-x", "c-y", "c-z"] };

function nearest(points, t) { /* The value of the last point at or before t, or of the first. */
  let a = 0;
  let b = points.length / 2 - 1;
  while (a < b) {
    const m = (a + b + 1) >> 1;
    if (points[2 * m] <= t) { a = m; } else { b = m - 1; }
  }
  return points[2 * a + 1];
}

const cursors = []; /* One per plot: all show the same moment. */

function plot(p) {
  const classes = COLOURS[p.curves.length] || COLOURS[3];
  const keys = p.curves.map(() => make("b", {}));
  const key = make("div", { class: "key" });
  if (p.curves.length === 1) { key.append(keys[0]); }
  else { p.curves.forEach((c, i) => key.append(make("span", {}, make("i", { class: classes[i] }), c.name + " ", keys[i]))); }
  if (p.id === "attitude" && data.saccades.n > 0) { key.append(make("span", {}, make("i", { class: "c-mark" }), "saccade")); }
  const name = make("span", { class: "name" }, p.title + " ", make("small", {}, "in " + p.unit));
  if (p.base !== undefined) { name.lastChild.textContent = p.unit; }
  const box = make("div", { class: "plot" }, make("div", { class: "head" }, name, key));
  $("plots").append(box);
  const [low, high] = range(p);
  const [from, to] = [0, Math.max(data.duration_s, 1e-6)];
  let n = 0;
  for (const c of p.curves) { n += c.points.length / 2; }
  status.plots[p.id] = n;
  const spoken = p.curves.map((c) => {
    let a = Infinity;
    let b = -Infinity;
    for (let i = 1; i < c.points.length; i += 2) { a = Math.min(a, c.points[i]); b = Math.max(b, c.points[i]); }
    return c.name + " from " + short(a) + " to " + short(b);
  }).join("; ");

  const draw = () => {
    const width = Math.max(240, Math.floor(box.clientWidth));
    const height = p.curves.length > 1 ? 170 : 130;
    const edge = { left: 52, right: 8, top: 8, bottom: 34 };
    const X = (t) => edge.left + (t - from) / (to - from) * (width - edge.left - edge.right);
    const Y = (v) => height - edge.bottom - (v - low) / (high - low) * (height - edge.top - edge.bottom);
    const ms = to < 1;
    const s = svg("svg", { viewBox: "0 0 " + width + " " + height, height, role: "img", "aria-label": p.title + " over time, in " + p.unit + ": " + spoken });
    const ty = ticks(low, high, 5);
    for (const v of ty.list) {
      s.append(svg("line", { x1: edge.left, x2: width - edge.right, y1: Y(v), y2: Y(v), class: "gridline" }));
      s.append(svg("text", { x: edge.left - 7, y: Y(v) + 4, "text-anchor": "end" }, tickText(v, ty)));
    }
    const tx = ticks(from * (ms ? 1e3 : 1), to * (ms ? 1e3 : 1), width / 60);
    for (const v of tx.list) {
      const x = X(v / (ms ? 1e3 : 1));
      s.append(svg("line", { x1: x, x2: x, y1: height - edge.bottom, y2: height - edge.bottom + 4, class: "axis" }));
      s.append(svg("text", { x, y: height - edge.bottom + 17, "text-anchor": "middle" }, tickText(v, tx)));
    }
    s.append(svg("text", { x: width - edge.right, y: height - 3, "text-anchor": "end" }, "time since the first event in " + (ms ? "ms" : "s")));
    s.append(svg("line", { x1: edge.left, x2: width - edge.right, y1: height - edge.bottom, y2: height - edge.bottom, class: "axis" }));
    if (p.base !== undefined) { s.append(svg("line", { x1: edge.left, x2: width - edge.right, y1: Y(p.base), y2: Y(p.base), class: "axis" })); }
    for (const t of data.saccades.t) { s.append(svg("line", { x1: X(t), x2: X(t), y1: edge.top, y2: height - edge.bottom, class: "saccade" })); }
    p.curves.forEach((c, i) => {
      let path = "";
      for (let k = 0; k < c.points.length; k += 2) {
        path += (k === 0 ? "M" : "L") + X(c.points[k]).toFixed(1) + " " + Y(c.points[k + 1]).toFixed(1);
      }
      if (c.fill) {
        const end = c.points.length - 2;
        s.append(svg("path", { d: path + "L" + X(c.points[end]).toFixed(1) + " " + Y(low) + "L" + X(c.points[0]).toFixed(1) + " " + Y(low) + "Z",
          fill: "currentColor", "fill-opacity": "0.15", class: classes[i] }));
      }
      s.append(svg("path", { d: path, stroke: "currentColor", class: "curve " + classes[i] }));
      for (let k = 0; c.points.length <= 2 * 100 && k < c.points.length; k += 2) { /* Few points are seen one by one. */
        s.append(svg("circle", { cx: X(c.points[k]).toFixed(1), cy: Y(c.points[k + 1]).toFixed(1), r: 2, class: "dot " + classes[i] }));
      }
    });
    const cursor = svg("line", { y1: edge.top, y2: height - edge.bottom, class: "cursor", visibility: "hidden" });
    s.append(cursor);
    s.addEventListener("pointermove", (e) => {
      const x = (e.clientX - s.getBoundingClientRect().left) * width / s.getBoundingClientRect().width;
      const t = from + (x - edge.left) / (width - edge.left - edge.right) * (to - from);
      for (const f of cursors) { f(Math.min(to, Math.max(from, t))); }
    });
    s.addEventListener("pointerleave", () => { for (const f of cursors) { f(null); } });
    const old = box.querySelector("svg");
    if (old) { old.replaceWith(s); } else { box.append(s); }
    box.showAt = (t) => {
      cursor.setAttribute("visibility", t === null ? "hidden" : "visible");
      if (t !== null) { cursor.setAttribute("x1", X(t)); cursor.setAttribute("x2", X(t)); }
      p.curves.forEach((c, i) => { keys[i].textContent = t === null ? "" : short(nearest(c.points, t)); });
    };
  };
  draw();
  cursors.push((t) => box.showAt(t));
  let last = box.clientWidth;
  new ResizeObserver(() => { if (box.clientWidth !== last) { last = box.clientWidth; draw(); } }).observe(box);
}

function plots() {
  const drawn = data.plots.filter((p) => p.curves.every((c) => c.points.length > 0));
  if (drawn.length === 0) { return; }
  $("time").hidden = false;
  drawn.forEach(plot);
  const left = data.saccades.n - data.saccades.t.length;
  if (left > 0) { $("plots").append(make("p", { class: "note" }, count(left) + " later saccades are not marked.")); }
  if (numbers.windows_measured < numbers.windows) {
    $("plots").append(make("p", { class: "note" }, "The sharpness of " + count(numbers.windows_measured) + " of " + count(numbers.windows) +
      " windows was measured: of all would take longer than the replay itself."));
  }
}

/* --- tables ------------------------------------------------------------------------------------------------------- */

const WORDS = {
  no_undistorted_position: "no position under the lens model",
  no_orientation: "no orientation at that time",
  rotated_out_of_range: "rotated out of the range of a point, or behind the camera",
};
const plain = (key) => WORDS[key] || key.replace(/_/g, " ");

/* "slice_max_us", 1000 as "slice max", "1000 us". */
const UNITS = { us: " \u00b5s", px: " px", s: " s" };
function setting(key, value) {
  const at = key.lastIndexOf("_");
  const unit = UNITS[key.slice(at + 1)];
  if (key === "saccade_px" && value === 0) { return ["saccade", "off"]; }
  if (typeof value === "boolean") { return [plain(key), value ? "yes" : "no"]; }
  if (Array.isArray(value)) { return [plain(key), value.map((v) => digits(v, 6)).join(", ")]; }
  return unit === undefined || typeof value !== "number" ? [plain(key), String(value)] : [plain(key.slice(0, at)), String(value) + unit];
}

function eventTable() {
  const e = summary.events;
  const rows = [["read from the file", e.in, false]];
  const add = (text, n) => { if (n > 0) { rows.push([text, n, true]); } };
  add("before --from", e.before_from);
  add("after --to", e.after_to);
  for (const [key, n] of Object.entries(e.bad)) { add("skipped: " + plain(key), n); }
  add("dropped by the library: time ran back", e.time_back_in_library);
  for (const [key, n] of Object.entries(e.outside)) { add("kept without a position: " + plain(key), n); }
  rows.push(["stabilized", e.kept, false]);
  const table = make("table", {}, make("caption", { hidden: "" }, "Events by what became of them"));
  for (const [text, n, bad] of rows) {
    const bar = make("span", bad ? { class: "bad" } : {});
    bar.style.width = (e.in > 0 ? 100 * n / e.in : 0) + "%";
    table.append(make("tr", {}, make("th", { scope: "row" }, text), make("td", { class: "number" }, count(n)),
      make("td", { class: "number" }, percent(n, e.in)), make("td", { class: "share", "aria-hidden": "true" }, bar)));
  }
  $("events").append(table);
  const dropped = rows.some((r) => r[2]);
  const a = summary.attitude || {};
  const faults = [];
  for (const [key, n] of Object.entries(a.bad || {})) { if (n > 0) { faults.push(count(n) + " skipped: " + plain(key)); } }
  for (const key of ["gyro_saturated", "gyro_spikes", "gyro_gaps", "accel_left_out", "mag_left_out"]) { if (a[key] > 0) { faults.push(count(a[key]) + " " + plain(key)); } }
  $("events").append(make("p", { class: "note" }, (dropped ? "" : "Nothing was dropped. ") + (a.samples > 0 ? "Orientation: " + count(a.samples) + " samples, " +
    (faults.length > 0 ? faults.join(", ") : "nothing wrong with any") + "." : "No orientation samples.")));
  status.events = rows.length;
}

function settingsTable() {
  const table = make("table", { class: "settings" }, make("caption", { hidden: "" }, "Settings of this run"));
  const row = (name, value) => table.append(make("tr", {}, make("th", { scope: "row" }, name), make("td", {}, value)));
  for (const [key, value] of Object.entries(settings)) {
    if (value === null || key === "camera") { continue; }
    row(...setting(key, value));
  }
  const c = settings.camera;
  row("lens", c.model + ", focal length " + digits(c.fx_px, 5) + " \u00d7 " + digits(c.fy_px, 5) + " px, centre " + digits(c.cx_px, 5) + ", " +
    digits(c.cy_px, 5) + " px, distortion " + c.distortion.map((v) => digits(v, 4)).join(", "));
  row("time of the replay", seconds(summary.wall_s) + ", " + digits(summary.ns_per_event, 3) + " ns/event with all files, " +
    digits(summary.library_ns_per_event, 3) + " ns/event in the library");
  $("settings").append(table);
  $("footer").textContent = "Written by evstab " + data.version + ". This page needs no network.";
}

head();
cards();
plots();
eventTable();
settingsTable();
Promise.all([beforeAndAfter(), animation()]).then(() => {
  apply();
  status.resources = performance.getEntriesByType("resource").filter((r) => !r.name.startsWith("data:")).length;
  status.ready = true;
  tell();
}).catch(complain);
})();
