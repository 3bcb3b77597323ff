"""Rows of `taxel bench transitions` on how the gels shear: speed, and likeness to real gels.

Version 2 of the gel (docs/explanation/gel-shear.md) beside version 1 and real recordings.
Knows nothing about how rows are printed or stored.

Background of our choices: docs/decisions/0037.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from taxel.bench.rows import Row, missing, row

if TYPE_CHECKING:
    from taxel.evaluation.camera_trials.marker_residual import MarkerResidual
    from taxel.sim.pour.cup_pour import Gel

ROUNDS = 3
"""Times that a pour is rendered; the quickest counts."""
FIRST_CUP = 700
"""Of the simulated pours that are compared with real ones: none that others learn from."""
CUPS = 3
SECONDS = 6
"""Of a recording: a simulated pour's length, the same of each real trial."""
EVERY = 3
"""Frames of a real video from one that is looked at to the next: 8.3 a second of 25."""
PARTS = ("held", "slipped", "mostly a turn")
"""Which videos a row is on; the last, whether held or not."""
_TURN = 0.66
"""Share of a rigid movement that is a turn, from which it mostly is one. Source: our choice."""
_REFERENCE = 2
"""Frames whose median the movement is counted from, after the first one."""
_SPEED = """
import json, cv2
from time import perf_counter
cv2.setNumThreads(1)
from taxel.sim.pour.cup_pour import CupPourConfig, PourSim, list_runs
from taxel.sim.pour.gel_shear import follow
from taxel.sources.simulated.pour_sets import simulate_videos
taken = [0.0, 0.0, 0.0]
def timed(work):
    start = perf_counter()
    work()
    return perf_counter() - start
images = 0
for run in list_runs(CupPourConfig())[:12:3]:
    sim, holds = PourSim(run), []
    for _ in range(360):
        holds.append(sim.hold())
        sim.step(run.force_n, 1 / 60)
    rounds = []
    for _ in range(%d):
        videos = [simulate_videos(run, 25.0, 60.0, 6.0, gel)[1] for gel in (1, 2)]
        look = [timed(lambda: [sum(1 for _ in v.images) for v in pair]) for pair in videos]
        layers = PourSim(run).layers()
        rounds.append([*look, timed(lambda: follow(layers, holds))])
    images += sum(len(video.times.taken_s) for video in videos[0])
    taken = [t + min(r[i] for r in rounds) for i, t in enumerate(taken)]
print(json.dumps([images / taken[0], images / taken[1], images / (taken[1] + taken[2])]))
"""


def speed(child: Any) -> list[Row]:
    """Render the same pours with both versions by turns, in one process on one core.

    Args:
        child: Runs Python code in a process of its own and returns the JSON that it prints.
    """
    first, second, whole = child(_SPEED % ROUNDS)
    note = (
        f"{whole:.0f} against {first:.0f} images a second; {second:.0f} without the friction of "
        f"the layers, each pour the quickest of {ROUNDS} rounds, by turns"
    )
    name = "gel 2 over gel 1: rate of images, the layers' friction counted"
    return [row(name, whole / first, "ratio", ">=", 0.7, note)]


@dataclass(frozen=True, slots=True)
class ShearFound:
    """The residuals of one kind of videos."""

    videos: int
    """How many there are; fewer moved far enough to be judged."""
    residuals: list[MarkerResidual]

    def values(self, name: str) -> NDArray[np.float64]:
        """Return one quantity of all, shape (n,)."""
        return np.array([getattr(each, name) for each in self.residuals])

    def carried(self) -> NDArray[np.float64]:
        """Return the medians of what each band carries, shape (bands,); NaN where unknown."""
        from taxel.evaluation.camera_trials.marker_residual import BANDS

        shares = np.array([each.carried for each in self.residuals]).reshape(-1, len(BANDS))
        seen = np.isfinite(shares).any(axis=0)
        return np.array([np.nanmedian(column) if any_ else np.nan
                         for column, any_ in zip(shares.T, seen, strict=True)])  # fmt: skip


def residual_rows(data: Path | None) -> list[Row]:
    """Compare what a rigid movement leaves over, real and simulated.

    Args:
        data: Folder that holds gelsight-slip/.
    """
    name = "markers in contact, what a rigid movement leaves over"
    if data is None or not (data / "gelsight-slip").exists():
        return [missing(name, "share", "", "no recordings: name their folder with --data")]
    found = {"real": real_residuals(data)}
    found |= {"gel 1": simulated_residuals(1), "gel 2": simulated_residuals(2)}
    rows = []
    for kind, both in found.items():
        for what in PARTS:
            rows.append(_summary(f"{name}: {kind}, {what}", _part(both, what)))
    return rows + comparison_rows(found)


