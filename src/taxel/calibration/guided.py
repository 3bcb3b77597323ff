"""Presses on request: the terminal asks for each, the recorder keeps all, marks say which.

The source is read on a thread of its own, so that nothing is lost while a person types.
Knows nothing about curves or the command line.

Background of our choices: docs/decisions/0022.
"""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.calibration.baseline import smoothed
from taxel.calibration.presses import LARGEST_FORCE_N
from taxel.clock import Clock
from taxel.errors import BadInput, BadSource, TaxelError
from taxel.recordings.manifest import Manifest
from taxel.recordings.writer import Recorder
from taxel.signals import Mark, Samples, SensorInfo
from taxel.sources.contract import Source

REST_S = 3.0
"""Untouched at the beginning: the noise that a press has to stand out from, seconds."""
_SILENCE_S = 5.0
"""A source that delivers nothing for so long is given up, seconds. As `taxel record`."""
_KEPT_S = 120.0
"""How far back a press is looked for, seconds: someone may take their time to type."""
_SEEN_SIGMAS = 8.0
"""A press stands out by so many noises of the smoothed signal. Our choice."""
_EDGE_SHARE = 0.1
"""A press goes from where it rises above this share of its height to where it falls below."""
_MARGIN_S = 0.05
"""Added before and after, seconds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AskedPress:
    """One press that is asked for."""

    channel: int
    force_n: float
    rising: bool
    round: int


def asked_presses(
    channels: Sequence[int], forces_n: Sequence[float], rounds: int
) -> list[AskedPress]:
    """Return the presses to ask for: each sensor, each round, forces up and down again."""
    return [
        AskedPress(channel=channel, force_n=force_n, rising=rising, round=number + 1)
        for channel in channels
        for number in range(rounds)
        for rising in (True, False)
        for force_n in sorted(forces_n, reverse=not rising)
    ]


def record_presses(
    source: Source,
    path: Path,
    asked: Sequence[AskedPress],
    ask: Callable[[str], str],
    say: Callable[[str], None],
    clock: Clock,
    overwrite: bool = False,
) -> int:
    """Record the source to `path`, ask for each press and mark it; return how many were made.

    At each question a person presses, lets go, and types what the gauge showed in newtons;
    an empty answer stands for the force that was asked for, s leaves the press out, q ends.

    Args:
        source: Open.
        path: The recording to be: raw, whatever becomes of the calibration.
        asked: What to ask for.
        ask: Shows a question and returns the answer; EOFError ends as q does.
        say: Shows a line.
        clock: Waited on.
        overwrite: Replace an existing recording.

    Raises:
        BadSource: The source fell silent or ended.
        BadInput: The recording exists.
        RecordingFailed: The disk refused.
    """
    manifest = Manifest.started_now(source.info, cameras=source.cameras)
    marked = 0
    with Recorder(path, manifest, overwrite=overwrite) as recorder:
        with _Listener(source, recorder) as listener:
            say(f"hands off for {REST_S:g} s")
            noise_v = _noise(listener, source.info, clock)
            for number, press in enumerate(asked, 1):
                mark = _one(listener, source.info, press, noise_v, ask, say,
                            f"{number} of {len(asked)}")  # fmt: skip
                if mark is None:
                    break
                if mark.labels:
                    recorder.mark(mark)
                    marked += 1
            _wait(listener, clock, 1.0)  # the rest after the last press
        recorder.close("cleanly")
    return marked


class _Listener:
    """Reads a source into a recorder until its block is left; keeps the newest scans."""

    def __init__(self, source: Source, recorder: Recorder) -> None:
        self._source, self._recorder = source, recorder
        self._recent: deque[Samples] = deque()
        self._lock = threading.Lock()
        self._ending = threading.Event()
        self._error: BaseException | None = None
        self._newest_s = math.nan
        self._thread = threading.Thread(target=self._run, name="taxel-listener", daemon=True)

    def __enter__(self) -> _Listener:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ending.set()
        self._thread.join()

    @property
    def newest_s(self) -> float:
        """Fitted time of the newest scan; NaN before the first.

        Raises:
            BadSource: The source fell silent or ended.
        """
        if self._error is not None:
            raise self._error
        return self._newest_s

    def since(self, start_s: float) -> Samples | None:
        """Return the scans from a moment on; None where there are none."""
        self.newest_s  # noqa: B018  # raises what the thread met
        with self._lock:
            kept = [part for part in self._recent if part.fitted_s[-1] >= start_s]
        if not kept:
            return None
        joined = Samples.join(kept)
        return joined[joined.fitted_s >= start_s]

    def _run(self) -> None:
        quiet = 0.0
        try:
            while not self._ending.is_set():
                samples = self._source.read(0.1)
                for frame in self._source.frames():
                    self._recorder.frame(frame)
                if len(samples):
                    quiet = 0.0
                    self._recorder.write(samples)
                    self._keep(samples)
                    continue
                quiet += 0.1
                if self._source.ended or quiet >= _SILENCE_S:
                    raise BadSource(
                        "a source that goes on delivering scans",
                        "its end" if self._source.ended else f"nothing for {_SILENCE_S:g} s",
                        "check the cable and the device's power",
                    )
        except (TaxelError, OSError, ValueError) as error:
            self._error = error

    def _keep(self, samples: Samples) -> None:
        with self._lock:
            self._recent.append(samples)
            self._newest_s = float(samples.fitted_s[-1])
            while self._newest_s - self._recent[0].fitted_s[-1] > _KEPT_S:
                self._recent.popleft()


def _wait(listener: _Listener, clock: Clock, seconds: float) -> None:
    """Wait until so much of the source's time has passed."""
    start_s = listener.newest_s
    while True:
        newest_s = listener.newest_s
        if math.isnan(start_s):
            start_s = newest_s
        if newest_s - start_s >= seconds:
            return
        clock.sleep(0.02)


