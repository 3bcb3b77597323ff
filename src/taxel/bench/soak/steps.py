"""`taxel bench soak`: both systems for half an hour in one station, and the books afterwards.

The whole figure takes half an hour, so that it is measured by `--full` and shown with its stamp.

Background of our choices: docs/decisions/0019.
"""

from __future__ import annotations

import contextlib
import math
import tempfile
from collections.abc import Callable
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np

from taxel.bench.faults.first_minutes import MinuteSeen, Stops
from taxel.bench.rows import Row, missing, row
from taxel.bundles.shipped import CUP_POUR, shipped_bundle
from taxel.live.station.station import Station
from taxel.live.station.wiring import StationConfig
from taxel.recordings.reader import iterate_blocks

MINUTES = 30.0
_SETTLED_S = 60.0
"""Memory is compared from here on: caches and logs are warm. Source: our choice."""
_MOST_CHANGE = 1.0
"""Of memory, from one quarter to another, percent."""
_LOOK_S = 2.0
_SOURCES = ("sim://cup-pour", "sim://teng")
Measure = Callable[[], list[Row]]


def quick_steps() -> list[tuple[str, Measure]]:
    """Return the measurements of a normal run: twenty seconds of the same."""
    return [("twenty seconds of both systems", lambda: soak_rows(20.0, 5.0))]


def full_steps(_: Path | None) -> list[tuple[str, Measure]]:
    """Return the whole soak."""
    return [("half an hour of both systems", lambda: soak_rows(60.0 * MINUTES, _SETTLED_S))]


def data_digest(_: Path | None) -> str:
    """Return the digest of recordings used: none are."""
    return "none"


def soak_rows(seconds: float, settled_s: float) -> list[Row]:
    """Run both systems with page and recorder; look at memory, then at the books.

    Args:
        seconds: How long.
        settled_s: When memory begins to be compared.
    """
    from taxel.views.page.station_page import StationPage, show

    how_long = f"{seconds / 60:g} minutes" if seconds >= 60 else f"{seconds:g} s"
    memory: list[tuple[float, dict[str, float]]] = []
    minute = MinuteSeen()
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        bundles = (shipped_bundle(CUP_POUR), _hand_bundle(Path(scratch)))
        config = StationConfig(sources=_SOURCES, bundles=bundles)
        with Station(config, minute.note) as station:
            view = station.view_config()
            station.add_process("page", show, lambda place: StationPage(place=place, view=view))
            station.record(Path(scratch) / "soak.mcap", {})
            began_s = monotonic()
            looked_s = [began_s]
            stops = Stops(station)

            def look(now_s: float) -> None:
                stops.look(now_s)
                if now_s - looked_s[0] >= _LOOK_S:
                    looked_s[0] = now_s
                    memory.append((now_s - began_s, _memory_mib(station)))

            station.run(seconds, on_tick=look)
        ledger = station.ledger()
        recording = station.recording
        skipped = station.skipped
        in_file = _file_rows(Path(scratch) / "soak.mcap", recording, how_long)
    return [
        _memory_row(memory, settled_s, how_long),
        *_book_rows(ledger, how_long),
        *in_file,
        *minute.rows(f"{how_long} of both systems"),
        stops.row(f"{how_long}: STOP shown without a cause"),
        Row(name=f"{how_long}: sets of frames that the monitor let go, behind", value=skipped,
            unit="sets", note="the newest go first; 60 sets a second come"),
    ]  # fmt: skip


def _memory_row(
    memory: list[tuple[float, dict[str, float]]], settled_s: float, how_long: str
) -> Row:
    name = f"{how_long} of both systems: own memory of all processes and rings, largest change"
    kept = [by_process for time_s, by_process in memory if time_s >= settled_s]
    if len(kept) < 4:
        return missing(name, "%", f"<= {_MOST_CHANGE:g}", "too short")
    processes = list(kept[0])
    table = np.array([[found.get(name, np.nan) for name in processes] for found in kept])
    # Medians of quarters: a collection under way is no growth.
    quarters = np.array([np.nanmedian(part, axis=0) for part in np.array_split(table, 4)])
    totals = quarters.sum(axis=1)
    change = 100.0 * float(totals.max() - totals.min()) / float(totals[0])
    grown = dict(zip(processes, quarters[-1] - quarters[0], strict=True))
    most = sorted(grown, key=lambda process: -grown[process])[:3]
    grew = ", ".join(f"{process} {grown[process]:+.1f}" for process in most)
    note = f"MiB by quarters: {', '.join(f'{total:.0f}' for total in totals)}; grew most: {grew}"
    return row(name, change, "%", "<=", _MOST_CHANGE, note)


