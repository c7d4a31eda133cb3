/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* What every part of the page uses: elements, numbers as text, colours, and the note of what was drawn. Together the
 * scripts become one strict function of the page: no library, no network. Everything that came from a file enters the
 * page as text (textContent), never as markup. */
const $ = (id) => document.getElementById(id);
const data = JSON.parse($("data").textContent);
const summary = data.summary;
const numbers = data.numbers;
const settings = summary.settings;
const hasRotation = settings.attitude !== "none" && numbers.rate_deg_s !== undefined;

/* What the page has drawn, for tests and the curious: an element that nobody sees. */
const status = { ready: false, errors: [], theme: "", plots: {}, pictures: 0, span: {}, flow: {} };
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

const MINUS = "\u2212";
const THIN = "\u202f";
const TIMES = "\u00d7";
const DEGREES = "\u00b0";
const DASH = "\u2013";
function digits(x, n) { /* n significant digits, no exponent, a true minus sign, thin spaces between thousands */
  if (!Number.isFinite(x)) { return DASH; }
  const a = Math.abs(x);
  const decimals = a === 0 ? 0 : Math.max(0, n - 1 - Math.floor(Math.log10(a)));
  const [whole, rest] = a.toFixed(Math.min(decimals, 9)).split(".");
  const grouped = whole.length > 4 ? whole.replace(/\B(?=(\d{3})+$)/g, THIN) : whole;
  return (x < 0 ? MINUS : "") + grouped + (rest ? "." + rest : "");
}
const count = (n) => String(n).replace(/\B(?=(\d{3})+$)/g, THIN);
const plural = (n, what) => count(n) + " " + what + (n === 1 ? "" : "s");
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
prefersDark.addEventListener("change", () => {
  if (chosen) { return; }
  theme = prefersDark.matches ? "dark" : "light";
  apply();
});
document.documentElement.dataset.theme = theme;

function rgb(name) { /* A colour of the style sheet as three numbers. */
  const hex = getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  return [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16));
}
