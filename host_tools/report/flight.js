/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* An image of events with the flow drawn on it, and the focus that the flow comes from or goes to. */
const ARROW_PX = 12; /* About so long the median arrow is drawn, in pixels of the image. */

function arrowPath(arrows, scale, inlier) {
  const path = [];
  for (const [x, y, dx, dy, fits] of arrows) {
    if ((fits === 1) !== inlier) { continue; }
    const [tipX, tipY] = [x + scale * dx, y + scale * dy];
    const length = Math.hypot(tipX - x, tipY - y);
    path.push(`M${x.toFixed(2)} ${y.toFixed(2)}L${tipX.toFixed(2)} ${tipY.toFixed(2)}`);
    if (length < 0.5) { continue; }
    const [ux, uy] = [(tipX - x) / length, (tipY - y) / length];
    const barb = Math.min(3, 0.4 * length);
    const left = [tipX - barb * (ux - 0.5 * uy), tipY - barb * (uy + 0.5 * ux)];
    const right = [tipX - barb * (ux + 0.5 * uy), tipY - barb * (uy - 0.5 * ux)];
    path.push(`M${left.map((v) => v.toFixed(2)).join(" ")}L${tipX.toFixed(2)} ${tipY.toFixed(2)}` +
      `L${right.map((v) => v.toFixed(2)).join(" ")}`);
  }
  return path.join("");
}

function focusOf(f) { /* Where the line of flight pierces the image, ahead or behind. */
  const [fx, fy, cx, cy] = f.k;
  const [x, y, z] = f.v;
  return Math.abs(z) < 1e-3 ? null : [cx + fx * x / z, cy + fy * y / z];
}

const inside = (f, p) => p !== null && p[0] >= 0 && p[1] >= 0 && p[0] < f.width && p[1] < f.height;

/* "to the right and ahead" */
function flightInWords([x, y, z]) {
  const words = [];
  if (Math.abs(x) > 0.38) { words.push(x > 0 ? "to the right" : "to the left"); }
  if (Math.abs(y) > 0.38) { words.push(y > 0 ? "downwards" : "upwards"); }
  if (Math.abs(z) > 0.38) { words.push(z > 0 ? "ahead" : "backwards"); }
  return words.join(" and ");
}

function drawFlow(f, arrows) {
  const lengths = arrows.map((a) => Math.hypot(a[2], a[3])).sort((a, b) => a - b);
  const median = lengths[lengths.length >> 1] || 1;
  const scale = Math.max(1, Math.round(ARROW_PX / median));
  const focus = focusOf(f);
  const n = arrows.filter((a) => a[4] === 1).length;
  const where = inside(f, focus) ? "in the picture" : "outside of the picture";
  const label = `${plural(arrows.length, "arrow")} of the flow on it; the focus lies ${where}`;
  const s = svg("svg", { viewBox: `-0.5 -0.5 ${f.width} ${f.height}`, role: "img", "aria-label": label });
  for (const [inlier, name] of [[false, "odd"], [true, "fits"]]) {
    s.append(svg("path", { d: arrowPath(arrows, scale, inlier), class: "arrow under" }));
    s.append(svg("path", { d: arrowPath(arrows, scale, inlier), class: "arrow " + name }));
  }
  if (inside(f, focus)) {
    const [cx, cy] = focus.map((v) => v.toFixed(2));
    for (const name of ["focus under", "focus"]) {
      s.append(svg("circle", { cx, cy, r: 5, class: name }));
      s.append(svg("path", { d: `M${cx} ${cy - 9}V${cy - 2}M${cx} ${Number(cy) + 2}v7M${cx - 9} ${cy}h7M${Number(cx) + 2} ${cy}h7`,
        class: name }));
    }
  }
  $("flow").append(s);
  const ring = focus === null ? "" : f.v[2] > 0 ? "The flow comes from the ring, where the camera flies to"
    : "The flow goes to the ring, where the camera comes from";
  $("flow-caption").textContent =
    `The camera flies ${flightInWords(f.v)} (x ${digits(f.v[0], 3)}, y ${digits(f.v[1], 3)}, z ${digits(f.v[2], 3)}; ` +
    `\u00b1${digits(f.sigma_deg, 2)}${DEGREES}), ${digits(f.at_s, 4)} s after the first event. The image of stabilized ` +
    `events shows how its pieces moved within ${seconds(f.interval_s)}, arrows ${scale} times as long: ` +
    `${count(n)} fit one direction, ${count(arrows.length - n)} do not (pale). ` +
    (inside(f, focus) ? ring + "." : "The focus of the flow lies outside of the picture.") +
    (data.numbers.directions > 1 ? " Of all pairs of images this is the one whose direction is surest." : "");
  status.flow = { arrows: arrows.length, inliers: n };
}

async function flight() {
  const f = data.flow;
  if (!f) { return; }
  const picture = await decode(f.image);
  const arrows = [];
  for (let i = 0; i < f.arrows.length; i += 5) { arrows.push(f.arrows.slice(i, i + 5)); }
  const paint = () => {
    const canvas = $("flow-image");
    canvas.width = picture.width;
    canvas.height = picture.height;
    const context = canvas.getContext("2d");
    const image = context.createImageData(picture.width, picture.height);
    const words = new Uint32Array(image.data.buffer);
    const ground = rgb("--picture");
    const ink = rgb("--count");
    const shade = Array.from({ length: 256 }, (_, v) => pack(blend(ground, ink, 0.75 * Math.pow(v / 255, 0.7))));
    for (let i = 0; i < words.length; i++) { words[i] = shade[picture.grey[i]]; }
    context.putImageData(image, 0, 0);
  };
  paint();
  repaint.push(paint);
  $("flight").hidden = false;
  drawFlow(f, arrows);
}
