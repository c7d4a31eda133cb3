/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* Curves over time as SVG. A plot that the data do not hold is not there. */
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
    for (let i = 1; i < c.points.length; i += 2) {
      const spread = c.spread ? c.spread[(i - 1) / 2] : 0;
      low = Math.min(low, c.points[i] - spread);
      high = Math.max(high, c.points[i] + spread);
    }
  }
  if (plot.base !== undefined) { low = Math.min(low, plot.base); high = Math.max(high, plot.base); }
  if (plot.curves[0].spread) { [low, high] = [Math.max(low, -1.05), Math.min(high, 1.05)]; } /* Of unit vectors. */
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

/* What the plot is, what its colours mean, and the values under the cursor. */
function plotHead(p, classes, values) {
  const unit = make("small", {}, (p.base === undefined ? "in " : "") + p.unit);
  const name = make("span", { class: "name" }, p.title + " ", unit);
  const key = make("div", { class: "key" });
  p.curves.forEach((c, i) => {
    if (p.curves.length === 1) { key.append(values[i]); return; }
    key.append(make("span", {}, make("i", { class: classes[i] }), c.name + " ", values[i]));
  });
  if (p.curves[0].truth) {
    key.append(make("span", {}, make("i", { class: "dashed" }), "truth"));
  }
  if (p.id === "attitude" && data.saccades.n > 0) {
    key.append(make("span", {}, make("i", { class: "c-mark" }), "saccade"));
  }
  return make("div", { class: "head" }, name, key);
}

function spoken(p) {
  const curves = p.curves.map((c) => {
    const values = c.points.filter((_, i) => i % 2 === 1);
    const low = values.reduce((a, b) => Math.min(a, b));
    const high = values.reduce((a, b) => Math.max(a, b));
    return `${c.name} from ${short(low)} to ${short(high)}`;
  });
  return `${p.title} over time, in ${p.unit}: ${curves.join("; ")}`;
}

const EDGE = { left: 52, right: 8, top: 8, bottom: 34 };

/* The place of times and values in a drawing of this size. */
function scales(p, width, height) {
  const [low, high] = range(p);
  const end = Math.max(data.duration_s, 1e-6);
  const across = width - EDGE.left - EDGE.right;
  const up = height - EDGE.top - EDGE.bottom;
  return {
    low, high, end, width, height,
    left: EDGE.left, right: width - EDGE.right, top: EDGE.top, bottom: height - EDGE.bottom,
    x: (t) => EDGE.left + t / end * across,
    y: (v) => height - EDGE.bottom - (v - low) / (high - low) * up,
    time: (x) => Math.min(end, Math.max(0, (x - EDGE.left) / across * end)),
  };
}

function line(x1, y1, x2, y2, name) { return svg("line", { x1, y1, x2, y2, class: name }); }

function drawAxes(s, k, p) {
  const unit = k.end < 1 ? { name: "ms", per_s: 1e3 } : { name: "s", per_s: 1 };
  const up = ticks(k.low, k.high, 5);
  for (const v of up.list) {
    s.append(line(k.left, k.y(v), k.right, k.y(v), "gridline"));
    s.append(svg("text", { x: k.left - 7, y: k.y(v) + 4, "text-anchor": "end" }, tickText(v, up)));
  }
  const along = ticks(0, k.end * unit.per_s, k.width / 60);
  for (const v of along.list) {
    const x = k.x(v / unit.per_s);
    s.append(line(x, k.bottom, x, k.bottom + 4, "axis"));
    s.append(svg("text", { x, y: k.bottom + 17, "text-anchor": "middle" }, tickText(v, along)));
  }
  const name = "time since the first event in " + unit.name;
  s.append(svg("text", { x: k.right, y: k.height - 3, "text-anchor": "end" }, name));
  s.append(line(k.left, k.bottom, k.right, k.bottom, "axis"));
  if (p.base !== undefined) { s.append(line(k.left, k.y(p.base), k.right, k.y(p.base), "axis")); }
  for (const t of data.saccades.t) { s.append(line(k.x(t), k.top, k.x(t), k.bottom, "saccade")); }
}

const GAP_S = 0.3; /* Curves of estimates are cut where there is none for so long. */

/* The band of the uncertainty. */
function drawBand(s, k, c, name) {
  const inRange = (v) => k.y(Math.min(k.high, Math.max(k.low, v))).toFixed(1);
  let upper = [];
  let lower = [];
  let d = "";
  const close = () => {
    if (upper.length > 1) { d += "M" + upper.concat(lower.reverse()).join("L") + "Z"; }
    upper = [];
    lower = [];
  };
  for (let i = 0; i < c.points.length; i += 2) {
    if (i > 0 && c.points[i] - c.points[i - 2] > GAP_S) { close(); }
    const x = k.x(c.points[i]).toFixed(1);
    upper.push(x + " " + inRange(c.points[i + 1] + c.spread[i / 2]));
    lower.push(x + " " + inRange(c.points[i + 1] - c.spread[i / 2]));
  }
  close();
  s.append(svg("path", { d, class: "band " + name }));
}

