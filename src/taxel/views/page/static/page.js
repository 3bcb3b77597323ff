// The operator's page: joins the wire, the drawing and the keys. It holds no state of the gripper.

import { Cameras, QUIET_MS, drawHand, drawMap, fingers } from "./images.js";
import { OUTCOMES, REACTIONS, Voice, doing, drawDoing, drawPerson, drawPlan, wirePerson } from "./doing.js";
import { wireKeys } from "./keys.js";
import { Link } from "./link.js";
import { $, drawAlarms, drawAnswers, drawGripper, drawLatency, drawNumber, drawPills, drawRecording, drawState, drawStreams, make, show, toast } from "./panels.js";
import { colours, probabilityTrace, sensorTrace } from "./plots.js";
import { Replay } from "./replay.js";
import { Sound } from "./sound.js";
import { Freshness, ageWords, alarmedSince, duration, evidence, slipWords, shown, sounding } from "./state.js";

const TABLES_MS = 250; // Tables of figures change at most so often: faster cannot be read.
const fresh = new Freshness();
const sound = new Sound($("sound"));
const voice = new Voice($("voice"));
const cameras = new Cameras($("cameras"));
let snapshot = null;
let traces = null; // the newest map and time
let lastTime = -Infinity;
let sensorTime = -Infinity;
let probability = null;
let sensors = null;
let arrayKey = "";
let hand = null;
let touchMs = -Infinity; // when the array's newest row came
let dirty = false;
let tablesMs = -Infinity;

const link = new Link({
  push(message) {
    if (message.failed) {
      fresh.failed = message.failed;
      return;
    }
    fresh.connected = true;
    fresh.failed = "";
    snapshot = message.snapshot;
    fresh.take(snapshot.time_s, performance.now());
    takeTraces(message.traces);
    dirty = true;
    watch(); // at once: a hidden page gets no animation frames, but must still sound
  },
  image(camera, blob) {
    cameras.take(camera, blob, performance.now());
  },
  other(message) {
    if (message.overview) replay.take(message.overview);
    if (message.refused) toast(`Refused: ${message.refused}`);
    if (message.reason) toast(`Not done: ${message.reason}`);
  },
  gone(reason) {
    fresh.connected = false;
    fresh.failed = reason;
    fresh.forget();
    watch();
  },
});
const replay = new Replay(say);
wirePerson(say);

function say(command) {
  if (!link.say(command)) toast("Not sent: there is no connection.");
}

function takeTraces(next) {
  if (!next) return;
  if (next.time_s < lastTime) {
    probability?.clear();
    probability?.forget();
    sensors?.clear();
    sensorTime = -Infinity;
  }
  lastTime = next.time_s ?? lastTime;
  const newest = next.sensors?.t?.at(-1);
  if (newest > sensorTime) { // rows that come again are not the present
    sensorTime = newest;
    touchMs = performance.now();
  }
  const map = next.map ?? traces?.map ?? null;
  traces = { ...next, map };
  layOut();
  probability?.add(next.probability?.t || [], [next.probability?.p || []], lastTime);
  probability?.mark(next.events || [], snapshot.thresholds, lastTime);
  sensors?.add(next.sensors?.t || [], next.sensors?.values || [], lastTime);
}

/** Show the panels that apply, and make their charts. */
function layOut() {
  const array = snapshot.array;
  const eyes = snapshot.cameras || [];
  show($("cameras"), eyes.length > 0);
  cameras.arrange(eyes);
  show($("touch"), Boolean(array));
  show($("sensors"), Boolean(array));
  show($("probability"), !snapshot.replay && !snapshot.plan);
  show($("alarms"), !snapshot.replay && !snapshot.plan);
  const verdicts = (snapshot.answers || []).length > 0 || snapshot.gripper;
  show($("verdicts"), Boolean(verdicts));
  show($("right"), Boolean(eyes.length || array || verdicts));
  if (!probability && !snapshot.replay) probability = probabilityTrace($("probability").querySelector(".chart"));
  if (probability) probability.bare = snapshot.state === "NONE";
  const key = JSON.stringify(array);
  if (array && key !== arrayKey) {
    arrayKey = key;
    hand = fingers(array.channels);
    show($("handpanel"), hand !== null);
    $("maprows").textContent = array.rows || 12;
    $("handscale").textContent = `% of ${array.scale || "full scale"}`;
    const inks = colours(array.channels, hand !== null);
    $("sensorsname").textContent = `${array.name}, ${array.unit}`;
    const names = hand || array.channels.slice(0, 12);
    $("legend").replaceChildren(
      ...names.map((name, i) => {
        const item = make("span", "", name);
        const dot = make("i");
        dot.style.background = hand ? inks[i * 3 + 1] : inks[i];
        item.prepend(dot);
        return item;
      }),
    );
    const place = $("sensors").querySelector(".chart");
    place.replaceChildren();
    sensors = sensorTrace(place, array.channels, inks);
  }
}

