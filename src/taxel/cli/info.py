"""`taxel info`: what a recording or a folder of recordings holds."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tyro
from rich.console import Console
from rich.progress import track
from rich.table import Table

from taxel.recordings.reader import list_recordings
from taxel.recordings.summary import summarise
from taxel.recordings.tally import camera_line


@dataclass(frozen=True)
class Info:
    """Say what a recording, or a folder of recordings, holds; verifies every check sum."""

    path: tyro.conf.Positional[Path]
    """A recording (.mcap), or a folder of them."""
    json: bool = False
    """Print everything as JSON: one object for a file, a list for a folder."""

    def run(self) -> None:
        """Read everything and print it."""
        paths = list_recordings(self.path)
        console = Console(stderr=True)
        rows = [
            summarise(path) for path in track(paths, "reading", console=console, transient=True)
        ]
        if self.json:
            print(json.dumps(rows if self.path.is_dir() else rows[0]))
        elif self.path.is_dir():
            _print_folder(self.path, rows)
        else:
            _print_recording(rows[0])


def _print_recording(row: dict[str, Any]) -> None:
    console = Console()
    rate = row["rate_hz"]
    lines = {
        "recording": f"{row['path']}, {row['bytes'] / 1e6:.2f} MB, all check sums hold",
        "sensor": f"{row['sensor']['name']} {row['sensor']['serial']}".strip(),
        "written by": f"{row['software']} {row['created']}".strip(),
        "labels": _pairs(row["labels"]),
        "groups": _pairs(row["groups"]),
        "scans": f"{row['scans']} in {row['duration_s']:.3f} s",
        "rate": f"{'unknown' if rate is None else f'{rate:.2f}'} scans/s measured, "
        f"{row['sensor']['rate_hz']:g} nominal",
        "lost": f"{row['lost_scans']} scans at {row['counter_gaps']} places",
        "marks": f"{row['marks']}"
        + "".join(f"; {name}: {_pairs(count)}" for name, count in row["marks_by_label"].items()),
    }
    if not row["channels"]:
        for name in ("sensor", "scans", "rate", "lost"):
            del lines[name]
    cameras = [
        ("camera", f"{camera['name']} {camera['width']}×{camera['height']}: {camera_line(camera)}")
        for camera in row["cameras"]
    ]
    for name, text in [*lines.items(), *cameras]:
        console.print(f"{name:<11}{text}", highlight=False, markup=False, soft_wrap=True)
    if not row["channels"]:
        return
    table = Table("channel", "unit", "min", "mean", "max", "saturated %", "unusable %")
    for channel in row["channels"]:
        figures = [channel["min"], channel["mean"], channel["max"]]
        table.add_row(
            channel["name"],
            channel["unit"],
            *["–" if figure is None else f"{figure:.4g}" for figure in figures],
            f"{100 * channel['saturated_share']:.2f}",
            f"{100 * channel['unusable_share']:.2f}",
        )
    console.print(table)


def _print_folder(path: Path, rows: list[dict[str, Any]]) -> None:
    console = Console()
    table = Table(
        "recording", "scans", "s", "scans/s", "lost", "frames", "marks", "labels", "groups"
    )
    for row in rows:
        rate = row["rate_hz"]
        table.add_row(
            Path(row["path"]).name,
            str(row["scans"]),
            f"{_seconds(row):.2f}",
            "–" if rate is None else f"{rate:.1f}",
            str(row["lost_scans"]),
            str(_frames(row)),
            str(row["marks"]),
            _pairs(row["labels"]),
            _pairs(row["groups"]),
        )
    console.print(table)
    scans = sum(row["scans"] for row in rows)
    seconds = sum(map(_seconds, rows))
    frames = sum(map(_frames, rows))
    held = f"{scans} scans, {f'{frames} frames, ' if frames else ''}{seconds:.1f} s"
    print(f"{path}: {len(rows)} recordings, {held}, all check sums hold")
    for name in sorted({name for row in rows for name in row["labels"]}):
        count = Counter(row["labels"].get(name, "–") for row in rows)
        print(f"label {name}: {_pairs(dict(sorted(count.items())))}")


def _frames(row: dict[str, Any]) -> int:
    return sum(camera["frames"] for camera in row["cameras"])


def _seconds(row: dict[str, Any]) -> float:
    """Return how long the array or the longest camera was recorded."""
    return max(float(one["duration_s"]) for one in (row, *row["cameras"]))


def _pairs(pairs: dict[str, Any]) -> str:
    return ", ".join(f"{name}={value}" for name, value in pairs.items()) or "none"
