"""The values that pass between stages: samples, frames, what a sensor is, validity, marks.

Knows nothing about files, models or where samples come from.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from enum import IntFlag

import numpy as np
from numpy.typing import NDArray


class Validity(IntFlag):
    """Why a value may not be trusted; 0 is a good value. Flags add up."""

    GOOD = 0
    MISSING = 1
    """No value was received for this scan."""
    STALE = 2
    """The value is older than the time grid allows."""
    SATURATED = 4
    """The value stands at an end of the converter's range."""
    RECONNECTING = 8
    """The device was being reconnected."""
    NOT_FINITE = 16
    """The value is NaN or infinite."""


UNUSABLE = Validity.MISSING | Validity.STALE | Validity.RECONNECTING | Validity.NOT_FINITE
"""Flags under which a value says nothing at all; a saturated one still says "at least"."""

ROUNDING_S = 0.0005
"""A row that is shown may come so much sooner than the next is due, seconds: times of 100 Hz are
not 0.01 s apart to the last bit, and a board's clock may run a little faster than this machine's.
Our choice, docs/decisions/0003."""

PAUSE = "pause_s"
"""Name of the detail by which a camera says how long it sends nothing after a grasp, seconds."""
GRASPS = "grasps"
"""Name of the detail by which a camera says how its grasps begin: `FOUND`, or by key or mark."""
FOUND = "found"
"""By the images, which begin with untouched gels."""
ROLE, SCENE = "role", "scene"
"""Name and value of the detail by which a camera says that it looks on instead of feeling."""
CODING, JPEG, DEPTH_PNG = "coding", "jpeg", "png16"
"""Name and values of the detail that says how a camera's images are coded: JPEG unless given, or
depth as PNG of 16 bits."""
LONGEST_PAUSE_S = 2.0
"""Longer pauses are not believed, seconds. Source: our choice, docs/decisions/0031."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorInfo:
    """What a sensor array is, as its driver or its recording's manifest says."""

    name: str
    """Short name, used as the topic in recordings, such as "teng"."""
    channels: tuple[str, ...]
    """One name a column of `Samples.values`, in order."""
    units: tuple[str, ...]
    """One unit a channel, such as "V", "deg" or "count"."""
    rate_hz: float
    """Nominal scans a second, hertz; the measured rate is in the recording's statistics."""
    full_scale: float | None = None
    """The value at which the converter saturates, in the channels' unit; None where unknown."""
    serial: str = ""
    """The device's serial number, or the simulator's name and version."""
    details: Mapping[str, str] = field(default_factory=dict)
    """Anything else worth keeping, such as wiring and simulator parameters."""

    def __post_init__(self) -> None:
        if len(self.channels) != len(self.units):
            raise ValueError(
                f"needed one unit a channel; got channels: {len(self.channels)}, "
                f"units: {len(self.units)}"
            )

    def only(self, channels: tuple[str, ...] | None) -> SensorInfo:
        """Return the same array with some of its channels, in the order given.

        Raises:
            ValueError: There is no such channel.
        """
        if channels is None:
            return self
        index = self.indices(channels)
        return replace(self, channels=channels, units=tuple(self.units[i] for i in index))

    def indices(self, channels: tuple[str, ...]) -> list[int]:
        """Return the columns of channels named.

        Raises:
            ValueError: There is no such channel.
        """
        for name in channels:
            if name not in self.channels:
                raise ValueError(f"needed channels among {', '.join(self.channels)}; got {name!r}")
        return [self.channels.index(name) for name in channels]


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraInfo:
    """What a camera is, tactile or beside touch, as its driver or its recording's manifest says."""

    name: str
    """Short name, such as "left"; used as the topic in recordings."""
    width: int
    """Pixels a row."""
    height: int
    """Rows."""
    rate_hz: float
    """Nominal frames a second, hertz; the measured rate is in the recording's statistics."""
    mm_per_px: float | None = None
    """Size of a pixel on the gel, millimetres; None where unknown."""
    serial: str = ""
    """The device's serial number, or the simulator's name and version."""
    details: Mapping[str, str] = field(default_factory=dict)
    """Anything else worth keeping, such as exposure and simulator parameters."""

    @property
    def finds_grasps(self) -> bool:
        """True where each grasp's start is to be found in the images."""
        return self.details.get(GRASPS) == FOUND

    @property
    def simulated(self) -> bool:
        """True where a simulator made the images, live or in a recording."""
        return self.serial.startswith("sim://")

    @property
    def scene(self) -> bool:
        """True for a camera that looks on; models are never shown its images."""
        return self.details.get(ROLE) == SCENE

    @property
    def coding(self) -> str:
        """How its images are coded: `JPEG`, or `DEPTH_PNG`."""
        return DEPTH_PNG if self.details.get(CODING) == DEPTH_PNG else JPEG

    @property
    def pause_s(self) -> float:
        """How long it sends nothing after a mark that ends a grasp, seconds: by `PAUSE` in its
        details; 0 for one that streams on, as real ones do, and where the detail is no number.
        """
        try:
            stated_s = float(self.details.get(PAUSE, "0"))
        except ValueError:
            return 0.0
        return min(stated_s, LONGEST_PAUSE_S) if stated_s > 0 else 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """One image of one camera, as it came, not yet decoded."""

    camera: int
    """Which camera of the source or recording, from 0."""
    jpeg: bytes
    """The image as JPEG (of a camera whose `coding` is `DEPTH_PNG`: that); `taxel.frame_codec`
    decodes it."""
    counter: int
    """The device's own frame counter; -1 where it has none."""
    device_s: float
    """The device's clock, seconds since its boot; NaN where it has none."""
    arrival_s: float
    """The host's monotonic clock when the frame arrived, seconds."""
    fitted_s: float
    """Best estimate of when the frame was taken, host monotonic, seconds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Samples:
    """A run of scans from one sensor array, oldest first.

    A scan is one reading of all channels. All arrays share their first axis.
    """

    values: NDArray[np.float32]
    """Shape (n, channels), in the unit that `SensorInfo` gives for each channel."""
    counter: NDArray[np.int64]
    """Shape (n,): the device's own scan counter; -1 where the device has none."""
    device_s: NDArray[np.float64]
    """Shape (n,): the device's clock, seconds since its boot; NaN where it has none."""
    arrival_s: NDArray[np.float64]
    """Shape (n,): the host's monotonic clock when the scan arrived, seconds."""
    fitted_s: NDArray[np.float64]
    """Shape (n,): best estimate of when the scan was taken, host monotonic, seconds."""
    validity: NDArray[np.uint8]
    """Shape (n, channels): `Validity` flags."""

    def __post_init__(self) -> None:
        if self.values.ndim != 2:
            raise ValueError(f"needed values of shape (n, channels); got {self.values.shape}")
        n, channels = self.values.shape
        for name in ("counter", "device_s", "arrival_s", "fitted_s"):
            if getattr(self, name).shape != (n,):
                raise ValueError(f"needed {name} of shape ({n},); got {getattr(self, name).shape}")
        if self.validity.shape != (n, channels):
            raise ValueError(f"needed validity of shape {(n, channels)}; got {self.validity.shape}")

    def __len__(self) -> int:
        return int(self.values.shape[0])

    def only(self, columns: list[int]) -> Samples:
        """Return the same scans with some of their channels."""
        return replace(self, values=self.values[:, columns], validity=self.validity[:, columns])

    def __getitem__(self, part: slice | NDArray[np.bool_] | NDArray[np.intp]) -> Samples:
        """Return the scans that a slice, a mask or an index array selects."""
        return Samples(
            values=self.values[part],
            counter=self.counter[part],
            device_s=self.device_s[part],
            arrival_s=self.arrival_s[part],
            fitted_s=self.fitted_s[part],
            validity=self.validity[part],
        )

    @property
    def usable(self) -> NDArray[np.bool_]:
        """Shape (n, channels): True where the value may be used."""
        flags: NDArray[np.bool_] = (self.validity & np.uint8(UNUSABLE)) == 0
        return flags

    @staticmethod
    def empty(channels: int) -> Samples:
        """Return no scans of a given number of channels."""
        return Samples.from_values(np.zeros((0, channels), np.float32), np.zeros(0))

    @staticmethod
    def from_values(
        values: NDArray[np.floating], time_s: NDArray[np.float64], full_scale: float | None = None
    ) -> Samples:
        """Wrap plain values taken at known times, as imports and tests have them.

        Values that are not finite, or masked, are flagged NOT_FINITE; values at or beyond
        `full_scale` are flagged SATURATED. The counter is the row number.

        Args:
            values: Shape (n, channels).
            time_s: Shape (n,), seconds; becomes device, arrival and fitted time.
            full_scale: Where the converter saturates, in the values' unit.

        Raises:
            ValueError: A shape is another, or the times are dates instead of seconds.
        """
        if np.asarray(time_s).dtype.kind in "mM":
            raise ValueError("needed time_s as seconds; got dates or spans of time")
        if isinstance(values, np.ma.MaskedArray):
            values = np.ma.filled(values.astype(np.float64), np.nan)
        with np.errstate(over="ignore"):  # beyond 32 bits is infinite, and flagged
            values32 = np.ascontiguousarray(values, dtype=np.float32)
        time = np.ascontiguousarray(time_s, dtype=np.float64)
        return Samples(
            values=values32,
            counter=np.arange(len(values32), dtype=np.int64),
            device_s=time,
            arrival_s=time,
            fitted_s=time,
            validity=flag_values(values32, full_scale),
        )

    @staticmethod
    def join(parts: Iterable[Samples]) -> Samples:
        """Return the scans of several runs one after another.

        Raises:
            ValueError: There are no parts, or their channel counts differ.
        """
        runs = list(parts)
        if len({run.values.shape[1] for run in runs}) != 1:
            raise ValueError("needed runs of the same channels to join; got none, or others")
        return Samples(
            values=np.concatenate([run.values for run in runs]),
            counter=np.concatenate([run.counter for run in runs]),
            device_s=np.concatenate([run.device_s for run in runs]),
            arrival_s=np.concatenate([run.arrival_s for run in runs]),
            fitted_s=np.concatenate([run.fitted_s for run in runs]),
            validity=np.concatenate([run.validity for run in runs]),
        )


