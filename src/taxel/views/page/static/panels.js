// The panels of words and tables: each draws one part of the snapshot, and hides where there is none.

import { ageWords, count, duration, number, size } from "./state.js";

export const $ = (id) => document.getElementById(id);

export function make(kind, name = "", text = "") {
  const made = document.createElement(kind);
  if (name) made.className = name;
  if (text !== "") made.textContent = text;
  return made;
}

function row(cells) {
  const made = make("tr");
  for (const [text, name] of cells) made.append(make("td", name || "", text));
  return made;
}

const drawn = new Map();
/** Draw a part only when it has changed: a table that is rebuilt 20 times a second cannot be read aloud. */
function once(key, value, draw) {
  const text = JSON.stringify(value);
  if (drawn.get(key) === text) return;
  drawn.set(key, text);
  draw();
}

export function show(element, visible) {
  if (element.hidden === visible) element.hidden = !visible;
}

/** The large field. `view` is what state.js allows to be shown. */
export function drawState(view, since) {
  const state = $("state");
  if (state.dataset.state !== view.kind) {
    state.dataset.state = view.kind;
    $("symbol").setAttribute("href", `#sym-${view.kind}`);
    document.title = `${view.word} – taxel`;
    $("board").classList.toggle("lost", view.kind === "LOST");
  }
  if ($("word").textContent !== view.word) {
    $("word").textContent = view.word;
    state.style.setProperty("--letters", view.word.length);
    $("spoken").textContent = `${view.word}. ${view.reason}`;
  }
  if ($("reason").textContent !== view.reason) $("reason").textContent = view.reason;
  if ($("since").textContent !== since) $("since").textContent = since;
}

let heard = new Set();
/** Say a new alarm to whoever listens to the page: the list itself changes each second. */
function announce(alarms) {
  const open = alarms.filter((alarm) => !alarm.acknowledged).map((alarm) => alarm.kind);
  const fresh = alarms.filter((alarm) => !alarm.acknowledged && !heard.has(alarm.kind));
  heard = new Set(open);
  if (fresh.length) $("heard").textContent = fresh.map((alarm) => `${alarm.level === "danger" ? "Danger" : "Warning"}: ${alarm.text || alarm.kind}`).join(". ");
}

export function drawAlarms(alarms, now) {
  announce(alarms);
  const open = alarms.some((alarm) => !alarm.acknowledged);
  show($("noalarms"), alarms.length === 0);
  $("acknowledge").disabled = !open;
  const shown = alarms.map((alarm) => [alarm.kind, alarm.text, alarm.level, alarm.acknowledged, duration(now - alarm.since_s)]);
  once("alarms", shown, () => {
    $("alarmlist").replaceChildren(
      ...alarms.map((alarm, i) => {
        const danger = alarm.level === "danger";
        const item = make("li", `${danger ? "danger" : "warning"}${alarm.acknowledged ? " seen" : ""}`);
        item.append(make("b", "level", danger ? "DANGER" : "WARNING"), make("span", "text", alarm.text || alarm.kind));
        item.append(make("span", "note", `${alarm.acknowledged ? "acknowledged, " : ""}${shown[i][4]} ago`));
        return item;
      }),
    );
  });
}

const GOOD = new Set(["live", "ok", "alive", "running"]);
const MARKS = { failed: "✕", silent: "✕", live: "●", ok: "●", alive: "●", running: "●", ended: "■", gone: "✕", frozen: "❄", stale: "◌", late: "◔", reconnecting: "↻" };

function mark(state) {
  return `${MARKS[state] || "▲"} ${state}`;
}

export function drawPills(snapshot) {
  const all = [...(snapshot.sources || []).map((one) => [one.name, one.state]), ...(snapshot.consumers || []).map((one) => [one.name, one.state])];
  once("pills", all, () => {
    $("pills").replaceChildren(...all.map(([name, state]) => make("span", `pill ${GOOD.has(state) ? "good" : state === "ended" ? "done" : "bad"}`, `${MARKS[state] || "▲"} ${name}${GOOD.has(state) ? "" : ` ${state}`}`)));
  });
}