def comparison_rows(found: dict[str, dict[bool, ShearFound]]) -> list[Row]:
    """Return how far each version's spread and shape lie from the real ones, 2 over 1.

    A cup turns about its handle, whereas real objects are mostly pulled: those that turned, held
    or not, are the ones that simulated cups can be compared with.
    """
    from scipy.stats import wasserstein_distance

    rows = []
    for what in PARTS:
        real, *versions = (_part(found[kind], what) for kind in ("real", "gel 1", "gel 2"))
        if min(len(each.residuals) for each in (real, *versions)) < 2:
            continue
        spread = [float(wasserstein_distance(each.values("non_rigid"), real.values("non_rigid")))
                  for each in versions]  # fmt: skip
        shape = [float(np.nanmean(np.abs(each.carried() - real.carried()))) for each in versions]
        for part, (first, second) in (("spread", spread), ("shape", shape)):
            note = f"{second:.3f} over {first:.3f}"
            rows.append(row(f"distance to real gels, gel 2 over gel 1: {part}, {what}",
                            second / first, "ratio", "<=", 1.0, note))  # fmt: skip
    return rows


def _part(found: dict[bool, ShearFound], what: str) -> ShearFound:
    if what != "mostly a turn":
        return found[what == "slipped"]
    turned = [each for both in found.values() for each in both.residuals if each.turning > _TURN]
    return ShearFound(sum(both.videos for both in found.values()), turned)


def _summary(name: str, found: ShearFound) -> Row:
    if not found.residuals:
        return missing(name, "share", "", f"none of {found.videos} videos moved far enough")
    non_rigid, non_affine = found.values("non_rigid"), found.values("non_affine")
    low, high = np.percentile(non_rigid, [10, 90])
    carried = ", ".join(f"{share:.2f}" for share in found.carried())
    note = (
        f"10 to 90 %: {low:.2f} to {high:.2f}; after an affine one {np.median(non_affine):.2f}; "
        f"carried by distance {carried}; median movement {np.median(found.values('move_px')):.1f} "
        f"px, {np.median(found.values('turning')):.0%} a turn; "
        f"{len(found.residuals)} of {found.videos} videos"
    )
    return Row(name=name, value=float(np.median(non_rigid)), unit="share",
               note=note)  # fmt: skip


def real_residuals(data: Path) -> dict[bool, ShearFound]:
    """Return those of gelsight-slip's first cameras, by whether the object slipped."""
    from taxel.evaluation.camera_trials.marker_residual import marker_residual

    found: dict[bool, ShearFound] = {slipped: ShearFound(0, []) for slipped in (False, True)}
    for path in sorted((data / "gelsight-slip").glob("trials/*/*/camera_0.avi")):
        reference, frames = _split(islice(_frames(path), 0, SECONDS * 25, EVERY))
        _count(found, (path.parent / "slip.txt").exists(), marker_residual(reference, frames))
    return found


def simulated_residuals(gel: Gel) -> dict[bool, ShearFound]:
    """Return those of simulated pours' left cameras, by whether the cup slipped 300 µm."""
    from taxel.evaluation.camera_trials.marker_residual import marker_residual
    from taxel.frame_codec import decode_jpeg, encode_jpeg
    from taxel.sim.pour.cup_pour import CupPourConfig, list_runs
    from taxel.sources.simulated.pour_sets import simulate_videos

    found: dict[bool, ShearFound] = {slipped: ShearFound(0, []) for slipped in (False, True)}
    config = CupPourConfig(cups=CUPS, first_cup=FIRST_CUP, still=0.0)
    for run in list_runs(config):
        track, videos = simulate_videos(run, 25.0 / EVERY, 60.0, float(SECONDS), gel)
        seen = (decode_jpeg(encode_jpeg(image), videos[0].info) for image in videos[0].images)
        reference, frames = _split(seen)
        _count(found, bool(track.truth[-1, 0] > 300.0), marker_residual(reference, frames))
    return found


def _split(frames: Iterable[NDArray[np.uint8]]) -> tuple[list[NDArray[np.uint8]], Iterator[Any]]:
    """Return the settled first frames, and those after them."""
    rest = iter(frames)
    return list(islice(rest, 1, 1 + _REFERENCE)), rest


def _count(found: dict[bool, ShearFound], slipped: bool, residual: MarkerResidual | None) -> None:
    before = found[slipped]
    new = [] if residual is None else [residual]
    found[slipped] = ShearFound(before.videos + 1, before.residuals + new)


def _frames(path: Path) -> Iterator[NDArray[np.uint8]]:
    import cv2

    capture = cv2.VideoCapture(str(path))
    try:
        while True:
            read, bgr = capture.read()
            if not read:
                return
            yield np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB), np.uint8)
    finally:
        capture.release()