function drawCurve(s, k, c, name) {
  const places = [];
  let path = "";
  for (let i = 0; i < c.points.length; i += 2) {
    const cut = i === 0 || (c.cut && c.points[i] - c.points[i - 2] > GAP_S);
    places.push(k.x(c.points[i]).toFixed(1) + " " + k.y(c.points[i + 1]).toFixed(1));
    path += (cut ? "M" : "L") + places[places.length - 1];
  }
  if (c.fill) {
    const ground = k.y(k.low).toFixed(1);
    const [first, last] = [places[0], places[places.length - 1]].map((place) => place.split(" ")[0]);
    s.append(svg("path", { d: `${path}L${last} ${ground}L${first} ${ground}Z`, class: "area " + name }));
  }
  s.append(svg("path", { d: path, class: "curve " + name }));
  if (places.length > 100 || c.plain) { return; }
  for (const place of places) { /* Few points are seen one by one. */
    const [cx, cy] = place.split(" ");
    s.append(svg("circle", { cx, cy, r: 2, class: "dot " + name }));
  }
}

const cursors = []; /* One per plot: all show the same moment, or null for none. */
const pointAt = (t) => { for (const show of cursors) { show(t); } };

function plot(p) {
  const classes = COLOURS[p.curves.length] || COLOURS[3];
  const values = p.curves.map(() => make("b", {}));
  const box = make("div", { class: "plot" }, plotHead(p, classes, values));
  let show = () => {};
  $("plots").append(box);
  status.plots[p.id] = p.curves.reduce((n, c) => n + c.points.length / 2, 0);

  const draw = () => {
    const k = scales(p, Math.max(240, Math.floor(box.clientWidth)), p.curves[0].spread ? 210 : p.curves.length > 1 ? 170 : 130);
    const view = `0 0 ${k.width} ${k.height}`;
    const s = svg("svg", { viewBox: view, height: k.height, role: "img", "aria-label": spoken(p) });
    drawAxes(s, k, p);
    p.curves.forEach((c, i) => { if (c.spread) { drawBand(s, k, c, classes[i]); } });
    p.curves.forEach((c, i) => {
      if (c.truth) { drawCurve(s, k, { points: c.truth, plain: true, cut: true }, classes[i] + " truth"); }
      drawCurve(s, k, c.spread ? { points: c.points, cut: true } : c, classes[i]);
    });
    const cursor = line(0, k.top, 0, k.bottom, "cursor");
    cursor.setAttribute("visibility", "hidden");
    s.append(cursor);
    s.addEventListener("pointermove", (e) => pointAt(k.time(e.clientX - s.getBoundingClientRect().left)));
    s.addEventListener("pointerleave", () => pointAt(null));
    show = (t) => {
      cursor.setAttribute("visibility", t === null ? "hidden" : "visible");
      if (t !== null) { cursor.setAttribute("x1", k.x(t)); cursor.setAttribute("x2", k.x(t)); }
      p.curves.forEach((c, i) => { values[i].textContent = t === null ? "" : short(nearest(c.points, t)); });
    };
    const old = box.querySelector("svg");
    if (old) { old.replaceWith(s); } else { box.append(s); }
  };
  draw();
  cursors.push((t) => show(t));
  let last = box.clientWidth;
  new ResizeObserver(() => {
    if (box.clientWidth === last) { return; }
    last = box.clientWidth;
    draw();
  }).observe(box);
}

function plots() {
  const drawn = data.plots.filter((p) => p.curves.every((c) => c.points.length > 0));
  if (drawn.length === 0) { return; }
  $("time").hidden = false;
  drawn.forEach(plot);
  const note = (text) => $("plots").append(make("p", { class: "note" }, text));
  const left = data.saccades.n - data.saccades.t.length;
  if (left > 0) { note(`${count(left)} later saccades are not marked.`); }
  if (drawn.some((p) => p.id === "direction")) {
    const truth = numbers.directions_true > 0 ? " The dashed truth is the mean velocity over each interval, from the " +
      `poses of the recording; the median of ${plural(numbers.directions_true, "angle")} to it is ` +
      `${digits(numbers.direction_error_deg, 2)}${DEGREES}.` : "";
    note("Direction of flight: an estimate at the middle of the interval that its flow spans, with a band of one " +
      "standard deviation." + truth);
  }
  if (numbers.windows_measured < numbers.windows) {
    note(`The sharpness of ${count(numbers.windows_measured)} of ${count(numbers.windows)} windows was measured: ` +
      "of all would take longer than the replay itself.");
  }
}
