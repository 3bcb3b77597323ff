"""Why the state of a grasp is not known: every reason once, what it means, what to do.

All words that are shown beside UNKNOWN or NO GRASP are made here, so that the page of reference
(docs/reference/unknown.md, by `python -m taxel.decisions.reasons`) is complete, and a test can
hold the software to it. Knows nothing about cameras, clocks or screens.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property

_FIELD = re.compile(r"\{([a-z_]+)[^}]*\}")
_TEXT = re.compile(r"\{[^}]*\}")
SIMULATED = "simulated: "
"""Before the words where a simulator makes the fault on purpose."""


@dataclass(frozen=True)
class Reason:
    """One reason."""

    words: str
    """What is shown, with {fields}."""
    means: str
    """What is the case."""
    do: str
    """What a person can do about it."""

    def say(self, **fields: object) -> str:
        """Return the words with their fields filled in."""
        return self.words.format(**fields)

    @cached_property
    def _pattern(self) -> re.Pattern[str]:
        parts = _TEXT.split(self.words)
        return re.compile(".*".join(map(re.escape, parts)), re.DOTALL)

    def fits(self, text: str) -> bool:
        """True for words that this reason made."""
        return self._pattern.fullmatch(text) is not None


REASONS: dict[str, Reason] = {
    "no input": Reason(
        "no input yet",
        "The monitor runs; no pair of frames has reached it since it was started.",
        "Wait a second. If it stays, check on the page whether the source is live.",
    ),
    "settling": Reason(
        "learning the settled grasp, {left_s:.1f} s left",
        "A grasp begins. All later moments are compared with its first ones.",
        "Hold still and wait; after a false start press n for a new grasp.",
    ),
    "window": Reason(
        "filling the window, {left_s:.1f} s left",
        "The settled grasp is known; the model's window is not full yet.",
        "Wait.",
    ),
    "evidence": Reason(
        "weighing the first answers, {left_s:.1f} s left",
        "The model answers; a state is shown once its answers have agreed for long enough, "
        "also after lost input.",
        "Wait. If it stays, the answers contradict each other: look at the number on the page.",
    ),
    "no grasp yet": Reason(
        "no grasp has been found yet",
        "Grasps are found in the images, and none has been found so far. The state is NO GRASP: no "
        "grip is raised or lowered, and it is not a fault.",
        "Nothing: the first grasp is found by itself. Press n if an object is held already.",
    ),
    "grasp over": Reason(
        "the grasp has ended: nothing is held",
        "The source reported that a grasp is over. The state is NO GRASP: no grip is raised or "
        "lowered, and it is not a fault.",
        "Nothing: the next frames begin the next grasp.",
    ),
    "source over": Reason(
        "the source has ended",
        "A recording or a simulation is over: nothing is watched any more.",
        "End with q, or start again.",
    ),
    "no frame yet": Reason(
        "the {camera} camera has sent no frame yet",
        "The other camera sends frames, this one has not begun.",
        "Check its cable; run taxel doctor.",
    ),
    "gone": Reason(
        "the {camera} camera is gone: no frame for {silent_ms:.0f} ms",
        "No frame came for 80 ms, or for 2.2 frame periods of a slow camera.",
        "Check its cable and hub; on a loaded machine, close other programs.",
    ),
    "frozen": Reason(
        "the {camera} camera is frozen",
        "Frames come, but with exactly the same image, byte by byte, for longer than 2.6 of the "
        "camera's own image periods. After “simulated:” the simulator does this on purpose.",
        "Unplug the camera and plug it in again. If its driver repeats images, lower its rate.",
    ),
    "bad image": Reason(
        "the {camera} camera's image cannot be used: {why}",
        "A frame is no JPEG, is cut short, has another size than the camera, or a coding that "
        "cameras do not send; it was not decoded.",
        "Check cable and hub; in a replay, check where the recording comes from.",
    ),
    "slip lost": Reason(
        "the slip over the {camera} gel cannot be followed",
        "For 0.2 s its image has shown no imprint or no dots that fit the settled grasp (covered, "
        "dark, nothing held any more), or its camera's clock was set back or stands still. An "
        "alarm that is on stays on.",
        "Look at the picture of that gel; once it can be seen, press n for a new grasp.",
    ),
    "exchanged": Reason(
        "the {camera} camera's image is not that of this grasp",
        "Three images in a row show another light at their left and right border, which touch "
        "does not change so: the image was mirrored, turned or moved, or is another gel's. An "
        "alarm that is on stays on. Small shifts and turns are not noticed.",
        "Bring the earlier image back; or set the gripper down and press n for a new grasp.",
    ),
    "unusable": Reason(
        "the images cannot be used",
        "The frames of this window were flagged as unusable.",
        "Look at what else is reported about the cameras.",
    ),
    "old": Reason(
        "the newest input is {age_s:.2f} s old",
        "Frames come later than 0.2 s after they were taken, or the monitor lags behind.",
        "Close other programs; look at the latencies on the page.",
    ),
    "unchanged": Reason(
        "the input has not changed for {same_s:.2f} s",
        "The model gave exactly the same number, to the last bit, for too long.",
        "Check that the camera delivers new images.",
    ),
    "no time": Reason(
        "the input has no time",
        "A frame's time is NaN or infinite.",
        "Check the source: its clock cannot be used.",
    ),
    "time stepped back": Reason(
        "the input's time stepped back",
        "A frame is older than the one before it: a clock was set, or a device was restarted.",
        "Nothing: the new clock is used from the next frame on.",
    ),
    "nan": Reason(
        "the model gave NaN",
        "The network's answer is not a number.",
        "Start the monitor again; check the bundle with taxel info.",
    ),
    "no probability": Reason(
        "the model gave no number within 0 and 1",
        "The model's answer is neither a probability nor a score.",
        "Start the monitor again; check the bundle with taxel info.",
    ),
    "monitor ended": Reason(
        "{who} has ended",
        "The monitor's process died. Shown as STOP.",
        "It is restarted automatically; arm again once the state is STABLE.",
    ),
    "monitor silent": Reason(
        "{who} has not answered for {silent_s:.2f} s",
        "The monitor's process gives no sign of life: it hangs, or the machine is too busy. Shown "
        "as STOP.",
        "Close other programs; a monitor that hangs is restarted after 5 s.",
    ),
    "monitor mute": Reason(
        "{who} lives and decides nothing",
        "The monitor sends signs of life, but no decision for 0.3 s. Shown as STOP.",
        "Restart taxel; please report it with the log.",
    ),
    "long step": Reason(
        "{who} is in a step that takes long",
        "The monitor announced that its present step takes long, such as learning the settled "
        "grasp; its last decision is too old to be shown.",
        "Wait a second.",
    ),
    "alarm": Reason(
        "an alarm about lost input is on",
        "The monitor reports STABLE, but an alarm about lost input is still on: STABLE is not "
        "shown.",
        "Look at the alarms.",
    ),
    "no word": Reason(
        "the monitor gave no word that is known",
        "A monitor of another version sent a state that this version does not know.",
        "Install one version everywhere.",
    ),
    "no station": Reason(
        "the station says nothing",
        "The page runs; the station has sent it nothing yet.",
        "Wait a second. If it stays, start the station again.",
    ),
    "no state": Reason(
        "the station gave no state",
        "The page got a state that it does not know.",
        "Reload the page; install one version everywhere.",
    ),
    "recording": Reason(
        "a recording: nothing is judged",
        "The page shows a recording; no monitor runs.",
        "Use taxel live with the recording as its source.",
    ),
}
"""Name → reason. The words of the operator's page, written in static/state.js, are checked
against it by a test."""


def in_words(who: str) -> str:
    """Return a monitor's name in a station as a person knows it.

    "monitor 2/0" → "the monitor of source 2"; a further bundle in one process is named too.
    """
    process, slash, bundle = who.partition("/")
    if not slash:
        return who
    kind, _, source = process.partition(" ")
    name = f"the {kind} of source {source}" if source else f"the {kind}"
    return name if bundle == "0" else f"bundle {int(bundle) + 1} of {name}"


def kind_of(text: str) -> str | None:
    """Return the name of the reason that made some words; None where none did.

    Of several that fit, the one with the most fixed letters.
    """
    if not text:
        return None
    bare = text.removeprefix(SIMULATED)
    found = [name for name, reason in REASONS.items() if reason.fits(bare)]
    return max(found, key=lambda name: len(_FIELD.sub("", REASONS[name].words)), default=None)


def reference() -> str:
    """Return the page of reference, as Markdown."""
    rows = [
        f"| {_FIELD.sub(_in_italics, reason.words)} | {reason.means} | {reason.do} |"
        for reason in REASONS.values()
    ]
    return "\n".join([_HEAD, *rows, ""])


def _in_italics(field: re.Match[str]) -> str:
    return f"*{field[1]}*"


_HEAD = """# Why a state is UNKNOWN

Beside UNKNOWN (and NO GRASP) the page and the terminal show the reason, for how long it has lasted,
and what still works, where that is known. This page lists every reason. Fields are in italics,
times in seconds unless marked ms. While any of these reasons applies, STABLE is never shown, and
the interlock only holds the grip.

*This page is written by `python -m taxel.decisions.reasons > docs/reference/unknown.md`.*

| shown | what it means | what to do |
|---|---|---|"""


if __name__ == "__main__":
    print(reference(), end="")
