"""Cups to learn a slip warning from and to judge it on: which, and where object and gel went.

Two ways to the same rows: `seen_pour` renders images, codes them as JPEG and follows them as a
live monitor would; `true_pours` takes the simulator's own poses at the moments when the cameras
took images, which is two orders of magnitude faster and has no noise yet (see
`taxel.training.slip.pose_noise`). Knows nothing about heads, thresholds or scores.

Source: docs/decisions/0036.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from taxel.frame_codec import decode_jpeg, encode_jpeg
from taxel.gel.ring_slip import RING_FEATURES
from taxel.gel.touch_poses import TouchFollower
from taxel.recordings.whole import write_whole
from taxel.sim.gelsight.mini import CameraTimes, camera_times
from taxel.sim.pour.cup_pour import CupPourConfig, Gel, PourTrack, list_runs
from taxel.sim.pour.cups import (
    FORCES_N,
    MOVING_KINDS,
    OTHER_KINDS,
    POSITIONS,
    Kind,
    PourRun,
    draw_cup,
    draw_run,
)
from taxel.sim.pour.grip_limits import GRAVITY_M_S2, load_ratio, pour_less
from taxel.sim.pour.pours_at_once import simulate_pours
from taxel.sim.pour.scene_draws import draw_grasp
from taxel.sim.pour.state import TRUTH_CHANNELS, GelMotion
from taxel.sources.simulated.pour_sets import (
    CAMERA_HZ,
    FINE,
    SimulatedVideo,
    motion_at,
    simulate_videos,
)
from taxel.windows.rest import SETTLE

TRAINING_CUPS: Final = range(30_000, 30_480)
"""Cups to learn from and to choose thresholds on. Source: our choice, fixed beforehand."""
NOISE_CUPS: Final = TRAINING_CUPS[:24]
"""Training cups of which a pour is rendered, to fit the noise of poses."""
TEST_CUPS: Final = range(40_000, 40_090)
"""Cups that nothing but the bench may look at. Source: our choice, fixed beforehand."""
SEED: Final = 0
FRAME_HZ: Final = 60.0
DURATION_S: Final = 6.0
GROSS_UM: Final = 300.0
"""Slip that is warned of, micrometres: the rule "gross-slip", docs/decisions/0013."""
AFTER_S: Final = 1.0
"""How long after the event images are still followed: a warning after that is none, seconds."""
_SUDDEN: Final[tuple[Kind, ...]] = ("bump", "late slip", *MOVING_KINDS)
_SLIP, _DROPPED = TRUTH_CHANNELS.index("slip"), TRUTH_CHANNELS.index("dropped")


@dataclass(frozen=True, slots=True)
class GelRows:
    """Where object and gel went in one camera's images."""

    taken_s: NDArray[np.float64]
    """Shape (images,): when each was taken, seconds since the grasp."""
    object: NDArray[np.float64]
    """Shape (images, 3): x, y (mm) and turn (rad) since the grasp, about the image's middle."""
    gel: NDArray[np.float64]
    """Shape (images, 3): the same of the gel in contact."""
    spread: NDArray[np.float64]
    """Shape (images, 3): standard deviation of object less gel by the fit, mm and rad."""
    seen: NDArray[np.bool_]
    """Shape (images,): False where poses could not be followed."""
    shown: NDArray[np.int64]
    """Shape (moments,): which image each moment of the video shows."""
    rim: NDArray[np.float64]
    """Shape (images, 3): as `gel`, around the contact's rim; of a rigid gel the same motion."""
    rings: NDArray[np.float64]
    """Shape (images, 18), as `taxel.gel.ring_slip.RING_FEATURES`; 0 where no image is rendered."""


