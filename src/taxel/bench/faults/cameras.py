"""What happens when a tactile camera freezes, goes away or lags, for `taxel bench faults`.

Emulated cameras behind the real capture processes, shared memory and watchers, in real time; their
images are those of the simulated gel. Knows nothing about goals of other faults.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence

from taxel.bench.rows import Row, row
from taxel.live.camera_health import CameraHealth
from taxel.signals import Frame
from taxel.sources.camera_emulation import (
    CameraFault,
    EmulatedCamera,
    EmulatedPair,
    FaultKind,
    gel_images,
)
from taxel.sources.cameras.source import Cameras

RATE_HZ = 25.0
"""Of a stock GelSight Mini, frames a second."""
ROUNDS = 3
_FIRST = 65
"""Frame at which the fault begins: 2.6 s after power came, well after opening and learning."""
_LASTING = 100
_LOOK_S = 0.002
"""Between two looks of the watcher, as often as the live path looks at least."""
_LIMIT_S = 12.0


def camera_rows() -> list[Row]:
    """Measure the three faults of cameras; takes about 20 s.

    Raises:
        MissingExtra: The simulator, whose images are shown, is not installed.
    """
    images = (gel_images(40, 0), gel_images(40, 1))
    doubted: list[str] = []
    frozen = [_until_frozen(images, number, doubted) for number in range(ROUNDS)]
    gone = [_until_gone(images, number) for number in range(ROUNDS)]
    behind_s = _behind(images)
    example = f"such as: {doubted[0]}" if doubted else "a busy processor can cause some"
    process = f"worst of {ROUNDS} rounds through real capture processes at {RATE_HZ:g} Hz"
    return [
        row(
            "camera frozen: frames until the watcher doubts it (UNKNOWN)", max(frozen), "frames",
            "<=", 3, process,
        ),
        Row(
            name="cameras well: moments doubted", value=float(len(doubted)), unit="moments",
            note=f"in {ROUNDS} rounds, before the fault; {example}",
        ),
        row(
            "camera gone: time until the watcher doubts it (UNKNOWN)", max(gone), "s", "<=", 0.1,
            process,
        ),
        row(
            "one camera 2 frames late: reported", float("right" in behind_s), "1 = yes", ">=", 1,
            f"{2 / RATE_HZ * 1e3:.0f} ms late, shown as {behind_s.get('right', 0.0) * 1e3:.0f} ms",
        ),
    ]  # fmt: skip


def _open(
    images: Sequence[tuple[bytes, ...]], fault: CameraFault | None, number: int = 0
) -> Cameras:
    """Return two cameras, of which the right one has the fault."""
    faults = () if fault is None else (fault,)
    names = (f"left-{number}", f"right-{number}")  # the name seeds the jitter
    bodies = {
        names[0]: EmulatedCamera(images=images[0], rate_hz=RATE_HZ),
        names[1]: EmulatedCamera(images=images[1], rate_hz=RATE_HZ, faults=faults),
    }
    return Cameras(",".join(names), {}, EmulatedPair(bodies))


def _fault(kind: FaultKind) -> CameraFault:
    return CameraFault(kind=kind, first=_FIRST, frames=_LASTING)


def _until_frozen(images: Sequence[tuple[bytes, ...]], number: int, doubted: list[str]) -> float:
    """Return how many frames without a new image came before that was reported.

    What is doubted while both cameras are well is added to `doubted`.
    """
    with _open(images, _fault("frozen"), number) as source:
        repeated, seen = 0, set()
        for frame, new, doubt in _watch(source):
            if frame is not None:
                seen.add(frame.camera)
            if doubt and not repeated and len(seen) == 2:
                doubted.append(doubt)
            if frame is not None and frame.camera == 1:
                repeated = 0 if new else repeated + 1
            if doubt == "the right camera is frozen":
                return float(repeated)
    return float("inf")


def _until_gone(images: Sequence[tuple[bytes, ...]], number: int) -> float:
    """Return the time from the last frame of a camera that was unplugged until it was reported."""
    with _open(images, _fault("gone"), number) as source:
        last_s = 0.0
        for frame, _, doubt in _watch(source):
            if frame is not None and frame.camera == 1:
                last_s = frame.arrival_s
            if doubt.startswith("the right camera is gone"):
                return time.monotonic() - last_s
    return float("inf")


def _behind(images: Sequence[tuple[bytes, ...]]) -> dict[str, float]:
    """Return which cameras are reported as late where the right one is two frames behind."""
    fault = CameraFault(kind="late", first=0, frames=10**6, late_s=2.0 / RATE_HZ)
    found: dict[str, float] = {}
    with _open(images, fault) as source:
        health = CameraHealth(source.cameras)
        until_s = time.monotonic() + _LIMIT_S
        while not found and time.monotonic() < until_s:
            source.read(0.05)
            for frame in source.frames():
                health.see(frame)
            found = health.late()
    return found


def _watch(source: Cameras) -> Iterator[tuple[Frame | None, bool, str]]:
    """Yield each frame with whether its image is new and what is doubted; also where none came."""
    health = CameraHealth(source.cameras)
    until_s = time.monotonic() + _LIMIT_S
    while time.monotonic() < until_s:
        source.read(_LOOK_S)
        for frame in source.frames():
            new = health.see(frame)
            yield frame, new, health.doubt(frame.arrival_s)
        yield None, False, health.doubt(time.monotonic())
