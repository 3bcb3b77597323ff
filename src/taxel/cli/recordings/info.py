"""`taxel info`: what a recording, a folder of them, a table of camera trials or a bundle holds."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import tyro
from rich.box import SIMPLE_HEAD
from rich.table import Table

from taxel.bundles.envelope import BundleKind, kind_of, unpack
from taxel.bundles.shipped import find_bundle
from taxel.cli.options.rules import Only
from taxel.cli.printing import console, print_json, progress, say
from taxel.cli.recordings.info_table import describe_table, is_trial_table
from taxel.cli.trial_verbs import refuse_other_table
from taxel.labels.class_order import in_order
from taxel.plain_text import number_of, visible, visible_names
from taxel.recordings.imports.own_groups import CUT_FROM
from taxel.recordings.imports.spelling import by_numbers
from taxel.recordings.reader import list_recordings
from taxel.recordings.summary import recorded_s, summarise
from taxel.recordings.tally import camera_line

_NAMES = 6
"""Values of a group that are named."""
_RECORDINGS, _CHANNELS = 40, 100
"""Lines of a table, unless all are asked for: the totals below it stay on the screen."""


@dataclass(frozen=True)
class Info:
    """Print what a recording, a folder of recordings, a table of camera trials or a bundle holds;
    verify all check sums.
    """

    path: tyro.conf.Positional[Path]
    """A recording (.mcap), a folder of them, a table of camera trials (.csv), or a bundle (.taxel),
    such as slip-both-gels, which comes with taxel."""
    all: bool = False
    """List all recordings of a folder and all channels of a recording, not only the first 40
    recordings or 100 channels. The totals are of all of them in any case."""
    json: bool = False
    """Print everything as JSON: one object for a file, a list for a folder."""

    RULES: ClassVar = (
        Only(
            ("all",), "a recording or folder, without --json",
            lambda o: not o.json and (o.path.is_dir() or o.path.suffix == ".mcap"),
        ),
    )  # fmt: skip

    def run(self) -> None:
        """Read everything and print it."""
        bundle = find_bundle(self.path)
        kind = kind_of(bundle)
        if kind is not None:
            _print_bundle(bundle, kind, self.json)
            return
        if bundle.suffix == ".taxel" and bundle.is_file():
            unpack(bundle, ())  # says what is wrong with it
        if is_trial_table(self.path):
            lines, data = describe_table(self.path)
            if self.json:
                print_json(data, indent=None)
            else:
                for line in lines:
                    say(line)
            return
        refuse_other_table(self.path)
        paths = list_recordings(self.path)
        with progress() as bar:
            rows = [summarise(path) for path in bar.track(paths, description="reading")]
        if self.json:
            print_json(rows if self.path.is_dir() else rows[0], indent=None)
        elif self.path.is_dir():
            _print_folder(self.path, rows, everything=self.all)
        else:
            _print_recording(rows[0], everything=self.all)


def _print_bundle(path: Path, kind: BundleKind, as_json: bool) -> None:
    from taxel.cli.recordings.info_bundle import describe_bundle

    lines, data = describe_bundle(path, kind)
    if as_json:
        print_json(data, indent=None)
        return
    for name, text in lines.items():
        say(f"{name:<14}{text}")


def _print_recording(row: dict[str, Any], *, everything: bool) -> None:
    rate, nominal = row["rate_hz"], row["sensor"]["rate_hz"]
    lines = {
        "recording": f"{row['path']}, {row['bytes'] / 1e6:.2f} MB, all checksums valid",
        "sensor": f"{visible(row['sensor']['name'])} {visible(row['sensor']['serial'])}".strip(),
        "written by": f"{row['software']} {row['created']}".strip(),
        "labels": _pairs(row["labels"]),
        "groups": _pairs(row["groups"]),
        "scans": f"{row['scans']}" + (f" in {row['duration_s']:.3f} s" if row["scans"] > 1 else ""),
        "rate": f"{rate:.2f} scans/s measured, {nominal:g} nominal"
        if rate is not None
        else f"not measured, {nominal:g} scans/s nominal",
        "lost": f"{number_of(row['lost_scans'], 'scan')} at "
        f"{number_of(row['counter_gaps'], 'place')}",
        "marks": f"{row['marks']}"
        + "".join(
            f"; {visible(name)}: {_pairs(count)}" for name, count in row["marks_by_label"].items()
        ),
    }
    if not row["channels"]:
        for name in ("sensor", "scans", "rate", "lost"):
            del lines[name]
    cameras = [
        (
            "camera",
            f"{visible(camera['name'])} {camera['width']}×{camera['height']}: "
            f"{camera_line(camera)}",
        )
        for camera in row["cameras"]
    ]
    for name, text in [*lines.items(), *cameras]:
        say(f"{name:<11}{text}")
    if not row["channels"]:
        return
    table = Table("channel", "unit", "min", "mean", "max", "saturated %", "unusable %")
    for channel in row["channels"][: None if everything else _CHANNELS]:
        figures = [channel["min"], channel["mean"], channel["max"]]
        table.add_row(
            visible(channel["name"]),
            visible(channel["unit"]),
            *["–" if figure is None else f"{figure:.4g}" for figure in figures],
            f"{100 * channel['saturated_share']:.2f}",
            f"{100 * channel['unusable_share']:.2f}",
        )
    console.print(table)
    if more := len(row["channels"]) - table.row_count:
        say(f"and {number_of(more, 'more channel')} (--all)")


def _print_folder(path: Path, rows: list[dict[str, Any]], *, everything: bool) -> None:
    rows = sorted(rows, key=lambda row: by_numbers(Path(row["path"]).name))
    console.print(_folder_table(rows[: None if everything else _RECORDINGS]))
    if not everything and len(rows) > _RECORDINGS:
        say(f"and {number_of(len(rows) - _RECORDINGS, 'more recording')} (--all)")
    _print_totals(path, rows)


def _folder_table(rows: list[dict[str, Any]]) -> Table:
    """Return a line for each recording, with the columns that say something of one of them."""
    columns: dict[str, list[str]] = {
        "scans": [str(row["scans"]) for row in rows],
        "s": [f"{recorded_s(row):.2f}" for row in rows],
        "scans/s": ["" if row["rate_hz"] is None else f"{row['rate_hz']:.1f}" for row in rows],
        "lost": [str(row["lost_scans"]) for row in rows],
        "frames": [str(_frames(row) or "") for row in rows],
        "marks": [str(row["marks"] or "") for row in rows],
        "labels": [", ".join(map(visible, row["labels"].values())) for row in rows],
    }
    shown = {name: cells for name, cells in columns.items() if any(cells)}
    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    table.add_column("recording", overflow="fold")
    for name in shown:
        left = name == "labels"
        table.add_column(name, justify="left" if left else "right", no_wrap=not left,
                         overflow="fold")  # fmt: skip
    for row, *cells in zip(rows, *shown.values(), strict=True):
        table.add_row(visible(Path(row["path"]).name), *cells)
    return table


def _print_totals(path: Path, rows: list[dict[str, Any]]) -> None:
    scans = sum(row["scans"] for row in rows)
    seconds = sum(map(recorded_s, rows))
    frames = sum(map(_frames, rows))
    parts = [number_of(scans, "scan")] + [number_of(frames, "frame")] * (frames > 0)
    parts += [f"{seconds:.1f} s"] * (seconds > 0)  # none where each recording holds one scan
    held = ", ".join(parts)
    say(f"{path}: {number_of(len(rows), 'recording')}, {held}, all checksums valid")
    for name in sorted({name for row in rows for name in row["labels"]}):
        count: Counter[str] = Counter()
        for row in rows:
            count.update(_trials_by_label(row, name))
        trials = "trials" if any(row["marks"] for row in rows) else "recordings"
        say(f"label {visible(name)}: {_pairs({value: count[value] for value in in_order(count)})} "
            f"({trials})")  # fmt: skip
    for name in sorted({name for row in rows for name in row["marks_by_label"]}):
        marked: Counter[str] = Counter()
        for row in rows:
            marked.update(row["marks_by_label"].get(name, {}))
        say(
            f"marks {visible(name)}: {_pairs({value: marked[value] for value in in_order(marked)})}"
        )
    for name in sorted({name for row in rows for name in (*row["groups"], *row["marks_by_group"])}):
        values = [value for row in rows for value in _values(row, name)]
        say(f"group {visible(name)}: {_span(values, shared=name != CUT_FROM)}")


def _trials_by_label(row: dict[str, Any], name: str) -> Counter[str]:
    """Return how many of a recording's trials have each value of a label.

    Each mark is a trial, and a recording without marks is one; a mark's own label wins.
    """
    count = Counter(row["marks_by_label"].get(name, {}))
    others = max(1, row["marks"]) - count.total()
    if others:
        count[row["labels"].get(name, "–")] += others
    return count


def _values(row: dict[str, Any], group: str) -> list[str]:
    """Return a group's value of each trial that marks give a value of its own, else of the
    recording.
    """
    own: dict[str, int] = row["marks_by_group"].get(group, {})
    marked = [value for value, count in own.items() for _ in range(count)]
    return marked or [row["groups"].get(group, "–")]


def _span(values: list[str], *, shared: bool = True) -> str:
    """Return what a group holds: its one value, figures from least to most, or names: all that
    recordings share, else some.

    Args:
        values: Of each recording, or of each of its trials.
        shared: Whether recordings may share them; each recording has its own otherwise.
    """
    names = sorted(set(values), key=by_numbers)
    if len(names) == 1:
        return visible(names[0])
    try:
        names.sort(key=float)
    except ValueError:
        few = shared and 2 * len(names) <= len(values) and len(names) <= _RECORDINGS
        shown = names if few else names[:_NAMES]
        more = f" and {len(names) - len(shown)} more" if len(names) > len(shown) else ""
        return visible_names(shown) + more
    return (", " if len(names) == 2 else " to ").join(map(visible, (names[0], names[-1])))


def _frames(row: dict[str, Any]) -> int:
    return sum(camera["frames"] for camera in row["cameras"])


def _pairs(pairs: dict[str, Any]) -> str:
    return ", ".join(f"{visible(name)}={visible(value)}" for name, value in pairs.items()) or "none"