def flag_values(values: NDArray[np.float32], full_scale: float | None) -> NDArray[np.uint8]:
    """Return the flags that can be read off the values alone, shape (n, channels)."""
    flags = np.zeros(values.shape, np.uint8)
    flags[~np.isfinite(values)] |= np.uint8(Validity.NOT_FINITE)
    if full_scale is not None:
        with np.errstate(invalid="ignore"):
            flags[values >= np.float32(full_scale)] |= np.uint8(Validity.SATURATED)
    return flags


@dataclass(frozen=True, slots=True, kw_only=True)
class SlipNote:
    """The slip that a monitor measured at one moment, as it was reported live."""

    time_s: float
    """When the newest frame behind it was taken, fitted clock, seconds."""
    who: str
    """Which monitor."""
    values: Mapping[str, float | bool | None]
    """slip_mm, slip_rate_mm_s, slip_compliance, the standard deviation of each, slip_seen."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Mark:
    """A labelled stretch of time: one grasp, one sign, one trial.

    Written by simulators and people, never by a model.
    """

    start_s: float
    """First moment that belongs to the trial, on the samples' fitted clock, seconds."""
    end_s: float
    """Last moment that belongs to the trial, same clock, seconds."""
    labels: Mapping[str, str]
    """What may be learned: shape, material, sign, object …"""
    groups: Mapping[str, str] = field(default_factory=dict)
    """What must not be split: session, grasp, file … and nuisances such as force_n."""

    def within(self, groups: Collection[str]) -> Mark:
        """Return the mark without the groups that a person named for the whole recording: these go
        before what a source, such as a simulator, says of each trial.

        Args:
            groups: Their names.
        """
        own = {name: value for name, value in self.groups.items() if name not in groups}
        return replace(self, groups=own)
