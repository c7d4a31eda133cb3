/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* Before and after: two pictures over each other, and a slider that tells how much of which is seen. */
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

function describeSpan(s) {
  const [raw, stabilized] = s.sharpness.map((v) => digits(v, 3));
  const gained = s.sharpness[0] > 0 ? ` (${TIMES}${gain(s.sharpness).toFixed(2)})` : "";
  let what = "The span with most events";
  if (s.shaken) { what = "The span (of 30 ms at least) in which the camera turned fastest,"; }
  if (numbers.spans === 1) { what = "The whole recording"; }
  if (hasRotation) {
    what += ` at ${digits(s.rate_deg_s, 3)} ${DEGREES}/s (${digits(s.motion_px_s, 3)} px/s at the image centre)`;
  }
  $("before").setAttribute("aria-label", `Picture of ${count(s.n_events)} raw events, sharpness ${raw}`);
  $("after").setAttribute("aria-label", `The same events stabilized, sharpness ${stabilized}`);
  $("span-caption").textContent =
    `${what}: ${count(s.n_events)} events in ${seconds(s.to_s - s.from_s)}, from ${digits(s.from_s, 4)} s after the ` +
    `first event. Sharpness ${raw} raw, ${stabilized} stabilized${gained}: variance ` +
    "over the sensor of the picture of events, blurred by 1 px. Both pictures have one scale of ink.";
}

function compareBySlider() {
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
  box.addEventListener("pointerdown", (e) => {
    box.setPointerCapture(e.pointerId);
    slider.focus({ preventScroll: true });
    drag(e);
    e.preventDefault();
  });
  box.addEventListener("pointermove", (e) => { if (box.hasPointerCapture(e.pointerId)) { drag(e); } });
  show();
}

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

  describeSpan(s);
  compareBySlider();
  $("span").hidden = false;
}