@dataclass(frozen=True, slots=True)
class PourRows:
    """One pour: both gels, and what truly happened."""

    run: PourRun
    time_s: NDArray[np.float64]
    """Shape (moments,): since the grasp."""
    slip_um: NDArray[np.float64]
    """Shape (moments,)."""
    dropped: NDArray[np.bool_]
    """Shape (moments,)."""
    gels: tuple[GelRows, GelRows]

    def first_s(self, above_um: float) -> float | None:
        """Return when the slip first exceeds this or the cup is lost; None: never."""
        beyond = (self.slip_um > above_um) | self.dropped
        return float(self.time_s[int(np.argmax(beyond))]) if beyond.any() else None

    @property
    def drop_s(self) -> float | None:
        """When the cup is lost; None: never."""
        return float(self.time_s[int(np.argmax(self.dropped))]) if self.dropped.any() else None


def paper_runs(cup: int) -> list[PourRun]:
    """Return the paper's twelve pours into one cup: three positions, four forces."""
    return list_runs(CupPourConfig(seed=SEED, cups=1, first_cup=cup))


def paper_part(cup: int, part: int) -> list[PourRun]:
    """Return three of a cup's twelve pours, one a position, with other forces in each part, 0…3.

    The first parts of many cups say more than all parts of a few.
    """
    runs = paper_runs(cup)
    return [runs[4 * place + (place + part + cup) % 4] for place in range(3)]


