// What the page may claim: the state's word, decided from what came and when. No DOM, no sockets.

export const STALE_MS = 500; // A snapshot that has not moved on for so long is not shown as a state.
const WORDS = ["STABLE", "WARNING", "UNSTABLE", "UNKNOWN", "STOP"];

/** Remembers when the station last moved on: its own clock must, not only the messages. */
export class Freshness {
  constructor() {
    this.connected = false;
    this.failed = "";
    this.forget();
  }

  forget() {
    this.time = null; // the station's clock in the newest snapshot, seconds
    this.movedMs = -Infinity; // when that clock last changed, on this page's clock
  }

  /** Take in a snapshot's time at a moment of this page's clock, milliseconds. */
  take(time, nowMs) {
    if (Number.isFinite(time) && time !== this.time) {
      this.time = time;
      this.movedMs = nowMs;
    }
  }

  ageMs(nowMs) {
    return nowMs - this.movedMs;
  }
}

/** Return {kind, word, reason}: what is shown in the large field. */
export function shown(fresh, snapshot, nowMs) {
  if (!fresh.connected) return { kind: "LOST", word: "NO CONNECTION", reason: fresh.failed || "the station does not answer" };
  if (fresh.failed) return { kind: "LOST", word: "NO CONNECTION", reason: fresh.failed };
  if (!snapshot) return { kind: "LOST", word: "NO CONNECTION", reason: "nothing has come yet" };
  const age = fresh.ageMs(nowMs);
  if (!(age <= STALE_MS)) {
    return { kind: "LOST", word: "STALE", reason: `nothing new for ${duration(age / 1000)}: the grasp is not watched` };
  }
  if (snapshot.replay) return { kind: "REPLAY", word: "REPLAY", reason: "a recording: this is not now" };
  if (snapshot.plan) return trial(snapshot.plan);
  if (snapshot.state === "NONE") return hand(snapshot);
  if (snapshot.state === "NO GRASP") return { kind: "IDLE", word: "NO GRASP", reason: snapshot.reason || "" };
  if (!WORDS.includes(snapshot.state)) return { kind: "UNKNOWN", word: "UNKNOWN", reason: "the station gave no state" };
  return { kind: snapshot.state, word: snapshot.state, reason: snapshot.reason || "" };
}

/** Where a plan is recorded, the large field names the next trial. */
function trial(plan) {
  const word = plan.number ? `TRIAL ${plan.number} OF ${plan.of}` : `${plan.done} OF ${plan.of}`;
  return { kind: "PLAN", word, reason: plan.words || "recorded" };
}

/** Where nothing watches a grasp, the large field names what is in the hand. */
function hand(snapshot) {
  const answer = (snapshot.answers || [])[0];
  const named = answer && answer.label && answer.label !== "UNKNOWN";
  const waits = !answer || answer.label === "";
  const word = named ? String(answer.label).toUpperCase() : waits ? "NO ANSWER YET" : "UNKNOWN";
  const why = answer ? [answer.target, named ? "" : answer.reason] : [];
  return { kind: "HAND", word, reason: [...why, waits && answer ? "" : "no grasp monitor runs"].filter(Boolean).join("; ") };
}

/** How old an answer is, such as "3 s ago"; empty of a present one, or where that is not known. */
export function ageWords(answer, now) {
  const age = Number.isFinite(answer?.time_s) ? now - answer.time_s : 0;
  return age >= 1 ? `${duration(Math.floor(age)).replace(".0", "")} ago` : "";
}

/** Return "warning", "danger", "lost" or "": what should sound. */
export function sounding(view, snapshot) {
  if (view.kind === "LOST") return snapshot && !snapshot.replay ? "lost" : "";
  const open = ((snapshot && snapshot.alarms) || []).filter((alarm) => !alarm.acknowledged);
  if (!open.length) return "";
  return open.some((alarm) => alarm.level === "danger") ? "danger" : "warning";
}

/** Return since when the newest alarm that nobody acknowledged holds. */
export function alarmedSince(snapshot) {
  const open = ((snapshot && snapshot.alarms) || []).filter((alarm) => !alarm.acknowledged);
  return Math.max(-Infinity, ...open.map((alarm) => alarm.since_s));
}

export function duration(seconds) {
  if (!Number.isFinite(seconds)) return "–";
  const s = Math.max(0, seconds);
  if (s < 10) return `${s.toFixed(1)} s`;
  if (s < 60) return `${Math.floor(s)} s`;
  const whole = Math.floor(s);
  const pad = (n) => String(n).padStart(2, "0");
  if (s < 3600) return `${Math.floor(whole / 60)}:${pad(whole % 60)} min`;
  return `${Math.floor(whole / 3600)}:${pad(Math.floor(whole / 60) % 60)} h`;
}

export function number(value, digits = 1) {
  return Number.isFinite(value) ? value.toFixed(digits).replace(/^-(0(\.0*)?)$/, "$1") : "–"; // not −0.0
}

/** How far the object has slipped, such as "slip 0.12 mm, 0.3 mm/s"; empty where nothing follows it. */
export function slipWords(slip) {
  if (!slip) return "";
  if (!slip.slip_seen) return "slip unknown";
  return `slip ${number(slip.slip_mm, 2)} mm, ${number(slip.slip_rate_mm_s, 1)} mm/s`;
}

/** Return the name, the number and the threshold of what a monitor goes by: a probability, or a warning's score. */
export function evidence(snapshot) {
  if (snapshot.state === "NONE") return { name: "Events", now: "", from: "" };
  const name = snapshot.scored ? "Warning score" : "Probability of instability";
  const warn = snapshot.thresholds?.warn;
  return { name, now: number(snapshot.scored ? snapshot.score : snapshot.probability, 2), from: Number.isFinite(warn) ? `warns from ${number(warn, 2)}` : "" };
}

export function count(value) {
  return Number.isFinite(value) ? String(value).replace(/\B(?=(\d{3})+$)/g, "\u202f") : "–";
}

export function size(bytes) {
  if (!Number.isFinite(bytes)) return "–";
  return bytes < 1e6 ? `${(bytes / 1e3).toFixed(0)} kB` : bytes < 1e9 ? `${(bytes / 1e6).toFixed(1)} MB` : `${(bytes / 1e9).toFixed(2)} GB`;
}
