// Traces by uPlot: the last 30 s, newest at the right; older points are dropped.
/* global uPlot */

export const SHOWN_S = 30;
const AXIS = { stroke: "#8b98ab", grid: { stroke: "#1d2530", width: 1 }, ticks: { stroke: "#1d2530", width: 1 } };
const FINGERS = [["#7cc7f5", "#3a9fdc", "#1f6fa6"], ["#ffc247", "#e69f00", "#a87300"], ["#4fe0b6", "#16b588", "#0d7d5e"], ["#eaa6cb", "#cc79a7", "#94507a"]];
const STATE = /^(STABLE|WARNING|UNSTABLE|UNKNOWN|NO GRASP|STOP)\b/;
const MANY = ["#56b4e9", "#e69f00", "#2fd0a5", "#cc79a7", "#f0e442", "#9aa7ff", "#d55e00", "#8fd14f", "#b8c0cc", "#ff8fab", "#6fd6e8", "#c49a6c"];

/** Return a colour for each channel: a finger's joints share a hue. */
export function colours(channels, isHand) {
  return channels.map((_, i) => (isHand ? FINGERS[Math.floor(i / 3)][2 - (i % 3)] : MANY[i % MANY.length]));
}

/** The page's unit of size, pixels: page.css lets it follow the screen. */
function rem() {
  return parseFloat(getComputedStyle(document.documentElement).fontSize);
}

function font() {
  return `${Math.round(rem() * 0.85)}px system-ui, sans-serif`;
}

/** One chart whose time axis moves; `series` without the time. */
class Trace {
  constructor(place, series, options) {
    this.place = place;
    this.data = [[], ...series.map(() => [])];
    this.now = 0;
    this.dirty = true;
    this.series = series;
    this.options = options;
    this.build();
    new ResizeObserver(() => this.fit()).observe(place);
  }

  build() {
    const { place, options } = this;
    this.rem = rem();
    const ticks = () => [-30, -25, -20, -15, -10, -5, 0].map((s) => this.now + s);
    const ago = (_, all) => all.map((v) => `${Math.round(v - this.now)} s`.replace("-", "−"));
    this.chart?.destroy();
    this.chart = new uPlot(
      {
        width: Math.max(50, place.clientWidth),
        height: Math.max(40, place.clientHeight),
        legend: { show: false },
        cursor: { drag: { x: false, y: false }, points: { show: false } },
        padding: [this.rem * 0.5, this.rem, 0, 0],
        scales: { x: { time: false, range: () => [this.now - SHOWN_S, this.now] }, y: { range: options.range } },
        series: [{}, ...this.series.map((one) => ({ ...one }))],
        axes: [
          { ...AXIS, font: font(), size: this.rem * 2, splits: ticks, values: ago },
          { ...AXIS, font: font(), size: this.rem * 3.6, splits: options.splits, values: options.values },
        ],
        hooks: { draw: options.over ? [options.over] : [] },
      },
      this.data,
      place,
    );
  }

  fit() {
    const { clientWidth: width, clientHeight: height } = this.place;
    if (width <= 50 || height <= 40) return;
    if (rem() !== this.rem) this.build(); // the letters have another size
    else this.chart.setSize({ width, height });
  }

  clear() {
    this.data = this.data.map(() => []);
    this.dirty = true;
  }

  /** Append points: times, then a list for each series. */
  add(times, lists, newest) {
    this.now = newest;
    this.dirty = true;
    times.forEach((t, i) => {
      const held = this.data[0];
      if (held.length && t <= held[held.length - 1]) return;
      held.push(t);
      lists.forEach((list, k) => this.data[k + 1].push(list[i] ?? null));
    });
    let old = 0;
    while (old < this.data[0].length && this.data[0][old] < newest - SHOWN_S - 1) old += 1;
    if (old > 120) this.data = this.data.map((list) => list.slice(old));
  }

  draw() {
    if (!this.dirty || this.place.clientWidth < 50) return;
    this.dirty = false;
    this.chart.setData(this.data);
  }
}

