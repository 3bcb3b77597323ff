// The keyboard: every action has a key, none works while a person types a label.

export function wireKeys({ acknowledge, disarm, record, mute, speak, onlyDoing, letter, say, help, replay }) {
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
      case "w":
      case "W":
        return onlyDoing;
      case "v":
      case "V":
        return speak;
      case "?":
        return help;
      default:
        return winding ? wind(event) : spoken(event, at);
    }
  }

  /** What a person did, or that they are ready: a key of its own each. */
  function spoken(event, at) {
    if (event.key === "Enter" && at && at.tagName === "BUTTON") return null; // it presses the button
    const command = letter(event.key);
    return command && (() => say(command));
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