export function drawStreams(sources, consumers) {
  show($("streams"), sources.length + consumers.length > 0);
  once("streams", [sources, consumers], () => {
    const tone = (state) => (GOOD.has(state) ? "good" : state === "ended" ? "" : "bad");
    const first = sources.map((one) => {
      const made = row([[one.name, "name"], [mark(one.state), tone(one.state)], [`${number(one.rate_hz)} of ${number(one.nominal_hz, 0)}`, "n"], [count(one.produced), "n"], [count(one.lost), one.lost ? "n bad" : "n"], [one.note || "", "wide"]]);
      made.title = one.url || "";
      return made;
    });
    const second = consumers.map((one) => row([[`→ ${one.name}`, "name"], [mark(one.state), tone(one.state)], [one.beat_age_s === null || one.beat_age_s === undefined ? "" : `beat ${number(Math.max(0, one.beat_age_s) * 1000, 0)} ms`, "n"], [count(one.consumed), "n"], [count(one.dropped), "n"], [one.dropped ? "lost: dropped as too slow" : "", "wide"]]));
    $("streamrows").replaceChildren(...first, ...second);
  });
}

export function drawLatency(stages) {
  const names = Object.keys(stages);
  show($("latency"), names.length > 0);
  once("latency", stages, () => {
    $("latencyrows").replaceChildren(...names.map((name) => row([[name, "name"], ...stages[name].map((ms) => [number(ms), "n"])])));
  });
}

export function drawAnswers(answers, now) {
  show($("answers"), answers.length > 0);
  const ages = answers.map((one) => ageWords(one, now));
  const shown = answers.map((one, i) => [one.target, one.label, one.confidence, one.reason, one.action, ages[i]]);
  once("answers", shown, () => {
    $("answerlist").replaceChildren(
      ...answers.map((one, i) => {
        const made = make("div", "answer");
        made.append(make("span", "note", one.target), make("strong", "", one.label || "–"));
        const known = Number.isFinite(one.confidence);
        const bar = make("span", "meter");
        const fill = make("span");
        fill.style.width = `${known ? one.confidence * 100 : 0}%`;
        bar.append(fill);
        made.append(bar, make("span", "n", known ? `${Math.round(one.confidence * 100)} %` : "–"), make("span", "note why", [ages[i], one.action ? `→ ${one.action}` : one.reason].filter(Boolean).join(": ")));
        return made;
      }),
    );
  });
}

export function drawGripper(gripper) {
  show($("gripper"), gripper !== null);
  if (gripper === null) return;
  once("gripper", gripper, () => {
    const cells = make("dl", "pairs");
    const add = (name, text, tone = "") => cells.append(make("dt", "", name), make("dd", tone, text));
    add("interlock", gripper.interlock || "–", /open|closed|ready|ok|armed/i.test(gripper.interlock || "") ? "" : "bad");
    add("armed", gripper.armed ? "ARMED" : "no", gripper.armed ? "armed" : "");
    add("force", `${number(gripper.force_n)} N`);
    add("commanded", `${number(gripper.commanded_n)} N`);
    add("motion", gripper.motion ?? "–");
    const parts = [cells];
    if (gripper.note) parts.push(make("p", "note", gripper.note));
    $("grip").replaceChildren(...parts);
  });
}

export function drawRecording(recording) {
  show($("recording"), recording !== null && recording !== undefined);
  const on = Boolean(recording && recording.on);
  show($("recmark"), on);
  if (!recording) return;
  const error = recording.error ? `NOT RECORDED: ${recording.error}` : "";
  const info = on ? `${duration(recording.seconds)}, ${size(recording.bytes)}, ${recording.path}` : recording.path ? `last: ${recording.path}` : "not recording";
  once("recording", [on, error, info], () => {
    $("recmark").textContent = `● REC ${duration(recording.seconds)}`;
    const button = $("record");
    button.dataset.on = String(on);
    button.replaceChildren(on ? "■ Stop recording " : "● Record ", make("kbd", "", "R"));
    for (const field of $("labels").querySelectorAll("input")) field.disabled = on;
    $("recinfo").textContent = error || info;
    $("recinfo").classList.toggle("bad", error !== "");
  });
}

export function toast(text) {
  const box = $("toast");
  box.textContent = text;
  box.hidden = false;
  clearTimeout(toast.timer);
  toast.timer = setTimeout(() => (box.hidden = true), 6000);
}

/** What the monitor goes by, as `evidence` gives it, and the slip in words. */
export function drawNumber(evidence, slip) {
  once("evidence", evidence.name, () => {
    $("pname").textContent = evidence.name;
    $("probability").setAttribute("aria-label", evidence.name);
  });
  $("pnow").textContent = evidence.now;
  $("pfrom").textContent = evidence.from;
  $("slipnow").textContent = slip;
}