function line(u, pen, x0, y0, x1, y1, colour, dash) {
  pen.save();
  pen.beginPath();
  pen.strokeStyle = colour;
  pen.lineWidth = window.devicePixelRatio || 1;
  pen.setLineDash(dash);
  pen.moveTo(x0, y0);
  pen.lineTo(x1, y1);
  pen.stroke();
  pen.restore();
}

/** The probability or score with its thresholds and what happened. */
export function probabilityTrace(place) {
  let events = [];
  let thresholds = {};
  const over = (u) => {
    const pen = u.ctx;
    const { left, top, width, height } = u.bbox;
    pen.font = font().replace(/\d+/, (n) => Number(n) * (window.devicePixelRatio || 1));
    const high = parseFloat(pen.font);
    let before = { y: Infinity, end: left };
    const levels = [["clear", "#5fc3a8"], ["warn", "#f5b301"], ["unstable", "#ff6b5e"]]
      .filter(([name]) => Number.isFinite(thresholds[name]))
      .map(([name, colour]) => ({ name, colour, y: u.valToPos(thresholds[name], "y", true) }));
    for (const { y, colour } of levels) line(u, pen, left, y, left + width, y, colour, [6, 4]);
    for (const { name, colour, y } of levels) {
      const x = (before.y - y < high ? before.end : left) + 0.4 * high; // beside a name that would be written over
      const foot = Math.max(y - 3, top + 0.9 * high);
      pen.textAlign = "left";
      pen.fillStyle = "rgba(10,13,18,0.8)"; // no other level's line crosses the name
      pen.fillRect(x - 2, foot - 0.85 * high, pen.measureText(name).width + 4, 1.1 * high);
      pen.fillStyle = colour;
      pen.fillText(name, x, foot);
      before = { y, end: x + pen.measureText(name).width };
    }
    let free = Infinity;
    for (const event of [...events].reverse()) {
      const text = STATE.exec(event.text)?.[0] ?? event.text; // its reason stands in the large field
      const x = u.valToPos(event.t, "x", true);
      if (x < left || x > left + width) continue;
      line(u, pen, x, top, x, top + height, "#c6d0de", [2, 3]);
      const wide = pen.measureText(text).width + 8;
      const fits = x + 3 + wide <= free && x + wide <= left + width + 4;
      free = x; // a name stands within its own stretch, or not at all
      if (!fits) continue;
      pen.textAlign = "left";
      pen.textBaseline = "top";
      pen.fillStyle = "rgba(10,13,18,0.8)";
      pen.fillRect(x + 2, top + 1, wide - 2, 1.3 * parseFloat(pen.font));
      pen.fillStyle = "#c6d0de";
      pen.fillText(text, x + 4, top + 2);
      pen.textBaseline = "alphabetic";
    }
  };
  const series = [{ stroke: "#6db8ff", width: 2, fill: "rgba(109,184,255,0.12)", points: { show: false } }];
  const values = (_, all) => all.map((v) => (trace?.bare ? "" : v.toFixed(2))); // events alone have no scale
  let trace = null;
  trace = new Trace(place, series, { range: [0, 1.02], splits: () => [0, 0.25, 0.5, 0.75, 1], values, over });
  return Object.assign(trace, {
    mark(more, limits, newest) {
      if (limits) thresholds = limits;
      const fresh = more.filter((event) => !events.some((old) => old.t === event.t && old.text === event.text)); // after a reconnect they come again
      events = [...events, ...fresh].filter((event) => event.t > newest - SHOWN_S - 1).sort((a, b) => a.t - b.t).slice(-60);
    },
    forget() {
      events = [];
    },
  });
}

/** The array's channels. */
export function sensorTrace(place, channels, inks) {
  const series = channels.map((name, i) => ({ label: name, stroke: inks[i], width: 1.25, points: { show: false }, spanGaps: false }));
  const range = (_, low, high) => {
    if (low === null || high === null || !(high > low)) return [(low ?? 0) - 0.5, (high ?? 0) + 0.5];
    const pad = (high - low) * 0.06;
    return [low - pad, high + pad];
  };
  return new Trace(place, series, { range, values: (_, all) => all.map((v) => short(v)) });
}

export function short(value) {
  const big = Math.abs(value);
  if (big >= 1e5) return value.toExponential(0);
  return String(Number(value.toFixed(big >= 100 ? 0 : big >= 10 ? 1 : 2)));
}

