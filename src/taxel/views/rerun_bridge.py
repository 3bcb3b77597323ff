"""Stream a station to a Rerun viewer, from a process of its own.

It reads the station's rings, whose writers never wait: a slow viewer, which stalls whoever logs
to it, stalls nobody but this process, and what it has missed it has missed. Knows nothing about
sensors.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from time import sleep
from typing import Any

import numpy as np

from taxel.errors import MissingExtra
from taxel.image_head import is_sound
from taxel.live.station.packets import Packet, unpack
from taxel.live.station.page_link import ViewConfig
from taxel.live.station.recording import apart
from taxel.live.station.ring import RingReader
from taxel.live.station.worker import Place, Pulse, at_work
from taxel.signals import DEPTH_PNG, ROUNDING_S, Frame, Samples

_PAUSE_S = 0.02
_MOST = 64
"""Messages of a ring taken at once: older ones are dropped by the ring, not queued here."""
_ROW_S = 0.01
"""Time between logged rows of an array. Source: the common grid, docs/decisions/0003."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RerunJob:
    """The job of the process that streams a station to Rerun."""

    place: Place
    view: ViewConfig
    save: Path | None = None
    """Write a file instead of opening a viewer."""


def stream(job: RerunJob) -> None:
    """Stream until asked to end; the entry point of the process.

    Raises:
        MissingExtra: rerun-sdk is not installed.
    """
    with at_work(job.place) as pulse:
        try:
            import rerun
        except ModuleNotFoundError as error:
            raise MissingExtra("rerun-sdk", "rerun", "a Rerun viewer") from error
        rerun.init("taxel")
        if job.save is not None:
            rerun.save(job.save)
        else:
            rerun.spawn()
        pulse.report("opened")
        bridge = _Bridge(rerun, job.view)
        try:
            while not pulse.stopping:
                bridge.follow(pulse)
                pulse.beat()
                sleep(_PAUSE_S)
            bridge.follow(pulse)
        finally:
            bridge.close()
            rerun.disconnect()


class _Bridge:
    """Logs what the rings hold."""

    def __init__(self, rerun: Any, view: ViewConfig) -> None:
        self._rerun = rerun
        self._view = view
        names = apart([camera for source in view.sources for camera in source.cameras])
        self._cameras = [camera.name for camera in names]
        self._arrays = [array.name for array in apart([seen.sensor for seen in view.sources])]
        self._sources = [RingReader(source.ring) for source in view.sources]
        self._decisions = [RingReader(name) for name in view.decisions]
        self._row_s = [-np.inf] * len(view.sources)
        self._words: dict[str, str] = {}
        """The state that each grasp monitor gave last."""

    def follow(self, pulse: Pulse) -> None:
        first = 0
        for number, (seen, reader) in enumerate(
            zip(self._view.sources, self._sources, strict=True)
        ):
            for content in reader.take()[-_MOST:]:
                self._log(number, first, unpack(content))
            first += len(seen.cameras)
        for reader in self._decisions:
            for content in reader.take():
                self._decision(unpack(content))
        readers = (*self._sources, *self._decisions)
        pulse.consumed = sum(reader.taken for reader in readers)
        pulse.dropped = sum(reader.lost for reader in readers)

    def _log(self, number: int, first_camera: int, packet: Packet) -> None:
        rerun = self._rerun
        if isinstance(packet, Frame):
            seen = self._view.sources[number].cameras[packet.camera]
            if not is_sound(packet.jpeg, seen):
                return  # the viewer would decode it
            rerun.set_time("time", duration=packet.fitted_s)
            name = self._cameras[first_camera + packet.camera]
            kind = "image/png" if seen.coding == DEPTH_PNG else "image/jpeg"
            image = rerun.EncodedImage(contents=packet.jpeg, media_type=kind)
            rerun.log(f"cameras/{name}", image)
        elif isinstance(packet, Samples):
            usable = np.where(packet.usable, packet.values, np.nan)  # what is missing is no 0 V
            for time_s, values in zip(packet.fitted_s.tolist(), usable, strict=True):
                if time_s - self._row_s[number] >= _ROW_S - ROUNDING_S:
                    self._row_s[number] = time_s
                    rerun.set_time("time", duration=time_s)
                    path = f"arrays/{self._arrays[number]}"
                    rerun.log(path, rerun.Scalars(values.astype(np.float64)))

    def _decision(self, note: Packet) -> None:
        rerun = self._rerun
        if not isinstance(note, dict) or "time_s" not in note:
            return
        rerun.set_time("time", duration=note["time_s"])
        if note["kind"] == "answer":
            rerun.log(self._answers_of(note), rerun.TextLog(note["label"]))
        if note["kind"] != "grasp":  # such as a person's reaction
            return
        who, root = note["who"], self._grasp_of(note["who"])
        if note["p"] is not None:
            kind = "score" if note.get("is_score") else "probability"
            rerun.log(f"{root}/{kind}", rerun.Scalars([note["p"]]))
        if note.get("slip", {}).get("slip_seen"):
            rerun.log(f"{root}/slip_mm", rerun.Scalars([note["slip"]["slip_mm"]]))
            rerun.log(f"{root}/slip_rate_mm_s", rerun.Scalars([note["slip"]["slip_rate_mm_s"]]))
        if note["state"] != self._words.get(who):
            self._words[who] = note["state"]
            text = f"{note['state']} {note['reason']}".strip()
            rerun.log(f"{root}/state", rerun.TextLog(text))

    def _grasp_of(self, who: str) -> str:
        """Return where a monitor's decisions stand: by its name where there are several."""
        return f"grasp/{_part(who)}" if len(self._view.watchers) > 1 else "grasp"

    def _answers_of(self, note: dict[str, Any]) -> str:
        """Return where a recogniser's answers stand: by its name, too, where several share a
        target.
        """
        path = f"answers/{note['target']}"
        alike = [who for who, target in self._view.recognisers if target == note["target"]]
        return f"{path}/{_part(note['who'])}" if len(alike) > 1 else path

    def close(self) -> None:
        for ring in (*self._sources, *self._decisions):
            ring.close()


def _part(who: str) -> str:
    """Return a process's name as one part of a path."""
    return who.replace(" ", "-").replace("/", "-")