def _book_rows(ledger: dict[str, dict[str, int]], how_long: str) -> list[Row]:
    made = {
        name: account["produced"] for name, account in ledger.items() if name.startswith("source")
    }
    followers = {
        "monitor 1": made["source 1"],
        "monitor 2": made["source 2"],
        "recorder": sum(made.values()),
    }
    rows = []
    for name, produced in followers.items():
        account = ledger[name]
        off = produced - account["consumed"] - account["dropped"]
        rows.append(
            row(f"{how_long}: made less (taken in by {name} + dropped)", abs(off), "messages",
                "<=", 0.0, f"{produced} made, {account['consumed']} taken in, "
                f"{account['dropped']} dropped")
        )  # fmt: skip
    starts = sum(account["starts"] for account in ledger.values()) - len(ledger)
    rows.append(row(f"{how_long}: processes that had to be started again", starts, "times", "<=",
                    0.0))  # fmt: skip
    return rows


def _file_rows(path: Path, recording: dict[str, Any], how_long: str) -> list[Row]:
    """Read the recording; count what the devices' own counters say is missing in it."""
    scans, holes, last = 0, 0, None
    frames, frame_holes = [0, 0], 0
    before: list[int | None] = [None, None]
    for block in iterate_blocks(path):
        counter = block.samples.counter
        if len(counter):
            steps = np.diff(counter, prepend=counter[0] - 1 if last is None else last)
            holes += int(np.clip(steps - 1, 0, None).sum())
            scans, last = scans + len(counter), int(counter[-1])
        for frame in block.frames:
            old = before[frame.camera]
            # A repeated image keeps its count; each pour counts from 0.
            frame_holes += max(0, frame.counter - old - 1) if old is not None else 0
            before[frame.camera] = frame.counter
            frames[frame.camera] += 1
    ledger = recording["ledger"]
    off = abs(ledger["scans"] - scans) + sum(
        abs(camera["frames"] - count)
        for camera, count in zip(ledger["cameras"].values(), frames, strict=True)
    )
    return [
        row(f"{how_long}: scans missing in the file by the board's own count", holes, "scans", "<=",
            0.0, f"{scans} in it"),
        row(f"{how_long}: images missing in the file by the cameras' own counts", frame_holes,
            "images", "<=", 0.0, f"{frames[0]} and {frames[1]} frames in it"),
        row(f"{how_long}: reported as recorded and not read back", off, "scans and frames",
            "<=", 0.0, str(recording.get("error") or "no error")),
    ]  # fmt: skip


def _memory_mib(station: Station) -> dict[str, float]:
    """Return what this process and each of the station's holds itself, rings shared out, MiB.

    Pages of programs and files come and go as the system likes, so they are not counted.
    """
    pids = {"supervisor": "self"}
    pids |= {name: str(process.pid) for name, process in station.workers().items()}
    return {name: _own_mib(pid) for name, pid in pids.items()}


def _own_mib(pid: str) -> float:
    """Return what a process holds, MiB; NaN for one that has ended."""
    total = math.nan
    with contextlib.suppress(OSError):
        lines = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
        parts = [line.partition(":") for line in lines]
        total = sum(int(rest.split()[0]) for name, _, rest in parts
                    if name in ("Pss_Anon", "Pss_Shmem")) / 1024  # fmt: skip
    return total


def _hand_bundle(folder: Path) -> Path:
    """Train a small recogniser of shapes on simulated grasps; return its bundle."""
    from taxel.sources.simulated.data_sets import simulate_presets
    from taxel.training.final import train_bundle
    from taxel.training.recipes import find_recipe

    simulate_presets(folder, ("honest",), 20_000, 0)
    path = folder / "shape.taxel"
    train_bundle(folder / "honest", find_recipe("teng"), path)
    return path
