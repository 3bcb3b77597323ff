"""Tables by which `taxel import` reads the data sets of `bench data` that it does not know by name.

Each set is given as somebody would give it: plain files of values, an import table, and for
many touches in one file a table of intervals; nothing else is glued on. Knows nothing about models.
"""

from __future__ import annotations

import csv
import gzip
from collections import defaultdict
from collections.abc import Iterable, Sequence
from pathlib import Path

from taxel.recordings.imports.importing import import_table

BIOTAC_COLUMNS = tuple(
    f"{finger}_biotac_{i}" for finger in ("ff", "mf", "th") for i in range(1, 25)
)
FABRIC_HZ = 35.7
"""One sample each 28 ms, says the data's README; its time stamps repeat now and then."""
FABRIC_COLUMNS = ("proximity1", "proximity2", *(f"channel{i}" for i in range(1, 17)))


def import_biotac(source: Path, output: Path, scratch: Path) -> None:
    """Import the grasps of biotacsp-stability: a file an object, a line and an interval a grasp.

    Group "object" is the object, "part" 0 for the 41 to learn from and 1 for the authors' ten
    others.

    Args:
        source: The folder biotacsp-stability.
        output: Folder of recordings to be made.
        scratch: Where the tables are written.
    """
    grasps: dict[str, list[dict[str, str]]] = defaultdict(list)
    with gzip.open(source / "grasps.csv.gz", "rt", newline="") as file:
        for row in csv.DictReader(file):
            grasps[f"{row['object']}-{row['split']}".replace("/", "-")].append(row)
    table, intervals = [], []
    channels = " ".join(f"{name}[count]" for name in BIOTAC_COLUMNS)
    for name, rows in grasps.items():
        _write(
            scratch / f"{name}.csv", BIOTAC_COLUMNS, ([r[c] for c in BIOTAC_COLUMNS] for r in rows)
        )
        table.append([f"{name}.csv", channels, "rate:1Hz", "biotac"])
        for second, row in enumerate(rows):
            part = "0" if row["split"] == "train" else "1"
            intervals.append([name, second, second + 1, ("held", "slipped")[int(row["slipped"])],
                              row["object"], part, row["orientation"]])  # fmt: skip
    _write(scratch / "table.csv", ("file", "channels", "time", "sensor"), table)
    _write(
        scratch / "intervals.csv",
        ("file", "start_s", "end_s", "label:outcome", "group:object", "group:part",
         "group:orientation"),
        intervals,
    )  # fmt: skip
    import_table(scratch / "table.csv", output, intervals=scratch / "intervals.csv")


def import_fabric(source: Path, output: Path, scratch: Path) -> None:
    """Import the slides of fabric-slide over its seven fabrics: a file a slide.

    Group "force" is the force's code; "half" is 0 for the first half of each fabric's
    unbroken block of slides and 1 for the second.

    Args:
        source: The folder fabric-slide.
        output: Folder of recordings to be made.
        scratch: Where the tables are written.
    """
    with (source / "trials.csv").open(newline="") as file:
        trials = [row for row in csv.DictReader(file) if row["set"] == "fabric"]
    half = _halves(trials)
    channels = " ".join(f"{name}[count]" for name in FABRIC_COLUMNS)
    known = {row["trial"] for row in trials}
    columns = FABRIC_COLUMNS
    samples: dict[str, list[list[str]]] = defaultdict(list)
    with gzip.open(source / "samples.csv.gz", "rt", newline="") as file:
        for row in csv.DictReader(line for line in file if line.strip()):
            if row["trial"] in known:
                samples[row["trial"]].append([row[name] for name in columns])
    for trial, rows in samples.items():
        _write(scratch / f"slide-{int(trial):04d}.csv", columns, rows)
    _write(
        scratch / "table.csv",
        ("file", "label:material", "group:force", "group:velocity", "group:half", "group:order",
         "channels", "time", "sensor"),
        [[f"slide-{int(row['trial']):04d}.csv", row["material"], row["force_code"],
          row["velocity_mm_s"], half[row["trial"]], row["t0"], channels,
          f"rate:{FABRIC_HZ:g}Hz", "finger"]
         for row in trials],
    )  # fmt: skip
    import_table(scratch / "table.csv", output)


def _halves(trials: Sequence[dict[str, str]]) -> dict[str, str]:
    """Return "0" or "1" for each trial: before or after the middle of its fabric's block."""
    found = {}
    for material in {row["material"] for row in trials}:
        own = sorted((row for row in trials if row["material"] == material),
                     key=lambda row: int(row["t0"]))  # fmt: skip
        for place, row in enumerate(own):
            found[row["trial"]] = str(int(place >= len(own) / 2))
    return found


def _write(path: Path, header: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(header)
        writer.writerows(rows)
