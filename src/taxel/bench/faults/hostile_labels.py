"""Write a table whose labels, groups, channels and file names a screen would obey or confuse.

They are accepted: each is a name like any other, and must be kept as it is and shown literally.
Knows nothing about the commands that read them.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

CLASSES = ("cup[blue]", "cup[green]", "[/red]", "a\x1b[2Jb", "$x^$", "<script>alert(1)</script>",
           "\u202epuc", "x\nall checksums valid", ":cup:")  # fmt: skip
CHANNELS = (":a:", "$b^$", "_c\x1b(0\x07")
SESSIONS = ("day\x1b[31m1", "day[/b]2")
TRAINING = ("--target", "object", "--split", "group:session", "--model", "cnn1d", "--window",
            "steps=20", "stride=20", "grid=own", "gate=none", "--epochs", "2")  # fmt: skip
"""Options of a training on them that takes seconds."""


def write_table(folder: Path) -> Path:
    """Write values of two sessions of each class, and the table that imports them; return it."""
    rng = np.random.default_rng(0)
    rows = []
    for number, label in enumerate(CLASSES):
        for session in SESSIONS:
            name = f"[red]{number}\x1b[1m-{SESSIONS.index(session)}.csv"
            values = rng.normal(number, 0.3, (80, len(CHANNELS)))
            with (folder / name).open("w", newline="") as file:
                writer = csv.writer(file)
                writer.writerow(["ms", *CHANNELS])
                writer.writerows([10 * i, *scan] for i, scan in enumerate(values.tolist()))
            rows.append([name, label, session, "ms[ms]", "pad[/red]\x1b[5m"])
    path = folder / "table.csv"
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["file", "label:object", "group:session", "channels", "time", "sensor"])
        channels = " ".join(f"{channel}[N]" for channel in CHANNELS)
        for name, label, session, time, sensor in rows:
            writer.writerow([name, label, session, channels, time, sensor])
    return path
