/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* The numbers at the top, and the tables: where the events went, and the settings. */
function head() {
  const c = settings.camera;
  $("lead").textContent = [c.width_px + "\u00d7" + c.height_px + " px", seconds(data.duration_s),
    plural(summary.events.in, "event"), plural(summary.windows, "window"), plural(summary.saccades, "saccade")].join(" \u00b7 ");
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
  const [before, after] = numbers.spans_sharpness;
  const gained = before > 0 ? TIMES + THIN + (after / before).toFixed(2) : DASH;
  const where = numbers.spans === 1 ? "the whole recording" : `mean of ${count(numbers.spans)} spans of up to 120 ms`;
  card("Sharpness gain", gained, "", `${digits(before, 3)} \u2192 ${digits(after, 3)}, ${where}`);
  if (hasRotation) {
    const [rate, most] = numbers.rate_deg_s.map((v) => digits(v, 3));
    const [smear, worst] = numbers.motion_px_s.map((v) => digits(v * 0.02, 3));
    card("Rotation removed", rate, DEGREES + "/s", `mean; peak ${most} ${DEGREES}/s`);
    card("Smear without it", smear, "px", `in 20 ms at the image centre; peak ${worst} px`);
  } else {
    card("Rotation removed", "none", "", "no orientation was given: the events are only undistorted");
  }
  if (numbers.directions > 0) {
    const known = numbers.directions_true > 0;
    const angle = known ? numbers.direction_error_deg : numbers.direction_sigma_deg;
    const per_s = digits(numbers.directions / Math.max(data.duration_s, 1e-6), 2);
    card("Direction of flight", (known ? "" : "\u00b1") + digits(angle, 2), DEGREES,
      `${known ? "median angle to the truth" : "median uncertainty of its own"}, ${per_s} estimates/s`);
  }
  const ns = summary.library_ns_per_event;
  card("Time in the library", digits(ns, 3), "ns/event", short(1e9 / ns) + " events/s on one core");
}

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
  if (unit === undefined || typeof value !== "number") { return [plain(key), String(value)]; }
  return [plain(key.slice(0, at)), String(value) + unit];
}

/* How the orientations fared. */
const FAULTS = ["gyro_saturated", "gyro_spikes", "gyro_gaps", "accel_left_out", "mag_left_out"];
function orientationText() {
  const a = summary.attitude || {};
  const faults = [];
  for (const [key, n] of Object.entries(a.bad || {})) {
    if (n > 0) { faults.push(count(n) + " skipped: " + plain(key)); }
  }
  for (const key of FAULTS) {
    if (a[key] > 0) { faults.push(count(a[key]) + " " + plain(key)); }
  }
  if (!(a.samples > 0)) { return "No orientation samples."; }
  const text = faults.length > 0 ? faults.join(", ") : "nothing wrong with any";
  return `Orientation: ${count(a.samples)} samples, ${text}.`;
}

/* How the images fared. */
const INVALID = {
  few_features: "with too few features", too_little_motion: "with too little motion",
  no_direction_fits: "whose flow fits no direction", no_orientation: "without an orientation in the middle",
};
function imageText() {
  const images = summary.images;
  const v = summary.velocity;
  if (!images) { return ""; }
  let text = ` Images: ${count(images.made)}`;
  const lost = Object.values(images.left_out).reduce((a, b) => a + b, 0);
  if (lost > 0) { text += `, and ${plural(lost, "window")} without one`; }
  if (!v) { return text + "."; }
  text += `; ${count(v.valid)} of ${plural(v.pairs, "pair")} of them gave a direction of flight`;
  const why = Object.entries(v.invalid).filter((e) => e[1] > 0).map(([key, n]) => `${count(n)} ${INVALID[key] || plain(key)}`);
  return text + (why.length > 0 ? " (not: " + why.join(", ") + ")." : ".");
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
  $("events").append(make("p", { class: "note" }, (dropped ? "" : "Nothing was dropped. ") + orientationText() +
    imageText()));
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
  const [fx, fy, cx, cy] = [c.fx_px, c.fy_px, c.cx_px, c.cy_px].map((v) => digits(v, 5));
  row("lens", `${c.model}, focal length ${fx} ${TIMES} ${fy} px, centre ${cx}, ${cy} px, distortion ` +
    c.distortion.map((v) => digits(v, 4)).join(", "));
  row("time of the replay", `${seconds(summary.wall_s)}, ${digits(summary.ns_per_event, 3)} ns/event with all files, ` +
    `${digits(summary.library_ns_per_event, 3)} ns/event in the library` +
    (summary.velocity && summary.velocity.library_ns_per_image !== undefined ?
      `, ${digits(summary.velocity.library_ns_per_image * 1e-6, 2)} ms/image for the direction of flight` : ""));
  $("settings").append(table);
  $("footer").textContent = "Written by evstab " + data.version + ". This page needs no network.";
}
