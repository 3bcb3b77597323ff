"""Sessions of touches whose channels' gains differ."""

from pathlib import Path

import numpy as np

from taxel.cli.main import main
from taxel.recordings.imports.importing import ImportRow, import_rows
from taxel.training.choose.base import Base, load_base

SESSIONS, TOUCHES, ROWS = 6, 40, 20


def touches(folder: Path, spread: float, *, in_turn: bool = False) -> Path:
    """Write sessions of touches of a soft and a hard thing, 1.5 s apart; channels' gains differ.

    In turn, all hard touches of a session come before the soft ones. Hard is 1.4 times soft on the
    first channel: what a gain of another session hides.
    """
    rng = np.random.default_rng(5)
    spans, files = ["file,start_s,end_s,label:kind"], []
    for session in range(SESSIONS):
        gain = np.exp(rng.normal(0.0, spread, 2))
        rows = ["t,a,b"]
        for number in range(TOUCHES):
            drawn = bool(rng.integers(0, 2))
            hard = number < TOUCHES / 2 if in_turn else drawn
            level = np.array([1.4 if hard else 1.0, 1.0]) * gain * rng.normal(1.0, 0.05)
            values = level * (1.0 + rng.normal(0.0, 0.02, (ROWS, 2)))
            start = number * 1.5
            rows += [f"{start + 0.01 * i:.2f},{x:.4f},{y:.4f}" for i, (x, y) in enumerate(values)]
            kind = ("soft", "hard")[hard]
            spans.append(f"s{session},{start:.3f},{start + 0.2:.3f},{kind}")
        files.append(folder / f"s{session}.csv")
        files[-1].write_text("\n".join(rows) + "\n")
    import_rows(
        [ImportRow(file=file, labels={}, groups={"session": file.stem, "day": f"d{place // 3}"},
                   time="t[s]", sensor="pad", channels="a[V] b[V]")
         for place, file in enumerate(files)], folder / "raw",
    )  # fmt: skip
    (folder / "spans.csv").write_text("\n".join(spans) + "\n")
    main(["label", str(folder / "raw"), "--intervals", str(folder / "spans.csv"), "--output",
          str(folder / "recordings")])  # fmt: skip
    return folder / "recordings"


def base_of(folder: Path) -> Base:
    return load_base(folder, "kind")
