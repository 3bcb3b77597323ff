"""See which processes of a station have died or fallen silent; start them again, and say so.

Knows nothing about decisions, pages or recordings.

Background of our choices: docs/decisions/0019.
"""

from __future__ import annotations

from collections.abc import Callable

from taxel.live.station.beats import Beats, Work
from taxel.live.station.guard import Guard
from taxel.live.station.processes import ProcessGroup, Worker
from taxel.live.station.recorder_link import RECORDER, RecorderLink
from taxel.live.station.wiring import Wiring

_SILENT_S = 2.5
"""Silence of any process that is noted, seconds: a simulator may take one second for a grasp. Our
choice; of a monitor it is reported much earlier (`GuardConfig`)."""
_HUNG_S = 5.0
"""Silence after which a monitor's process is ended and started again, seconds. Our choice."""
_RECOGNISER_HUNG_S = 30.0
"""The same of a process of recognisers alone, beside the patience that it asked for. Our choice:
nothing urgent waits for them, and where other programs take most of the processor a look may take
ten times as long as usual."""


class ProcessWatch:
    """Looks after the processes of one station.

    Args:
        processes: The processes.
        wiring: Which of them watch a grasp.
        beats: Their signs of life.
        guard: Receives what is wrong.
        happened: Called with a moment and words for a person.
        recorder: Hears when the recorder's process ends, and when another one runs.
    """

    def __init__(
        self,
        processes: ProcessGroup,
        wiring: Wiring,
        beats: Beats,
        guard: Guard,
        happened: Callable[[float, str], None],
        recorder: RecorderLink,
    ) -> None:
        self._processes, self._wiring, self._beats = processes, wiring, beats
        self._guard, self._happened, self._recorder = guard, happened, recorder
        self._mute: set[str] = set()
        self._coming: list[Worker] = []

    def look(self, now_s: float) -> None:
        """See which processes have died; start them again."""
        for worker, how in self._processes.dead():
            for who in self._wiring.watchers_of(worker):
                self._guard.died(who)
            text = f"{worker.name} ended by {how}"
            again = self._processes.again(worker)
            if again:
                self._coming.append(worker)
            elif worker.once:
                text += ": given up, as it would begin anew"
            else:
                text += ", too often: given up"
            self._guard.trouble(worker.name, text, now_s)
            self._happened(now_s, text)
            if worker.name == RECORDER:
                self._recorder.ended(how, again, now_s)
        self._look_for_silence(now_s)
        for worker in list(self._coming):
            if self._beats.read(worker.row).work is Work.RUNNING:
                self._coming.remove(worker)
                self._guard.over(worker.name, now_s)
                if worker.name == RECORDER:
                    self._recorder.runs()
                for who in self._wiring.watchers_of(worker):
                    self._guard.expect(who, now_s)

    def _look_for_silence(self, now_s: float) -> None:
        """Report which processes are alive and silent; end one that decides and stays so."""
        silent = {worker.name: worker for worker in self._processes.silent(now_s, _SILENT_S)}
        for name in silent.keys() - self._mute:
            text = f"{name} has not answered for {_SILENT_S:g} s"
            self._guard.trouble(name, text, now_s)
            self._happened(now_s, text)
        for name in self._mute - silent.keys():
            self._guard.over(name, now_s)
        self._mute = set(silent)
        hung = [w for w in self._processes.silent(now_s, _HUNG_S) if self._wiring.watchers_of(w)]
        late = self._processes.silent(now_s, _RECOGNISER_HUNG_S)
        for worker in (*hung, *(worker for worker in late if self._wiring.decides(worker))):
            if worker.process is not None:
                worker.process.kill()
