/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* The animation: raw, stabilized, and stabilized on the canvas, as the paper shows them. */
/* A cell comes as 2 bits of brighter and 2 bits of darker events (0, 1, 2, more), spread over the greys of a PNG of 4
 * bits; here it is a byte, brighter events in the low half, darker ones in the high half, so that cells can be added. */
async function decodePicture(base64) {
  const picture = await decode(base64);
  const COUNT = [0, 1, 2, 4];
  picture.grey = picture.grey.map((v) => COUNT[(v / 17) & 3] | (COUNT[(v / 17) >> 2] << 4));
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
    const hue = b + d === 0 ? ground : blend(darker, brighter, b / (b + d));
    table[v] = pack(blend(ground, hue, 1 - Math.pow(0.58, b + d)));
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

function describeClip(clip, length_s) {
  const partly = length_s < data.duration_s * 0.9;
  const turned = hasRotation && partly && clip.rate_deg_s > 0.5;
  $("clip-caption").textContent =
    (turned ? `From the 2 s in which the camera turned fastest (${digits(clip.rate_deg_s, 3)} ${DEGREES}/s). ` : "") +
    "Blue: it got brighter; orange: darker. The dashed frame on the canvas is the stabilized pane" +
    (clip.bin > 1 ? `; ${clip.bin}${TIMES}${clip.bin} pixels of the sensor make one of a pane` : "") + ".";
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

  describeClip(clip, length_s);
  $("clip").hidden = false;
  at = Math.min(n - 1, Math.max(Number($("exposure").value), n >> 1)); /* A full one, for those who keep it still. */
  draw();
  if (!calm && "IntersectionObserver" in window) { /* Runs while it is seen, until the reader takes over. */
    let automatic = true;
    for (const id of ["seek", "play"]) {
      for (const what of ["pointerdown", "keydown"]) { $(id).addEventListener(what, () => { automatic = false; }); }
    }
    const seen = (entries) => { if (automatic) { play(entries[0].isIntersecting); } };
    new IntersectionObserver(seen).observe($("pane-canvas"));
  }
}
