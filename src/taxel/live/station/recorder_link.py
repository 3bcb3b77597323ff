"""The recorder as the supervisor sees it: its orders, its news, what it leaves undone.

Knows nothing about recordings' bytes.

Background of our choices: docs/decisions/0019 and 0046.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from taxel.live.station.guard import Guard
from taxel.live.station.packets import notes_of, pack
from taxel.live.station.ring import RingReader, RingWriter
from taxel.recordings.trial_log import GraspTrial, append_trial, log_of

_NOTHING: dict[str, Any] = {"on": False, "path": "", "seconds": 0.0, "bytes": 0, "error": ""}


class RecorderLink:
    """Orders to the recorder's process, and its news.

    Args:
        guard: Receives where a recording fails.
    """

    def __init__(self, guard: Guard) -> None:
        self._guard = guard
        self.newest = dict(_NOTHING)
        """The recorder's newest note."""
        self._to: RingWriter | None = None
        self._news: RingReader | None = None
        self._closing = False
        """True once no process is left that could log a grasp."""
        self._last: Path | None = None
        """The recording that was on when the station ended."""
        self._late: list[GraspTrial] = []

    def wire(self, to: RingWriter, news: RingReader) -> None:
        """Speak to the recorder from now on, and hear it."""
        self._to, self._news = to, news

    def begin(
        self, path: Path, labels: dict[str, str], groups: dict[str, str], *, overwrite: bool
    ) -> None:
        """Order a recording of all sources."""
        note = {"do": "record", "path": str(path), "labels": labels, "groups": groups,
                "overwrite": overwrite}  # fmt: skip
        self._order(note)

    def end(self) -> None:
        """Order that the recording under way is completed."""
        self._order({"do": "end"})

    def hear(self, now_s: float) -> list[dict[str, Any]]:
        """Take in the recorder's news, oldest first; return them."""
        news = [] if self._news is None else notes_of(self._news.take())
        for note in news:
            self.newest = note
            if note.get("error"):
                self._guard.trouble("recording", str(note["error"]), now_s)
            elif note.get("lost"):
                text = f"the recorder lost {note['lost']} messages"
                self._guard.trouble("recording", text, now_s)
        return news

    def snapshot(self) -> dict[str, Any]:
        """Return how the recording does, as the page's link gives it."""
        return {key: self.newest.get(key) for key in _NOTHING}

    def keep_slip(self, note: Mapping[str, Any]) -> None:
        """Have a monitor's slip recorded beside the frames, while a recording is on."""
        if self.newest.get("on") and "slip" in note:
            self._order({"do": "slip", "time_s": note["time_s"], "who": note["who"],
                         "slip": note["slip"]})  # fmt: skip

    def keep_trial(self, trial: GraspTrial) -> None:
        """Have a grasp's alarm, reaction and outcome logged beside the recording that is on."""
        if self._closing:  # nothing has to be in time any more
            self._late.append(trial)
        elif self.newest.get("on"):
            self._order({"do": "trial", "trial": asdict(trial)})

    def closing(self) -> None:
        """Hear that the recorder's process is about to end: grasps are logged by `close`."""
        self._closing = True
        self._last = Path(self.newest["path"]) if self.newest.get("on") else None

    def close(self) -> None:
        """Log the grasps that ended late; say so where the recorder left a file incomplete."""
        if self._last is not None:
            for trial in self._late:
                with contextlib.suppress(OSError):
                    append_trial(log_of(self._last), trial)
        if self.newest.get("on"):
            path = self.newest["path"]
            self.newest["error"] = (
                f"needed the recorder to complete {path}; got its end without that; "
                f"run: taxel recover {path}.part --output {path}."
            )

    def _order(self, note: dict[str, Any]) -> None:
        if self._to is not None:
            self._to.put(pack(note))
