// A recording: its overview, the time cursor, play and pause.

import { $, show } from "./panels.js";
import { overviewPlot } from "./plots.js";

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4, 16];

export class Replay {
  /** `say` sends a command. */
  constructor(say) {
    this.say = say;
    this.now = null; // the newest snapshot.replay
    this.plot = null;
    this.overview = null;
    this.draggedMs = -Infinity;
    $("play").addEventListener("click", () => this.toggle());
    $("cursor").addEventListener("input", (event) => this.seek(Number(event.target.value)));
    $("speed").addEventListener("change", () => this.now?.playing && this.play());
  }

  take(overview) {
    this.overview = overview;
    this.plot = null;
    $("overview").replaceChildren();
  }

  draw(replay, nowMs) {
    this.now = replay || null;
    show($("replay"), Boolean(replay));
    $("board").classList.toggle("replaying", Boolean(replay));
    if (!replay) return;
    if (!this.plot && this.overview && $("overview").clientWidth > 50) {
      this.plot = overviewPlot($("overview"), this.overview, (time) => this.seek(time));
    }
    this.plot?.at(replay.cursor_s);
    const cursor = $("cursor");
    cursor.min = replay.start_s;
    cursor.max = replay.end_s;
    if (nowMs - this.draggedMs > 300) cursor.value = replay.cursor_s;
    const at = replay.cursor_s - replay.start_s;
    const whole = replay.end_s - replay.start_s;
    cursor.setAttribute("aria-valuetext", `${at.toFixed(2)} of ${whole.toFixed(2)} seconds`);
    $("replaytime").textContent = `${at.toFixed(2)} of ${whole.toFixed(2)} s`;
    $("replayname").textContent = replay.path;
    $("replaylabels").textContent = replay.labels || "";
    const button = $("play");
    if (button.dataset.playing !== String(replay.playing)) {
      button.dataset.playing = String(replay.playing);
      button.firstChild.data = replay.playing ? "Pause " : "Play ";
    }
  }

  seek(time) {
    if (!this.now || !Number.isFinite(time)) return;
    const within = Math.min(this.now.end_s, Math.max(this.now.start_s, time));
    this.draggedMs = performance.now();
    this.now.cursor_s = within;
    this.say({ do: "seek", time_s: within });
  }

  step(seconds) {
    if (this.now) this.seek(this.now.cursor_s + seconds);
  }

  ends(last) {
    if (this.now) this.seek(last ? this.now.end_s : this.now.start_s);
  }

  play() {
    this.say({ do: "play", speed: Number($("speed").value) });
  }

  toggle() {
    if (this.now?.playing) this.say({ do: "pause" });
    else this.play();
  }

  faster(steps) {
    const at = SPEEDS.indexOf(Number($("speed").value)) + steps;
    $("speed").value = SPEEDS[Math.min(SPEEDS.length - 1, Math.max(0, at))];
    if (this.now?.playing) this.play();
  }
}