def other_part(cup: int, part: int) -> list[PourRun]:
    """Return a pour of each other kind; positions and forces go round from cup to cup."""
    drawn, runs = draw_cup(SEED, cup), []
    for place, kind in enumerate(OTHER_KINDS):
        turn = cup + 7 * part + place
        position, force_n = POSITIONS[turn % 3], FORCES_N[turn // 3 % len(FORCES_N)]
        run = draw_run(SEED, drawn, position, force_n, kind, number=1 + part)
        runs.append(pour_less(run))
    return runs


def moving_part(cup: int) -> list[PourRun]:
    """Return a run of each kind in which the gripper moves or the cup is handed over.

    Positions and forces go round from cup to cup.
    """
    drawn, runs = draw_cup(SEED, cup), []
    for place, kind in enumerate(MOVING_KINDS):
        turn = cup + place
        position, force_n = POSITIONS[turn % 3], FORCES_N[turn // 3 % len(FORCES_N)]
        runs.append(draw_grasp(SEED, drawn, position, force_n, kind, number=20))
    return runs


def mild_bumps(cup: int, count: int = 3) -> list[PourRun]:
    """Return pushes that friction should just hold: most pushes of 4 to 14 N slip by themselves.

    Chosen by the limit surface alone, before anything is simulated: the largest load is 0.8 to
    1.3 of what the grip can hold at rest. Of such pushes false alarms are counted.

    Args:
        cup: Its number.
        count: At most so many; a cup may have fewer.
    """
    drawn, found = draw_cup(SEED, cup), []
    weight_n = drawn.mass_kg * GRAVITY_M_S2
    for number in range(10, 18):
        for position in POSITIONS:
            for force_n in FORCES_N:
                run = draw_run(SEED, drawn, position, force_n, "bump", number=number)
                peak = load_ratio(run, 0.0) * (weight_n + run.bump_n) / weight_n
                if 0.8 < peak < 1.3:
                    found.append(run)
    return found[:: max(1, len(found) // count)][:count]


def training_runs(cup: int) -> list[PourRun]:
    """Return what is simulated with a training cup: its pours, the other kinds, mild pushes."""
    return paper_runs(cup) + other_part(cup, 0) + other_part(cup, 1) + mild_bumps(cup)


def is_learned_from(pour: PourRows) -> bool:
    """Return whether a warning learns from a pour.

    Of pushes, sudden slips and grippers that move only those that hold: before the others there is
    nothing to learn, and what follows looks like a slip that ends well. Out of fold, leaving them
    out brings warnings 0.1 s earlier (decision 36); they are still judged.
    """
    return pour.run.kind not in _SUDDEN or pour.first_s(GROSS_UM) is None


def noise_runs(cup: int) -> list[PourRun]:
    """Return the pour of a training cup whose images are rendered, to fit the noise of poses."""
    pours = [run for run in paper_runs(cup) if run.kind == "pour"]
    return pours[cup % 3 :: 3][:1] or pours[:1]


def true_pours(runs: Sequence[PourRun]) -> list[PourRows]:
    """Return pours' exact poses at the moments when their cameras took images.

    The gels are rigid pieces; gels that shear are followed in images (`seen_pours`).
    """
    tracks = simulate_pours(runs, FRAME_HZ * FINE, DURATION_S)
    return [_true_rows(run, track) for run, track in zip(runs, tracks, strict=True)]


def _true_rows(run: PourRun, fine: PourTrack) -> PourRows:
    gels = []
    for side, motion in enumerate(fine.motions):
        times = camera_times(CAMERA_HZ, FRAME_HZ, DURATION_S, run.seed * 2 + side)
        gels.append(_gel_rows(motion_at(motion, fine.time_s, times.taken_s), times))
    return _pour_rows(run, fine, (gels[0], gels[1]))


def _pour_rows(run: PourRun, fine: PourTrack, gels: tuple[GelRows, GelRows]) -> PourRows:
    """Return a pour's rows at the video's moments.

    Args:
        run: What was tried.
        fine: Its track, `FINE` moments a frame of the video.
        gels: What the cameras see.
    """
    return PourRows(
        run=run,
        time_s=fine.time_s[::FINE],
        slip_um=fine.truth[::FINE, _SLIP],
        dropped=fine.truth[::FINE, _DROPPED] > 0,
        gels=gels,
    )


def seen_pour(run: PourRun, gel: Gel = 1) -> PourRows:
    """Return a pour's poses as they are followed in rendered, JPEG-coded images.

    Args:
        run: What is tried.
        gel: How the gels shear.
    """
    track, videos = simulate_videos(run, CAMERA_HZ, FRAME_HZ, DURATION_S, gel)
    last = _last_moment(track)
    rows = [_seen_rows(video, last) for video in videos]
    part = slice(0, last + 1)
    return PourRows(
        run=run,
        time_s=track.time_s[part],
        slip_um=track.truth[part, _SLIP],
        dropped=track.truth[part, _DROPPED] > 0,
        gels=(rows[0], rows[1]),
    )


def _gel_rows(motion: GelMotion, times: CameraTimes) -> GelRows:
    """Return the exact poses of one gel's motion at its camera's images."""
    count = len(times.taken_s)
    gel = gel_about_middle(motion)
    return GelRows(
        taken_s=times.taken_s,
        object=np.column_stack([motion.object_mm, motion.object_rad]),
        gel=gel,
        spread=np.zeros((count, 3)),
        seen=np.ones(count, np.bool_),
        shown=times.shown,
        rim=gel.copy(),
        rings=np.zeros((count, len(RING_FEATURES))),
    )


def _seen_rows(video: SimulatedVideo, last: int) -> GelRows:
    shown = video.times.shown
    images = [
        decode_jpeg(encode_jpeg(image), video.info) for image in _until(video, int(shown[last]) + 1)
    ]
    settled = sorted(set(shown[SETTLE].tolist()))
    follower = TouchFollower([images[i] for i in settled])
    poses, rims, rings = [], [], []
    for image in images:
        poses.append(follower.follow(image))
        rims.append(follower.rim())
        rings.append(follower.rings)
    to_mm = np.array([video.info.mm_per_px, video.info.mm_per_px, 1.0])
    return GelRows(
        taken_s=video.times.taken_s[: len(images)],
        object=np.stack([pose.object for pose in poses]) * to_mm,
        gel=np.stack([pose.gel for pose in poses]) * to_mm,
        spread=np.stack([pose.spread for pose in poses]) * to_mm,
        seen=np.array([pose.seen for pose in poses]),
        shown=shown[: last + 1],
        rim=np.stack(rims) * to_mm,
        rings=np.stack(rings),
    )


def by_rim(pours: Sequence[PourRows]) -> list[PourRows]:
    """Return pours whose gel's motion is that of the contact's rim."""
    found = []
    for pour in pours:
        first, second = (replace(rows, gel=rows.rim) for rows in pour.gels)
        found.append(replace(pour, gels=(first, second)))
    return found


def _until(video: SimulatedVideo, count: int) -> Iterator[NDArray[np.uint8]]:
    for index, image in enumerate(video.images):
        if index == count:
            return
        yield image


def _last_moment(track: PourTrack) -> int:
    """Return the last moment that matters: some time after the event."""
    beyond = (track.truth[:, _SLIP] > GROSS_UM) | (track.truth[:, _DROPPED] > 0)
    end = len(beyond) - 1
    return min(end, int(np.argmax(beyond)) + round(AFTER_S * FRAME_HZ)) if beyond.any() else end


def gel_about_middle(motion: GelMotion) -> NDArray[np.float64]:
    """Return the gel's rigid motion about the image's middle, shape (n, 3), mm and rad.

    The simulator gives it in the middle of the patch, which moves with the object.
    """
    cos, sin = np.cos(motion.gel_rad), np.sin(motion.gel_rad)
    x, y = (motion.gel_mm - motion.object_mm).T
    turned = np.stack([cos * x - sin * y, sin * x + cos * y], axis=1)
    return np.column_stack([motion.object_mm + turned, motion.gel_rad])


def seen_pours(runs: Sequence[PourRun], gel: Gel = 1) -> list[PourRows]:
    """Return pours' poses as they are followed in rendered, JPEG-coded images."""
    return [seen_pour(run, gel) for run in runs]


def keep_runs(
    path: Path,
    runs: Sequence[PourRun],
    follow: Callable[[Sequence[PourRun]], list[PourRows]] = seen_pours,
) -> list[PourRows]:
    """Return the poses of some runs; read from `path`, or followed and written there.

    Poses that an earlier version of taxel kept, or that are damaged, are found anew.

    Args:
        path: The file.
        runs: What is tried.
        follow: `seen_pours` or `true_pours`.

    Raises:
        RecordingFailed: The disk refused.
    """
    kept = _kept(path, runs)
    if kept is not None:
        return kept
    arrays: dict[str, NDArray[Any]] = {_STAMP: np.array(_VERSION)}
    for number, pour in enumerate(follow(runs)):
        arrays |= {f"{number}/{key}": value for key, value in _as_arrays(pour).items()}
    file = io.BytesIO()
    np.savez_compressed(file, **arrays)  # type: ignore[arg-type]
    write_whole(path, file.getvalue())
    return read_runs(path, runs)


def _kept(path: Path, runs: Sequence[PourRun]) -> list[PourRows] | None:
    """Return what a file holds; None where it is not there, damaged, or of an earlier version."""
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            if _STAMP not in stored.files or int(stored[_STAMP]) != _VERSION:
                return None
        return read_runs(path, runs)
    except Exception:  # what damage makes zip and NumPy raise has no common base
        return None


def read_runs(path: Path, runs: Sequence[PourRun]) -> list[PourRows]:
    """Return the pours that `keep_runs` has written."""
    with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
        arrays = dict(stored)
    return [_from_arrays(run, arrays, number) for number, run in enumerate(runs)]


_VERSION: Final = 3
"""Of how object, gel and rim are followed: 2 follows pushes, 3 has rings."""
_STAMP: Final = "version"
_GEL_KEYS = ("taken_s", "object", "gel", "spread", "seen", "shown", "rim", "rings")


def _as_arrays(pour: PourRows) -> dict[str, NDArray[Any]]:
    arrays = {"time_s": pour.time_s, "slip_um": pour.slip_um, "dropped": pour.dropped}
    for side, rows in enumerate(pour.gels):
        arrays |= {f"{side}_{key}": getattr(rows, key) for key in _GEL_KEYS}
    return arrays


def _from_arrays(run: PourRun, arrays: dict[str, NDArray[Any]], number: int) -> PourRows:
    def gel(side: int) -> GelRows:
        before = f"{number}/{side}_"
        return GelRows(**{key: arrays[before + key] for key in _GEL_KEYS})

    time_s, slip_um, dropped = (arrays[f"{number}/{k}"] for k in ("time_s", "slip_um", "dropped"))
    return PourRows(run, time_s, slip_um, dropped, (gel(0), gel(1)))
