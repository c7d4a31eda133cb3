/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* What evstab eval found, if it has been run: it puts eval.json into the page. */
function errorTable(caption, rows) {
  const table = make("table", {}, make("caption", {}, caption));
  const heads = ["error, degrees", "RMSE", "mean", "median", "95" + THIN + "%", "max", "samples"];
  table.append(make("tr", {}, ...heads.map((h) => make("th", { scope: "col" }, h))));
  for (const [name, s] of rows) {
    if (!s || !(s.n > 0)) { continue; }
    const values = [s.rmse_deg, s.mean_deg, s.median_deg, s.p95_deg, s.max_deg].map((v) => digits(v, 3));
    table.append(make("tr", {}, make("th", { scope: "row" }, name),
      ...values.map((v) => make("td", { class: "number" }, v)), make("td", { class: "number" }, count(s.n))));
  }
  return table;
}

const ALIGNED = {
  none: "nothing was aligned",
  heading: "one constant heading was aligned",
  world: "a constant rotation between the worlds was aligned",
  full: "constant rotations between the worlds and between body and camera were aligned",
};

function evaluation() {
  const found = JSON.parse($("evaluation-data").textContent);
  if (!found) { return; }
  const box = $("evaluation-box");
  const a = found.attitude;
  if (a) {
    box.append(errorTable(`Attitude (${a.source})`, [["total", a.total], ["inclination", a.inclination],
      ["heading", a.heading], ["rotation over 0.1 s", a.over_100ms], ["rotation over 1 s", a.over_1s]]));
    box.append(make("p", { class: "note" }, `Before comparing, ${ALIGNED[a.aligned.kind] || a.aligned.kind}.`));
  }
  const v = found.velocity;
  if (v) {
    box.append(errorTable("Direction of the velocity", [["angle to the truth", v.direction],
      ["to its mean over the interval", v.direction_over_interval]]));
    box.append(make("p", { class: "note" }, `Left out: ${count(v.n_slow)} slower than ${v.slow_below_share_of_mean} of ` +
      `the mean speed of ${digits(v.mean_speed_m_s, 3)} m/s, ${count(v.n_no_truth)} without truth, ` +
      `${count(v.n_no_estimate)} without an estimate.`));
    const covered = v.covered_share !== null ? `An estimate of the last ${v.covered_for_s} s was at hand for ` +
      `${percent(v.covered_share, 1)} of the time. ` : "";
    const honest = v.n_sigma > 0 ? `${percent(v.within_sigma_share, 1)} of the errors are within the uncertainty that ` +
      `the estimate itself tells, ${percent(v.within_2_sigma_share, 1)} within twice of it (Gaussian ones: 63${THIN}%, ` +
      `98${THIN}%).` : "";
    if (covered + honest) { box.append(make("p", { class: "note" }, covered + honest)); }
  }
  const s = found.sharpness;
  if (s) {
    const g = s.per_window;
    box.append(make("p", {}, `Sharpness of ${plural(g.n, "window")}: ${digits(g.unstabilized_mean, 3)} unstabilized, ` +
      `${digits(g.stabilized_mean, 3)} stabilized, ${TIMES}${THIN}${digits(g.gain, 3)}.`));
  }
  box.append(make("p", { class: "note" }, "Truth: " + [found.truth, found.velocity_truth].filter(Boolean).join(", ") + "."));
  $("evaluation").hidden = false;
  status.evaluation = box.querySelectorAll("td").length;
}
