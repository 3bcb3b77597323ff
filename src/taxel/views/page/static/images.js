// Tactile images, the map of the newest rows and the hand: canvases. Missing values are crossed out.

import { duration } from "./state.js";

const STOPS = [[20, 24, 60], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]];
export const QUIET_MS = 500; // A camera without a new image for so long says so on its picture.
const INK = "#8b98ab";

function colour(share) {
  const place = Math.min(1, Math.max(0, share)) * (STOPS.length - 1);
  const first = Math.min(Math.floor(place), STOPS.length - 2);
  const mixed = STOPS[first].map((c, i) => Math.round(c + (place - first) * (STOPS[first + 1][i] - c)));
  return `rgb(${mixed.join(",")})`;
}

/** The page's unit of size, pixels: page.css lets it follow the screen. */
function rem() {
  return parseFloat(getComputedStyle(document.documentElement).fontSize);
}

/** Make a canvas as sharp as the screen; return [context, width, height] in CSS pixels. */
function sharp(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const { clientWidth: width, clientHeight: height } = canvas;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  return [pen, width, height];
}

function cell(pen, x, y, w, h, share, round = 2) {
  pen.beginPath();
  pen.roundRect(x, y, w, h, round);
  if (Number.isFinite(share)) {
    pen.fillStyle = colour(share);
    pen.fill();
    return;
  }
  pen.fillStyle = "#1b212b";
  pen.fill();
  pen.strokeStyle = "#5a6577";
  pen.lineWidth = 1;
  pen.beginPath();
  pen.moveTo(x + 2, y + 2);
  pen.lineTo(x + w - 2, y + h - 2);
  pen.moveTo(x + w - 2, y + 2);
  pen.lineTo(x + 2, y + h - 2);
  pen.stroke();
}

/** The newest rows, oldest on top: shape (rows, channels), 0…1 or null. */
export function drawMap(canvas, rows, channels) {
  const [pen, width, height] = sharp(canvas);
  if (!rows || !rows.length || width < 10) return;
  const columns = rows[0].length;
  const side = rem() * 1.1;
  const w = (width - side) / columns;
  const h = (height - side) / Math.max(rows.length, 12);
  rows.forEach((row, r) => row.forEach((share, c) => cell(pen, side + c * w, r * h, w - 1, h - 1, share === null ? NaN : share)));
  pen.fillStyle = INK;
  pen.font = `${rem() * 0.8}px system-ui, sans-serif`;
  pen.textAlign = "center";
  pen.save();
  pen.translate(side * 0.5, (height - side) / 2);
  pen.rotate(Math.PI / 2);
  pen.fillText("older → newest", 0, 3);
  pen.restore();
  pen.fillText(columns === channels.length ? `${columns} ${columns === 1 ? "sensor" : "sensors"}` : "", side + (width - side) / 2, height - side * 0.15);
}

/** Return the fingers of a hand's twelve channels, or null for another array. */
export function fingers(channels) {
  const names = [...new Set(channels.map((name) => name.split("-")[0]))];
  return channels.length === 12 && names.length === 4 ? names : null;
}

/** Four fingers of three phalanges, the tips on top; `row` is the newest scan, 0…1. */
export function drawHand(canvas, row, names) {
  const [pen, width, height] = sharp(canvas);
  if (!row || width < 10) return;
  const size = Math.min(width / 5.2, height / 4.4);
  const gap = size * 0.12;
  const top = Math.max(0, (height - 4.4 * size) / 2);
  const left = (width - 4 * size * 1.2) / 2;
  const rise = [0.45, 0.12, 0, 0.28];
  pen.textAlign = "center";
  pen.font = `${Math.min(rem() * 1.05, size * 0.34)}px system-ui, sans-serif`;
  names.forEach((name, finger) => {
    const x = left + finger * size * 1.2 + size * 0.1;
    for (let joint = 0; joint < 3; joint += 1) {
      const share = row[finger * 3 + joint];
      const y = top + (2 - joint) * (size + gap) + rise[finger] * size;
      cell(pen, x, y, size, size, share === null ? NaN : share, joint === 2 ? size * 0.42 : size * 0.16);
      if (Number.isFinite(share)) {
        pen.fillStyle = share > 0.55 ? "#0b0e14" : "#e6ebf2";
        pen.fillText(Math.round(share * 100), x + size / 2, y + size * 0.6);
      }
    }
    pen.fillStyle = INK;
    pen.fillText(name, x + size / 2, Math.min(height - 3, top + 3 * (size + gap) + rise[finger] * size + size * 0.28));
  });
}

/** The tactile cameras' pictures, newest only. */
export class Cameras {
  constructor(place) {
    this.place = place;
    this.views = [];
    this.early = new Map(); // images that came before the first snapshot
    this.key = "";
  }

  /** Lay out as many pictures as there are cameras. */
  arrange(cameras) {
    const key = JSON.stringify(cameras);
    if (key === this.key) return;
    this.key = key;
    this.views = cameras.map((camera) => view(camera));
    this.place.replaceChildren(...this.views.map((one) => one.panel));
    for (const [camera, blob] of this.early) this.take(camera, blob, performance.now());
    this.early.clear();
  }

  async take(camera, blob, nowMs) {
    const one = this.views[camera];
    if (!one) {
      this.early.set(camera, blob);
      return;
    }
    one.cameMs = nowMs;
    one.shown += 1;
    one.waiting = blob;
    if (one.decoding) return; // the newest waits, older ones are passed over
    one.decoding = true;
    while (one.waiting) {
      const next = one.waiting;
      one.waiting = null;
      try {
        const picture = await createImageBitmap(next);
        if (one.canvas.width !== picture.width) one.canvas.width = picture.width;
        if (one.canvas.height !== picture.height) one.canvas.height = picture.height;
        one.canvas.getContext("2d").drawImage(picture, 0, 0);
        picture.close();
        one.broken = false;
      } catch {
        one.broken = true;
      }
    }
    one.decoding = false;
  }

  /** Say on each picture whether it is live; `still` where none is expected to move. */
  describe(nowMs, still) {
    for (const one of this.views) {
      const age = nowMs - one.cameMs;
      let text = "";
      if (one.broken) text = "BROKEN IMAGE";
      else if (!Number.isFinite(one.cameMs)) text = "NO IMAGE YET";
      else if (!still && age > QUIET_MS) text = `NO NEW IMAGE FOR ${duration(age / 1000)}`;
      one.note.textContent = text;
      one.panel.classList.toggle("quiet", text !== "");
      if (nowMs - one.countedMs >= 1000) {
        const rate = (one.shown * 1000) / (nowMs - one.countedMs);
        one.rate.textContent = still ? "" : `${rate.toFixed(0)}/s shown`;
        one.shown = 0;
        one.countedMs = nowMs;
      }
    }
  }
}

function view(camera) {
  const make = (kind, name, text = "") => Object.assign(document.createElement(kind), { className: name, textContent: text });
  const panel = make("figure", "panel camera");
  const title = make("h2", "", camera.name);
  const rate = make("small", "rate");
  title.append(" ", rate);
  const frame = make("div", "frame");
  const canvas = make("canvas", "");
  canvas.width = camera.width || 4;
  canvas.height = camera.height || 3;
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", `tactile image of ${camera.name}`);
  const note = make("figcaption", "quietnote");
  frame.append(canvas, note);
  panel.append(title, frame);
  return { panel, canvas, note, rate, cameMs: -Infinity, shown: 0, countedMs: performance.now(), waiting: null, decoding: false, broken: false };
}
