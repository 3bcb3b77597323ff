// The keyboard: every action has a key, none works while a person types a label.

export function wireKeys({ acknowledge, disarm, record, mute, help, replay }) {
  addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || event.repeat && !event.key.startsWith("Arrow")) return;
    if (document.querySelector("dialog[open]")) return;
    const at = event.target.closest?.("input, select, button, textarea");
    const typing = at && (at.type === "text" || at.tagName === "SELECT");
    if (typing) {
      if (event.key === "Escape") at.blur();
      return;
    }
    const act = action(event, at);
    if (!act) return;
    event.preventDefault();
    act();
  });

  function action(event, at) {
    const winding = replay.now !== null;
    switch (event.key) {
      case "a":
      case "A":
        return acknowledge;
      case " ":
        if (at && at.tagName === "BUTTON") return null; // it presses the button
        return winding ? () => replay.toggle() : acknowledge;
      case "d":
      case "D":
        return disarm;
      case "r":
      case "R":
        return record;
      case "m":
      case "M":
        return mute;
      case "?":
        return help;
      default:
        return winding ? wind(event) : null;
    }
  }

  function wind(event) {
    const step = event.shiftKey ? 1 : 0.1;
    switch (event.key) {
      case "ArrowLeft":
        return () => replay.step(-step);
      case "ArrowRight":
        return () => replay.step(step);
      case "Home":
        return () => replay.ends(false);
      case "End":
        return () => replay.ends(true);
      case "+":
      case "=":
        return () => replay.faster(1);
      case "-":
      case "−":
        return () => replay.faster(-1);
      default:
        return null;
    }
  }
}
