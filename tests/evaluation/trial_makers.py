"""Camera trials made small: shape and traps of somebody's own set, not its values.

A bright patch lies on a textured ground. In a trial that slips it moves against the ground from
the middle on; in one that holds, patch and ground shake together. Traps: slip trials are shorter
where `shorter` is set, and each object has a brightness of its own.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

import taxel.training.camera_trials.blend as blending
from taxel.evaluation.camera_trials.trial_set import TrialSet
from taxel.training.camera_trials.features import TrialRows
from taxel.windows.trial_crops import PIXELS, STATISTICS, STILLS, numbers_of
from taxel.windows.trial_layout import Layout
from taxel.windows.trial_network import FEATURES
from taxel.windows.trial_picture import COLUMNS, ROWS

SIZE = (60, 80)
Write = Callable[[Path, list[NDArray[np.uint8]]], str]


def trial_images(
    slips: bool, frames: int, seed: int, brightness: int, speed: float = 1.2
) -> list[NDArray[np.uint8]]:
    """One camera's images, shape (60, 80, 3), red first; `speed` of a slip, pixels a frame."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[: SIZE[0], : SIZE[1]].astype(np.float32)
    phase = rng.uniform(0, 6)
    images = []
    for number in range(frames):
        shake = 0.6 * np.sin(number / 3 + phase)
        moved = max(0.0, number - frames / 2) * speed if slips else 0.0
        ground = brightness + 25 * np.sin((x + shake) / 2.5) * np.cos(y / 3)
        at = np.exp(-(((x - 30 - shake - moved) / 9) ** 2 + ((y - 30) / 12) ** 2))
        grey = ground + 70 * at + rng.normal(0, 1.0, SIZE)
        colours = np.stack([grey, 0.8 * grey, 0.6 * grey], axis=2)
        images.append(np.clip(np.rint(colours), 0, 255).astype(np.uint8))
    return images


def as_folder(path: Path, images: list[NDArray[np.uint8]]) -> str:
    """Write images as a folder of PNG, named without leading zeros; return its name."""
    path.mkdir(parents=True)
    for number, image in enumerate(images):
        cv2.imwrite(str(path / f"frame{number}.png"), image[..., ::-1])
    return path.name


def as_avi(path: Path, images: list[NDArray[np.uint8]]) -> str:
    """Write images as an AVI of 25 frames a second; return its name."""
    return _as_video(path.with_suffix(".avi"), "MJPG", images)


def as_mp4(path: Path, images: list[NDArray[np.uint8]]) -> str:
    """Write images as an MP4 of 25 frames a second; return its name."""
    return _as_video(path.with_suffix(".mp4"), "mp4v", images)


def _as_video(path: Path, code: str, images: list[NDArray[np.uint8]]) -> str:
    fourcc = cv2.VideoWriter.fourcc(*code)
    writer = cv2.VideoWriter(str(path), fourcc, 25.0, (SIZE[1], SIZE[0]))
    for image in images:
        writer.write(np.ascontiguousarray(image[..., ::-1]))
    writer.release()
    return path.name


def write_trials(
    folder: Path,
    *,
    objects: int = 6,
    each: int = 4,
    cameras: int = 1,
    frames: int = 21,
    shorter: int = 0,
    write: Write = as_avi,
    test_objects: int = 0,
    first: int = 0,
) -> Path:
    """Write trials and the table of them; return the table.

    Args:
        folder: Where to.
        objects: How many there are.
        each: Trials of each, half of which slip.
        cameras: 1 or 2.
        frames: Of a trial that holds.
        shorter: By how many frames one that slips is shorter.
        write: How a camera's images are kept.
        test_objects: So many of them stand on the side "test" of a column split.
        first: Seed of the first trial's images, in hundreds.
    """
    folder.mkdir(parents=True, exist_ok=True)
    names = ["left", "right"][:cameras] if cameras > 1 else ["camera:wrist"]
    split = ",split" if test_objects else ""
    lines = [",".join(names) + ",label:slipped,group:object" + split]
    for number in range(objects * each):
        thing, slips = number % objects, (number // objects) % 2 == 1
        cells = []
        for camera in range(cameras):
            images = trial_images(
                slips,
                frames - (shorter if slips else 0),
                100 * (first + number) + camera,
                90 + 6 * thing,
            )
            cells.append(write(folder / f"t{number}c{camera}", images))
        cells += [str(int(slips)), f"object {thing}"]
        if test_objects:
            cells.append("test" if thing >= objects - test_objects else "train")
        lines.append(",".join(cells))
    table = folder / "trials.csv"
    table.write_text("\n".join(lines) + "\n")
    return table


def by_colour(images: NDArray[np.uint8]) -> NDArray[np.float32]:
    """An image network of three numbers, the mean colour; the rest is 0."""
    found = np.zeros((len(images), FEATURES), np.float32)
    found[:, :3] = images.mean(axis=(1, 2))
    return found


def few_small_members(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make blends of camera trials few and small: tests look at wiring, not at accuracy."""
    monkeypatch.setattr(blending, "TREES", 12)
    monkeypatch.setattr(blending, "INNER_TREES", 6)
    few = (blending.MEMBERS[:2], lambda line: None)
    monkeypatch.setattr(blending.fit_blend, "__defaults__", few)


def some_trials(
    trials: int = 24, places: int = 3, lengths: tuple[int, int] = (60, 30), classes: int = 2
) -> TrialSet:
    """Trials whose classes show in the mean grey difference, and in length where they differ."""
    rng = np.random.default_rng(0)
    y = np.arange(trials) % classes
    trial = np.repeat(np.arange(trials), places)
    pixels = rng.normal(size=(len(trial), 2 * STATISTICS * len(PIXELS))).astype(np.float32)
    pixels[:, numbers_of("pixels", ("step", "since"), 2)[:6]] += 3.0 * y[trial][:, None]
    stills = rng.normal(size=(len(trial), 2 * 3 * STILLS)).astype(np.float32)
    picture = rng.normal(size=(len(trial), 2 * 30)).astype(np.float32)
    looks = rng.normal(size=(len(trial), 3, 2, 180)).astype(np.float32)
    cells = rng.normal(100.0, 9.0, size=(len(trial), ROWS, 2, COLUMNS)).astype(np.float32)
    return TrialSet(
        target="kind",
        classes=tuple("abc"[:classes]),
        y=y.astype(np.intp),
        names=tuple(f"t{i}" for i in range(trials)),
        groups=tuple({"object": f"o{i // 4}", "turn": str(i % 4)} for i in range(trials)),
        lengths=np.where(y == 0, *lengths).astype(np.intp),
        cameras=2,
        layout=Layout(20, places),
        cut=TrialRows(
            rows={"pixels": pixels, "stills": stills, "picture": picture},
            shown={"stills": looks, "picture": cells},
            trial=trial,
            place=np.tile(np.arange(places), trials),
        ),
        first=looks[::places, 0, :, :48].reshape(trials, -1),
    )