/** Return round times after a start, a dozen at most. */
function ticks(start, end) {
  const steps = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1800, 3600];
  const step = steps.find((one) => (end - start) / one <= 12) ?? (end - start) / 12;
  return Array.from({ length: Math.floor((end - start) / step + 1e-9) + 1 }, (_, i) => start + i * step);
}

/** The whole recording: bands for labels, an envelope a channel, a line at the cursor. */
export function overviewPlot(place, overview, onSeek) {
  const state = { cursor: overview.start_s };
  const names = overview.series;
  const times = [];
  for (let i = 0; i < overview.t.length; i += 1) times.push(overview.t[i], overview.t[i] + 1e-9);
  const lists = names.map((one) => overview.t.flatMap((_, i) => [one.low[i], one.high[i]]));
  const under = (u) => {
    const { top, height } = u.bbox;
    overview.bands.forEach((band, i) => {
      const x0 = u.valToPos(band.start_s, "x", true);
      const x1 = u.valToPos(band.end_s, "x", true);
      u.ctx.fillStyle = i % 2 ? "rgba(204,121,167,0.22)" : "rgba(86,180,233,0.20)";
      u.ctx.fillRect(x0, top, Math.max(1, x1 - x0), height);
    });
  };
  const over = (u) => {
    const { left, top, width, height } = u.bbox;
    const ratio = window.devicePixelRatio || 1;
    u.ctx.font = font().replace(/\d+/, (n) => Number(n) * ratio);
    u.ctx.textBaseline = "top";
    u.ctx.textAlign = "left";
    for (const band of overview.bands) {
      const x0 = Math.max(left, u.valToPos(band.start_s, "x", true));
      const x1 = Math.min(left + width, u.valToPos(band.end_s, "x", true));
      if (u.ctx.measureText(band.text).width + 8 > x1 - x0) continue;
      u.ctx.fillStyle = "#c6d0de";
      u.ctx.fillText(band.text, x0 + 4, top + 2);
    }
    u.ctx.textBaseline = "alphabetic";
    const x = u.valToPos(state.cursor, "x", true);
    line(u, u.ctx, x, top, x, top + height, "#ffffff", []);
    u.ctx.fillStyle = "#ffffff";
    u.ctx.beginPath();
    u.ctx.moveTo(x - 5 * ratio, top);
    u.ctx.lineTo(x + 5 * ratio, top);
    u.ctx.lineTo(x, top + 7 * ratio);
    u.ctx.fill();
  };
  const inks = colours(names, names.length === 12);
  const unit = rem();
  const chart = new uPlot(
    {
      width: Math.max(50, place.clientWidth),
      height: Math.max(40, place.clientHeight),
      legend: { show: false },
      cursor: { drag: { x: false, y: false }, points: { show: false } },
      padding: [4, unit, 0, 0],
      scales: { x: { time: false, range: () => [overview.start_s, overview.end_s] } },
      series: [{}, ...names.map((one, i) => ({ label: one.name, stroke: inks[i], width: 1, points: { show: false } }))],
      axes: [
        { ...AXIS, font: font(), size: unit * 2, splits: () => ticks(overview.start_s, overview.end_s), values: (_, all) => all.map((v) => `${short(v - overview.start_s)} s`) },
        { ...AXIS, font: font(), size: unit * 3.6, values: (_, all) => all.map(short) },
      ],
      hooks: { drawClear: [under], draw: [over] },
    },
    [times, ...lists],
    place,
  );
  new ResizeObserver(() => {
    if (place.clientWidth > 50 && place.clientHeight > 40) chart.setSize({ width: place.clientWidth, height: place.clientHeight });
  }).observe(place);
  let held = false;
  const seek = (event) => onSeek(chart.posToVal(event.clientX - chart.over.getBoundingClientRect().left, "x"));
  chart.over.addEventListener("pointerdown", (event) => {
    held = true;
    seek(event);
  });
  addEventListener("pointermove", (event) => held && seek(event));
  addEventListener("pointerup", () => (held = false));
  return {
    at(cursor) {
      if (cursor === state.cursor) return;
      state.cursor = cursor;
      chart.redraw(false);
    },
  };
}
