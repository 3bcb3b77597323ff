// Beeps: made here, not loaded. A browser lets nothing sound before a person has clicked or typed.

const PATTERNS = {
  warning: { everyMs: 2000, tones: [[660, 0, 0.14], [880, 0.18, 0.14]] },
  danger: { everyMs: 900, tones: [[988, 0, 0.12], [740, 0.15, 0.12], [988, 0.3, 0.12], [740, 0.45, 0.12]] },
  lost: { everyMs: 3000, tones: [[330, 0, 0.25], [247, 0.3, 0.35]] },
};

export class Sound {
  constructor(button) {
    this.button = button;
    this.context = null;
    this.muted = false;
    this.wanted = "";
    this.since = -Infinity;
    this.wokeMs = -Infinity;
    this.lastMs = -Infinity;
    button.addEventListener("click", () => this.toggle());
    for (const kind of ["pointerdown", "keydown"]) addEventListener(kind, () => this.wake(), true);
    this.show();
  }

  get ready() {
    return this.context !== null && this.context.state === "running";
  }

  /** Called within a person's gesture. */
  async wake() {
    if (this.ready) return;
    try {
      this.context = this.context || new AudioContext();
      await this.context.resume();
      this.wokeMs = performance.now();
    } catch {
      this.context = null;
    }
    this.show();
  }

  toggle() {
    // The click that first enables sound does not mute it.
    if (this.shown === "off") this.wake();
    else if (performance.now() - this.wokeMs > 700) this.muted = !this.muted;
    this.show();
  }

  show() {
    this.shown = this.ready ? (this.muted ? "muted" : "on") : this.muted ? "muted" : "off";
    const text = { on: "Sound on", muted: "MUTED", off: "Click to enable sound" }[this.shown];
    if (this.button.firstChild?.data !== text) {
      this.button.replaceChildren(text, " ", Object.assign(document.createElement("kbd"), { textContent: "M" }));
    }
    this.button.dataset.sound = this.shown;
    this.button.setAttribute("aria-pressed", String(this.muted));
  }

  /** Say what should sound now, and since when the newest of it holds; called often. A newer one sounds at once. */
  want(kind, nowMs, since = -Infinity) {
    const pattern = PATTERNS[kind];
    const changed = kind !== this.wanted || since > this.since;
    this.wanted = kind;
    this.since = since;
    if (this.shown === "on" && !this.ready) this.show();
    if (!pattern || this.muted || !this.ready) return;
    if (!changed && nowMs - this.lastMs < pattern.everyMs) return;
    this.lastMs = nowMs;
    for (const [hertz, at, length] of pattern.tones) this.beep(hertz, at, length);
  }

  beep(hertz, at, length) {
    const start = this.context.currentTime + at;
    const tone = this.context.createOscillator();
    const gain = this.context.createGain();
    tone.type = "square";
    tone.frequency.value = hertz;
    gain.gain.setValueAtTime(0, start);
    gain.gain.linearRampToValueAtTime(0.18, start + 0.01);
    gain.gain.setValueAtTime(0.18, start + length - 0.02);
    gain.gain.linearRampToValueAtTime(0, start + length);
    tone.connect(gain).connect(this.context.destination);
    tone.start(start);
    tone.stop(start + length + 0.02);
  }
}
