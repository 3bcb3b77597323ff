// What the person is to do, and what they say they did: words, buttons, voice. It moves nothing.

import { $, make, show } from "./panels.js";
import { number } from "./state.js";

export const REACTIONS = [["pour stopped", "Stopped pouring", "S"], ["put down", "Put down", "P"], ["grip changed", "Changed grip", "G"]];
export const OUTCOMES = [["held", "Held", "H"], ["slipped", "Slipped", "L"], ["dropped", "Dropped", "X"]];
const STEPS = [["ready", "Ready", "Enter"], ["again", "Last one again", ""], ["discard", "Discard last one", ""]];
const TONES = { "PUT DOWN": "danger", "GRIP HARDER": "warning", "HOLD STILL": "doubt", "HOLD": "good", "POUR NOW": "good", "LOST": "lost" };
const AGAIN_MS = 6000; // What is urgent is said again after so long.

/** Return {word, why, tone} of what is to be done, never an old one; null where nothing is. */
export function doing(view, snapshot) {
  if (view.kind === "LOST") return { word: view.word, why: view.reason, tone: "lost" };
  const advice = snapshot && !snapshot.replay ? snapshot.plan || snapshot.do : null;
  if (!advice) return null;
  return { word: String(advice.word || "–").toUpperCase(), why: advice.why || "", tone: TONES[advice.word] || "calm" };
}

/** Make the buttons; `say` sends a command. */
export function wirePerson(say) {
  const button = ([what, text, key], command) => {
    const made = make("button", "choice", `${text} `);
    made.type = "button";
    made.dataset.what = what;
    if (key) made.append(make("kbd", "", key));
    made.addEventListener("click", () => say({ do: command, what }));
    return made;
  };
  $("reactions").replaceChildren(...REACTIONS.map((one) => button(one, "react")));
  $("outcomes").replaceChildren(...OUTCOMES.map((one) => button(one, "react")));
  $("plansteps").replaceChildren(...STEPS.map((one) => button(one, "step")));
}

export function drawDoing(advice, snapshot) {
  show($("dofield"), advice !== null && Boolean(snapshot && (snapshot.do || snapshot.plan)));
  if (advice) {
    if ($("dofield").dataset.tone !== advice.tone) $("dofield").dataset.tone = advice.tone;
    if ($("doword").textContent !== advice.word) {
      $("doword").textContent = advice.word;
      $("dofield").style.setProperty("--letters", Math.max(4, advice.word.length));
    }
    if ($("dowhy").textContent !== advice.why) $("dowhy").textContent = advice.why;
  }
}

export function drawPerson(trial) {
  show($("person"), Boolean(trial));
  if (!trial) return;
  for (const one of $("person").querySelectorAll("button")) {
    const on = one.dataset.what === trial.reaction || one.dataset.what === trial.outcome;
    one.setAttribute("aria-pressed", String(on));
  }
  const after = trial.reaction_time_s;
  const own = Number.isFinite(after) ? `${number(Math.abs(after), 1)} s ${after < 0 ? "before" : "after"} alarm` : `grasp ${trial.number}`;
  const text = trial.cameras ? `${own}, ${trial.cameras}` : own; // of several grasps, the one that the buttons are about
  if ($("trialnote").textContent !== text) $("trialnote").textContent = text;
}

export function drawPlan(plan) {
  show($("plan"), Boolean(plan));
  if (!plan) return;
  if ($("planbalance").textContent !== plan.balance) $("planbalance").textContent = plan.balance;
  $("planbar").style.width = `${(100 * plan.done) / Math.max(1, plan.of)}%`;
  show($("plansteps"), Boolean(plan.asks));
}

/** Says aloud what to do: off until asked for, by a voice of this machine only, never over a network. */
export class Voice {
  constructor(button) {
    this.button = button;
    this.on = false;
    this.spoken = "";
    this.spokenMs = -Infinity;
    button.addEventListener("click", () => this.toggle());
    this.show();
  }

  get own() {
    const every = globalThis.speechSynthesis ? speechSynthesis.getVoices().filter((voice) => voice.localService) : [];
    return every.find((voice) => voice.lang.startsWith("en")) || every[0] || null;
  }

  toggle() {
    this.on = !this.on;
    this.spoken = "";
    if (!this.on) globalThis.speechSynthesis?.cancel();
    this.show();
  }

  show() {
    const text = !this.on ? "Voice off" : this.own ? "Voice on" : "No voice on this machine";
    if (this.button.firstChild?.data !== `${text} `) this.button.replaceChildren(`${text} `, make("kbd", "", "V"));
    this.button.setAttribute("aria-pressed", String(this.on));
  }

  /** Say a word when it is new, and what is urgent again; called often. */
  want(advice, nowMs) {
    if (!this.on) return;
    this.show();
    const voice = this.own;
    const word = advice ? advice.word : "";
    const again = advice && ["danger", "warning", "lost"].includes(advice.tone) && nowMs - this.spokenMs > AGAIN_MS;
    if (word === this.spoken && !again) return;
    this.spoken = word;
    this.spokenMs = nowMs;
    if (!voice || !word || word === "–") return;
    const speech = new SpeechSynthesisUtterance(word.toLowerCase());
    speech.voice = voice;
    speech.lang = voice.lang;
    speechSynthesis.cancel();
    speechSynthesis.speak(speech);
  }
}
