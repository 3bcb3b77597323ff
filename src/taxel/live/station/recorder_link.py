"""The recorder as the supervisor sees it: its orders, its news, what it leaves undone.

A recorder that dies in a recording leaves NAME.mcap.part, which `taxel recover` reads. The one
that follows goes on in NAME-2.mcap, with what the rings still hold. Knows nothing about
recordings' bytes.

Background of our choices: docs/decisions/0019 and 0046.
"""

from __future__ import annotations

import errno
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from taxel.live.station.guard import Guard
from taxel.live.station.packets import notes_of, pack
from taxel.live.station.ring import RingReader, RingWriter
from taxel.plain_text import number_of
from taxel.recordings.part_file import recover_command
from taxel.recordings.trial_log import GraspTrial, append_trial, log_of

RECORDER = "recorder"
"""Name of its process."""
NOT_RECORDING = "NOT RECORDING"
"""First words of the warning where a recording fails."""
_ALARM = "recording"
_FULL = (errno.ENOSPC, errno.EDQUOT)
_NOTHING: dict[str, Any] = {"on": False, "path": "", "seconds": 0.0, "bytes": 0, "error": ""}


class RecorderLink:
    """Orders to the recorder's process, and its news.

    Args:
        guard: Receives where a recording fails.
        happened: Called with a moment and words for a person.
    """

    def __init__(
        self, guard: Guard, happened: Callable[[float, str], None] = lambda *_: None
    ) -> None:
        self._guard = guard
        self._happened = happened
        self.newest = dict(_NOTHING)
        """The recorder's newest note."""
        self.incomplete: list[str] = []
        """Recordings that a dead recorder left: `taxel recover` completes them."""
        self._to: RingWriter | None = None
        self._news: RingReader | None = None
        self._asked: dict[str, Any] | None = None
        """The order to record that is in force; None once the recording has ended or failed."""
        self._begun: dict[str, Any] | None = None
        """The order that the recording under way follows."""
        self._ending = False
        """True once the end of that recording was ordered."""
        self._log: Path | None = None
        """Where the grasps of the recording under way are logged."""
        self._places: Any = None
        """Where the recorder stood in each ring when it had surely written all before."""
        self._broken = ""
        """How a recorder that died left its recording, until another goes on; else empty."""
        self._before: dict[str, Any] = {}
        """What a recorder that died said of its last recording, until another records."""
        self._reported = ""
        """The trouble that was reported last."""
        self._heard: list[dict[str, Any]] = []
        self._closing = False
        """True once no process is left that could log a grasp."""
        self._unlogged: deque[GraspTrial] = deque()
        """Grasps that the recorder has not yet said to be logged."""
        self._logged = 0
        """How many it has said to be."""

    def wire(self, to: RingWriter, news: RingReader) -> None:
        """Speak to the recorder from now on, and hear it."""
        self._to, self._news = to, news

    def begin(
        self, path: Path, labels: dict[str, str], groups: dict[str, str], *, overwrite: bool
    ) -> None:
        """Order a recording of all sources."""
        note = {"do": "record", "path": str(path), "labels": labels, "groups": groups,
                "overwrite": overwrite}  # fmt: skip
        if self._asked is None or self._ending:  # else the recorder heeds no second one
            self._asked, self._ending = note, False
        self._order(note)

    def end(self) -> None:
        """Order that the recording under way is completed."""
        self._ending = True
        self._order({"do": "end"})

    def hear(self, now_s: float) -> list[dict[str, Any]]:
        """Take in the recorder's news, oldest first; return them."""
        self._take_in(now_s)
        news, self._heard = self._heard, []
        return news

    def ended(self, how: str, again: bool, now_s: float) -> None:
        """Hear that the recorder's process has ended by itself, and whether another follows.

        Args:
            how: In words, such as "signal 9".
            again: True where another is being started.
            now_s: Monotonic seconds.
        """
        self._take_in(now_s)
        self._logged = 0
        if self._asked is not None:
            self._interrupt(self._asked, how, again, now_s)
        kept = ("path", "error", "not_written")
        self._before = {key: self.newest[key] for key in kept if key in self.newest}

    def _interrupt(self, asked: dict[str, Any], how: str, again: bool, now_s: float) -> None:
        """Report what the dead recorder left of the recording under way."""
        path, text = Path(asked["path"]), "was not begun"
        if self.newest.get("on"):
            path, text = Path(self.newest["path"]), "is not complete"
            self.incomplete.append(str(path))
        text = f"{path} {text}: its recorder ended by {how}"
        if str(path) in self.incomplete:
            text += f"; run: {recover_command(path)}"
        if again and not self._ending:
            text += "; another recorder goes on in a new file as soon as it runs"
        else:
            self._asked = None
        self._broken = text
        self.newest = {**self.newest, "on": False, "error": text}
        self._report(text, now_s)

    def runs(self) -> None:
        """Hear that the recorder that follows a dead one runs: it goes on with the recording."""
        if not self._broken or self._asked is None:
            return
        confirmed = self._log is not None
        log = str(self._log or log_of(Path(self._asked["path"])))
        again = {"log": log, "made": self.newest.get("made", 0), "places": self._places or []}
        overwrite = self._asked["overwrite"] and not confirmed
        self._order(self._asked | {"overwrite": overwrite, "again": again})
        for trial in self._unlogged:
            self._order({"do": "trial", "trial": asdict(trial)})

    def snapshot(self) -> dict[str, Any]:
        """Return how the recording does, as the page's link gives it."""
        return {key: self.newest.get(key) for key in _NOTHING}

    def keep_slip(self, note: Mapping[str, Any]) -> None:
        """Have a monitor's slip recorded beside the frames, while a recording is on."""
        if self.newest.get("on") and "slip" in note:
            self._order({"do": "slip", "time_s": note["time_s"], "who": note["who"],
                         "slip": note["slip"]})  # fmt: skip

    def keep_trial(self, trial: GraspTrial) -> None:
        """Have a grasp's alarm, reaction and outcome logged beside the recording that is on.

        Where the recorder has died, the one that follows logs it, or `close`.
        """
        if self._log is None:
            return
        self._unlogged.append(trial)
        if self.newest.get("on") and not self._closing:
            self._order({"do": "trial", "trial": asdict(trial)})

    def closing(self) -> None:
        """Hear that the recorder's process is about to end: grasps are logged by `close`."""
        self._closing = True

    def close(self) -> None:
        """Log the grasps that ended late; say so where that failed, or a file is incomplete."""
        refused: list[OSError] = []
        for trial in self._unlogged:
            if self._log is not None:
                try:
                    append_trial(self._log, trial)
                except OSError as error:
                    refused.append(error)
        if self.newest.get("on"):
            self.incomplete.append(self.newest["path"])
        if not self.incomplete and not refused:
            return
        own = [self.newest.get("error", "")]
        own = [error for error in own if error not in ("", self._broken)]
        errors = own + [
            f"needed the recorder to complete {path}; got its end without that; "
            f"run: {recover_command(Path(path))}."
            for path in self.incomplete
        ]
        if refused:
            room = ", and make room" if refused[-1].errno in _FULL else ""
            errors.append(
                f"needed to log {number_of(len(refused), 'grasp')} in {self._log}; got "
                f"{refused[-1].strerror}; note their outcome by hand{room}."
            )
        whole = not own and not self._broken and self.newest.get("path") not in self.incomplete
        self.newest = {**self.newest, "error": "\n".join(errors), "whole": whole}
        if self.incomplete:
            self.newest["incomplete"] = list(self.incomplete)

    def _take_in(self, now_s: float) -> None:
        for note in [] if self._news is None else notes_of(self._news.take()):
            self._heard.append(note)
            self._places = note.pop("places", self._places)
            self._forget_logged(int(note.get("logged", 0)))
            self._follow(note, now_s)
            self.newest = note if note.get("path") else note | self._before
            self._weigh(note, now_s)

    def _follow(self, note: dict[str, Any], now_s: float) -> None:
        """See whether a recording has begun, has ended, or goes on in another file."""
        if note.get("on"):
            asked = note["path"] if self._asked is None else self._asked["path"]
            self._begun, self._log = self._asked, log_of(Path(asked))
            if self._broken:
                self._broken = ""
                self._happened(now_s, f"the recording goes on in {note['path']}")
                if note["path"] != asked and asked not in self.incomplete:
                    self.incomplete.append(asked)  # begun, and not reported before it ended
        elif self.newest.get("on") or (note.get("error") and not self._broken):
            if self._asked is self._begun or note.get("error"):
                self._asked = None
            if not self._closing:
                self._log = None

    def _weigh(self, note: dict[str, Any], now_s: float) -> None:
        if note.get("error"):
            self._report(str(note["error"]), now_s)
        elif note.get("lost"):
            text = f"the recorder lost {number_of(note['lost'], 'message')}"
            self._guard.trouble(_ALARM, text, now_s)
            if not self._reported:  # the first of them; the alarm counts
                self._reported = text
                self._happened(now_s, text)
        elif note.get("on"):
            self._reported = ""
            self._guard.over(_ALARM, now_s)

    def _report(self, text: str, now_s: float) -> None:
        """Raise the alarm; say once what has happened."""
        self._guard.trouble(_ALARM, text, now_s)
        if text != self._reported:
            self._reported = text
            first = "" if self.newest.get("on") else f"{NOT_RECORDING}: "
            self._happened(now_s, f"{first}{text}")

    def _forget_logged(self, logged: int) -> None:
        while self._logged < logged:
            self._logged += 1
            if self._unlogged:
                self._unlogged.popleft()

    def _order(self, note: dict[str, Any]) -> None:
        if self._to is not None:
            self._to.put(pack(note))