/** Decide what may be claimed, show it and sound it: on every push and ten times a second. */
function watch() {
  const now = performance.now();
  const view = shown(fresh, snapshot, now);
  let since = "";
  if (!["LOST", "REPLAY", "PLAN"].includes(view.kind) && Number.isFinite(snapshot.since_s)) {
    since = `for ${duration(snapshot.time_s - snapshot.since_s)}`;
  }
  if (view.kind === "HAND") {
    const age = ageWords((snapshot.answers || [])[0], snapshot.time_s);
    since = age && `answered ${age}`;
  }
  drawState(view, since);
  sound.want(sounding(view, snapshot), now, alarmedSince(snapshot));
  const advice = doing(view, snapshot);
  drawDoing(advice, snapshot);
  voice.want(advice, now);
  const still = view.kind === "REPLAY" || view.kind === "LOST";
  cameras.describe(now, still);
  describeTouch(now, still);
}

/** Say across map and hand that no values come: what they show is then not the present. */
function describeTouch(now, still) {
  if (!snapshot?.array) return;
  const age = now - touchMs;
  let text = "";
  if (!Number.isFinite(touchMs)) text = still ? "" : "NO VALUES YET";
  else if (!still && age > Math.max(QUIET_MS, 1000 * (snapshot.array.gap_s || 0))) text = `NO NEW VALUES FOR ${duration(age / 1000)}`;
  if ($("touchnote").textContent !== text) $("touchnote").textContent = text;
  $("touch").classList.toggle("silent", text !== "");
}

function draw() {
  requestAnimationFrame(draw);
  if (!dirty || !snapshot) return;
  dirty = false;
  const now = performance.now();
  drawAlarms(snapshot.alarms || [], snapshot.time_s);
  drawPerson(snapshot.trial);
  drawPlan(snapshot.plan);
  drawNumber(evidence(snapshot), slipWords(snapshot.slip));
  probability?.draw();
  sensors?.draw();
  replay.draw(snapshot.replay, now);
  const map = traces?.map;
  if (map && map.length && snapshot.array) {
    drawMap($("map"), map, snapshot.array.channels);
    if (hand) drawHand($("hand"), map[map.length - 1], hand);
  }
  drawRecording(snapshot.recording);
  if (now - tablesMs < TABLES_MS) return;
  tablesMs = now;
  $("clock").textContent = new Date().toLocaleTimeString("en-GB");
  drawPills(snapshot);
  drawStreams(snapshot.sources || [], snapshot.consumers || []);
  drawLatency(snapshot.latency_ms || {});
  drawAnswers(snapshot.answers || [], snapshot.time_s);
  drawGripper(snapshot.gripper ?? null);
  show($("health"), ["streams", "latency", "recording"].some((id) => !$(id).hidden));
  fieldsFor(snapshot.label_fields || ["object", "session", "operator"]);
}

function fieldsFor(names) {
  const key = names.join();
  if ($("labels").dataset.key === key) return;
  $("labels").dataset.key = key;
  $("labels").replaceChildren(
    ...names.map((name) => {
      const label = make("label", "", name);
      const field = make("input");
      Object.assign(field, { name, maxLength: 64, type: "text" });
      label.append(field);
      return label;
    }),
  );
}

function record() {
  const on = !snapshot?.recording?.on;
  const labels = {};
  for (const field of $("labels").querySelectorAll("input")) {
    const value = field.value.trim();
    if (on && value) labels[field.name] = value;
  }
  say({ do: "record", on, labels });
}

function acknowledge() {
  if (!$("acknowledge").disabled && !$("alarms").hidden) say({ do: "acknowledge" });
}

/** The safe direction only, and never held back by what this page believes: it may be out of date. */
function disarm() {
  if (snapshot?.gripper || snapshot?.plan) say({ do: "disarm" });
}

/** Show only what to do, to be read from two metres; or all again. */
function onlyDoing() {
  const on = document.body.classList.toggle("doing");
  $("watch").setAttribute("aria-pressed", String(on));
  $("watch").replaceChildren(on ? "Show all " : "What to do ", make("kbd", "", "W"));
}

function letter(key) {
  if (snapshot?.plan?.asks && key === "Enter") return { do: "step", what: "ready" };
  const named = [...REACTIONS, ...OUTCOMES].find(([, , own]) => own === key.toUpperCase());
  return snapshot?.trial && named ? { do: "react", what: named[0] } : null;
}

$("watch").addEventListener("click", onlyDoing);
$("acknowledge").addEventListener("click", acknowledge);
$("disarm").addEventListener("click", disarm);
$("recordform").addEventListener("submit", (event) => {
  event.preventDefault();
  record();
});
$("help").addEventListener("click", () => $("helpbox").showModal());
wireKeys({ acknowledge, disarm, record: () => snapshot?.recording && record(), mute: () => sound.toggle(), speak: () => voice.toggle(), onlyDoing, letter, say, help: () => $("helpbox").showModal(), replay });
addEventListener("resize", () => (dirty = true)); // pictures are drawn anew, also when nothing comes
setInterval(watch, 100);
watch();
draw();
link.open();