def _noise(listener: _Listener, info: SensorInfo, clock: Clock) -> NDArray[np.float64]:
    """Return each channel's noise at rest, shape (channels,)."""
    _wait(listener, clock, REST_S)
    rest = listener.since(listener.newest_s - REST_S)
    assert rest is not None, "scans came while it waited"
    smooth = smoothed(np.where(rest.usable, rest.values, np.nan), info.rate_hz)
    return np.asarray(smooth.std(axis=0))


def _one(
    listener: _Listener,
    info: SensorInfo,
    press: AskedPress,
    noise_v: NDArray[np.float64],
    ask: Callable[[str], str],
    say: Callable[[str], None],
    place: str,
) -> Mark | None:
    """Return the mark of one press; one without labels where it was left out, None for the end."""
    name = info.channels[press.channel]
    while True:
        start_s = listener.newest_s
        try:
            answer = ask(
                f"{place}: press {name} with {press.force_n:g} N, let go; gauge showed "
                f"(Enter: {press.force_n:g}, s: leave out, q: end): "
            ).strip()
        except EOFError:
            return None
        if answer == "q":
            return None
        if answer == "s":
            return Mark(start_s=0.0, end_s=0.0, labels={})
        try:
            force_n = _force(answer, press.force_n)
        except BadInput as error:
            say(str(error))
            continue
        samples = listener.since(start_s)
        interval_s = None if samples is None else find_press(
            samples, press.channel, info.rate_hz, float(noise_v[press.channel])
        )  # fmt: skip
        if interval_s is None:
            say(f"no press seen on {name}; once more, after the question")
            continue
        labels = {
            "sensor": name,
            "force_n": f"{force_n:g}",
            "direction": "up" if press.rising else "down",
            "round": str(press.round),
        }
        return Mark(start_s=interval_s[0], end_s=interval_s[1], labels=labels)


def find_press(
    samples: Samples, channel: int, rate_hz: float, noise: float
) -> tuple[float, float] | None:
    """Return where the largest press of a channel starts and ends, fitted seconds; None where
    nothing stands out, or it had begun before the first scan.

    Args:
        samples: Scans that begin at rest.
        channel: Which column.
        rate_hz: Scans a second.
        noise: Standard deviation of the smoothed signal at rest, in the channel's unit.
    """
    smooth = smoothed(np.where(samples.usable, samples.values, np.nan)[:, [channel]], rate_hz)[:, 0]
    peak = int(np.argmax(smooth))
    # Touched for less than half of the time: the median is the rest.
    lower = smooth[smooth <= np.median(smooth)]
    height = float(smooth[peak] - np.median(lower))
    if height <= max(_SEEN_SIGMAS * noise, 1e-9):
        return None
    above = smooth - np.median(lower) > max(_EDGE_SHARE * height, 4.0 * noise)
    first = peak - int(np.argmin(above[peak::-1])) if not above[: peak + 1].all() else -1
    if first < 0:
        return None
    after = above[peak:]
    last = peak + int(np.argmin(after)) if not after.all() else len(above) - 1
    time_s = samples.fitted_s
    return (
        max(float(time_s[first]) - _MARGIN_S, float(time_s[0])),
        min(float(time_s[last]) + _MARGIN_S, float(time_s[-1])),
    )


def _force(answer: str, asked_n: float) -> float:
    if not answer:
        return asked_n
    try:
        force_n = float(answer.replace(",", ".").removesuffix("N").strip())
    except ValueError:
        force_n = math.nan
    if not 0 < force_n <= LARGEST_FORCE_N:
        raise BadInput(
            f"newtons above 0 and up to {LARGEST_FORCE_N:g}", repr(answer), "type a number"
        )
    return force_n
