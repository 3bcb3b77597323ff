// The fleet's table, asked for once a second. Text of stations is only ever set as text.

const AGAIN_MS = 1000;
const WAIT_MS = 3000; // An answer that takes longer is none: what is shown would pass for the present.
const rows = document.getElementById("rows");
const state = document.getElementById("state");

/** Exchange the key behind the # for a cookie and take it out of the address bar. */
async function enter() {
  const key = location.hash.slice(1);
  if (!key) return;
  await fetch("/enter", { method: "POST", body: key, signal: AbortSignal.timeout(WAIT_MS) });
  history.replaceState(null, "", location.pathname); // Only now: without an answer it is needed again.
}

function cell(text, kind = "") {
  const made = document.createElement("td");
  made.textContent = text;
  made.className = kind;
  return made;
}

/** Return how long ago something was, such as "4 s ago" or "30 h ago". */
function ago(seconds) {
  for (const [unit, size] of [["d", 86400], ["h", 3600], ["min", 60]]) {
    if (seconds >= 2 * size) return `${Math.floor(seconds / size)} ${unit} ago`;
  }
  return `${Math.round(seconds)} s ago`;
}

function row(station) {
  const made = document.createElement("tr");
  made.dataset.presence = station.presence;
  const alarms = (station.alarms || []).map((alarm) => alarm.text).join("; ");
  const sources = (station.sources || []).map((one) => `${one.name} ${one.state}`).join(", ");
  made.append(
    cell(station.station), cell(station.presence, "presence"),
    cell([station.state, station.reason].filter(Boolean).join(": ")), cell(alarms), cell(sources),
    cell(station.lost ?? "", "n"), cell(station.age_s === null ? "not yet" : ago(station.age_s), "n"),
    cell(station.version || ""),
  );
  made.title = (station.bundles || []).join("\n");
  return made;
}

function showState(text, lost) {
  state.textContent = text;
  state.className = lost ? "lost" : "";
}

async function look() {
  try {
    await enter();
    const answer = await fetch("/fleet.json", { signal: AbortSignal.timeout(WAIT_MS) });
    if (!answer.ok) {
      showState("needed the key: open the address that taxel printed", true);
      return;
    }
    const fleet = await answer.json();
    rows.replaceChildren(...fleet.stations.map(row));
    const many = `${fleet.stations.length} station${fleet.stations.length === 1 ? "" : "s"}`;
    const parts = [`${many}, broker ${fleet.broker.address}`];
    if (!fleet.broker.connected) parts.push(fleet.broker.why);
    if (fleet.beyond) parts.push("TABLE FULL: further stations are not shown");
    if (fleet.refused) parts.push(`messages refused: ${fleet.refused}`);
    showState(parts.join("; "), !fleet.broker.connected || fleet.beyond > 0);
  } catch {
    showState("taxel fleet does not answer: what is shown is old", true);
  }
}

/** Ask again once the answer is there or given up: never twice at a time. */
async function follow() {
  await look();
  setTimeout(follow, AGAIN_MS);
}

follow();
