"""What each press did to every channel: height above the baseline, speed, ghosts.

Knows nothing about curves, files or what the forces mean.

Background of our choices: docs/decisions/0022.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from taxel.calibration.baseline import RestLine, rest_blocks, rest_line, smoothed
from taxel.calibration.presses import Press, Reference, Script
from taxel.errors import BadDataset
from taxel.signals import Samples, Validity

Measure = Literal["peak", "plateau"]
"""peak: the highest smoothed value of a press, for sensors that answer to a change (a TENG's
voltage leaks away while the force stays). plateau: the median of its middle half, for sensors
that hold their value."""

_SETTLE_S = 1.0
"""After a press its channel is not at rest for this long, seconds: 5 time constants of 0.2 s.
Our choice."""
_BEFORE_S = 0.5
"""The baseline of a press is looked for in this long before it, seconds. Our choice."""
_LEAST_REST_S = 0.1
"""And needs so much of it; else the channel's line is taken. Our choice."""
_CLEAR = 20.0
"""A press has to stand this many times above the noise for its speed to be read. Our choice."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Responses:
    """All presses, in the script's order, and the channels' rest."""

    presses: tuple[Press, ...]
    height: NDArray[np.float64]
    """Shape (presses,): of the pressed channel above its baseline; NaN where a value in the
    press was unusable."""
    saturated: NDArray[np.bool_]
    """Shape (presses,): the converter was at its end, so the height says "at least"."""
    rise_s: NDArray[np.float64]
    """Shape (presses,): 10 to 90 % of the height, seconds; NaN where it is not clear. The
    gauge's own speed is in it."""
    fall_s: NDArray[np.float64]
    """Shape (presses,): time constant of the fall while the force stays, seconds; NaN where it is
    not clear, or where the signal falls with the release alone."""
    recovery_s: NDArray[np.float64]
    """Shape (presses,): from 90 to 10 % of the height after the peak, seconds; NaN where it is not
    clear, or not over when the press is. The gauge's own speed is in it."""
    ghost: NDArray[np.float64]
    """Shape (presses, channels): area of each channel as a share of the pressed one's."""
    lines: tuple[RestLine | None, ...]
    """One a channel; None where it never rests."""
    blocks: tuple[list[slice], ...]
    """One list a channel: its blocks of rest."""
    smooth: NDArray[np.float64]
    """Shape (n, channels): the smoothed signal."""


@dataclass(frozen=True, slots=True)
class _Signal:
    """One recording, as its presses are looked at."""

    samples: Samples
    smooth: NDArray[np.float64]
    """Shape (n, channels): the smoothed signal."""
    resting: NDArray[np.bool_]
    """Shape (n, channels): True where a channel is at rest."""
    lines: tuple[RestLine | None, ...]
    """One a channel; None where it never rests."""
    noise: list[float]
    """One a channel, as its values."""
    rate_hz: float
    """Scans a second, as measured."""


def measure_responses(
    samples: Samples, script: Script, rate_hz: float, measure: Measure = "peak"
) -> Responses:
    """Return what the presses did.

    Args:
        samples: One recording, whole.
        script: What was done to the array.
        rate_hz: Scans a second, as measured.
        measure: How a press becomes one number.

    Raises:
        BadDataset: A press lies outside the recording.
    """
    time_s = samples.fitted_s
    usable = samples.usable
    smooth = smoothed(np.where(usable, samples.values, np.nan), rate_hz)
    channels = samples.values.shape[1]
    resting = _resting(samples, script, channels)
    blocks = tuple(rest_blocks(resting[:, c], rate_hz) for c in range(channels))
    lines = tuple(_line(smooth[:, c], time_s, blocks[c]) for c in range(channels))
    noise = [_rms(smooth[:, c], blocks[c]) for c in range(channels)]
    signal = _Signal(samples, smooth, resting, lines, noise, rate_hz)
    responses = [_press(press, signal, measure) for press in script.presses]
    return Responses(
        presses=script.presses,
        height=np.array([response.height for response in responses]),
        saturated=np.array([response.saturated for response in responses], bool),
        rise_s=np.array([response.rise_s for response in responses]),
        fall_s=np.array([response.fall_s for response in responses]),
        recovery_s=np.array([response.recovery_s for response in responses]),
        ghost=np.array([response.ghost for response in responses]).reshape(
            len(responses), channels
        ),
        lines=lines,
        blocks=blocks,
        smooth=smooth,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _One:
    height: float
    saturated: bool
    rise_s: float
    fall_s: float
    recovery_s: float
    ghost: NDArray[np.float64]


def _resting(samples: Samples, script: Script, channels: int) -> NDArray[np.bool_]:
    """Return where each channel is at rest, shape (n, channels)."""
    time_s = samples.fitted_s
    resting = np.array(samples.usable)
    done: Sequence[Press | Reference] = [*script.presses, *script.references]
    for press in done:
        first, last = np.searchsorted(time_s, [press.start_s, press.end_s])
        resting[first:last] = False
        settled = int(np.searchsorted(time_s, press.end_s + _SETTLE_S))
        for channel in range(channels) if press.channel is None else (press.channel,):
            resting[first:settled, channel] = False
    return resting


def _line(
    smooth: NDArray[np.float64], time_s: NDArray[np.float64], blocks: list[slice]
) -> RestLine | None:
    if not blocks:
        return None
    at_s = np.array([float(time_s[block].mean()) for block in blocks])
    return rest_line(at_s, np.array([float(smooth[block].mean()) for block in blocks]))


def _rms(smooth: NDArray[np.float64], blocks: list[slice]) -> float:
    if not blocks:
        return math.nan
    return float(np.sqrt(np.mean([smooth[block].var() for block in blocks])))


def _press(
    press: Press,
    signal: _Signal,
    measure: Measure,
) -> _One:
    samples, smooth, rate_hz = signal.samples, signal.smooth, signal.rate_hz
    time_s = samples.fitted_s
    first, last = np.searchsorted(time_s, [press.start_s, press.end_s])
    if last - first < 5 or press.start_s < time_s[0] - 1.0 / rate_hz:
        raise BadDataset(
            "presses inside the recording",
            f"one from {press.start_s - time_s[0]:.3f} to {press.end_s - time_s[0]:.3f} s after "
            f"the first scan; the recording lasts {time_s[-1] - time_s[0]:.3f} s",
            "mend the times of the presses",
        )
    part = slice(int(first), int(last))
    base = np.array([_base(c, part, signal) for c in range(smooth.shape[1])])
    above = smooth[part] - base
    pressed = above[:, press.channel]
    peak = int(np.argmax(pressed))
    quarter = len(pressed) // 4
    height = float(
        pressed[peak] if measure == "peak" else np.median(pressed[quarter : len(pressed) - quarter])
    )
    end = np.uint8(Validity.SATURATED)
    high = samples.values[part, press.channel] > base[press.channel] + height / 2
    saturated = bool((((samples.validity[part, press.channel] & end) != 0) & high).any())
    if not samples[part].usable[:, press.channel].all():
        height = math.nan
    clear = height > _CLEAR * signal.noise[press.channel] and not saturated
    area = float(pressed.sum())
    ghost = above.sum(axis=0) / area if area > 0 else np.full(smooth.shape[1], np.nan)
    raw = samples.values[part, press.channel].astype(np.float64) - base[press.channel]
    return _One(
        height=height,
        saturated=saturated,
        rise_s=rise_s(raw, peak, float(pressed[peak]), rate_hz) if clear else math.nan,
        fall_s=_fall_s(pressed, peak, rate_hz) if clear else math.nan,
        recovery_s=recovery_s(raw, peak, float(pressed[peak]), rate_hz) if clear else math.nan,
        ghost=ghost if math.isfinite(height) else np.full(smooth.shape[1], np.nan),
    )


def _base(
    channel: int,
    part: slice,
    signal: _Signal,
) -> float:
    """Return the baseline of one channel at a press: just before it, or by its line."""
    time_s = signal.samples.fitted_s
    start_s = float(time_s[part.start])
    first = int(np.searchsorted(time_s, start_s - _BEFORE_S))
    # The smoothed signal begins to rise half a width before the press does.
    last = int(np.searchsorted(time_s, start_s - 0.02))
    quiet = signal.resting[first:last, channel]
    if quiet.any() and quiet.sum() >= _LEAST_REST_S / _BEFORE_S * len(quiet):
        return float(signal.smooth[first:last, channel][quiet].mean())
    line = signal.lines[channel]
    return 0.0 if line is None else float(line.at(start_s))


def rise_s(raw: NDArray[np.float64], peak: int, height: float, rate_hz: float) -> float:
    """Return the time from 10 to 90 %, between scans where they allow, seconds; NaN if unclear.

    Args:
        raw: One channel above its baseline, shape (n,), from before the press.
        peak: Index of its highest value.
        height: Of the press, in the channel's unit.
        rate_hz: Scans a second.
    """
    light = _light(raw)[: peak + 1]
    tenth = _crossing(light, 0.1 * height)
    most = _crossing(light, 0.9 * height)
    if not (math.isfinite(tenth) and math.isfinite(most)):
        return math.nan
    return max(most - tenth, 0.0) / rate_hz


def recovery_s(raw: NDArray[np.float64], peak: int, height: float, rate_hz: float) -> float:
    """Return the time from 90 to 10 % after the peak, seconds; NaN where it never falls so far.

    Args: as of `rise_s`, to after the release.
    """
    falling = _light(raw)[peak:]
    most, tenth = (_crossing(-falling, -share * height) for share in (0.9, 0.1))
    if not (math.isfinite(most) and math.isfinite(tenth)):
        return math.nan
    return max(tenth - most, 0.0) / rate_hz


def _light(raw: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the mean of each value and its neighbours."""
    return np.asarray(np.convolve(raw, np.ones(3) / 3.0, mode="same"), np.float64)


def _crossing(rising: NDArray[np.float64], level: float) -> float:
    """Return where a signal first reaches a level after last being below it, in scans."""
    reached = np.flatnonzero(rising >= level)
    if len(reached) == 0:
        return math.nan
    after = int(reached[0])
    if after == 0:
        return math.nan
    before, here = float(rising[after - 1]), float(rising[after])
    return after - 1 + (level - before) / max(here - before, 1e-12)


def _fall_s(own: NDArray[np.float64], peak: int, rate_hz: float) -> float:
    """Return the time constant from 95 to 60 % of the peak, seconds; NaN where that is the release.

    A force that stays cannot be seen. The fall is taken for the signal's own where it is over in
    the first half of the touch, or where what comes behind it is much steeper: the release.
    """
    after = own[peak:] / own[peak]
    starts, ends = np.flatnonzero(after < 0.95), np.flatnonzero(after < 0.6)
    if len(starts) == 0 or len(ends) == 0 or ends[0] <= starts[0]:
        return math.nan
    first, last = int(starts[0]), int(ends[0])
    begins = np.flatnonzero(own[: peak + 1] < 0.5 * own[peak])
    before = peak - int(begins[-1]) if len(begins) else 0
    over = int(np.flatnonzero(after > 0.1)[-1])
    early = before + last <= 0.5 * (before + over)
    steep = -np.diff(after)
    if not early and 2.0 * steep[first - 1 : last].max() > steep[last:].max(initial=0.0):
        return math.nan
    return float((last - first) / rate_hz / math.log(0.95 / 0.6))
