"""Missing values are no touch: an audit sees the last value measured, never 0."""

from pathlib import Path

import numpy as np

from taxel.evaluation.audit.audit import audit
from taxel.evaluation.audit.reading import read_touch
from taxel.evaluation.audit.touch_set import TouchSet
from taxel.evaluation.audit.usable_rows import held_rows, sums_of
from taxel.recordings.imports.importing import ImportOptions, import_table


def read_set(folder: Path, lost: float) -> TouchSet:
    """Return trials of noise about 5 N, the same in both classes, of which y lost values."""
    rng = np.random.default_rng(0)
    lines = ["file,channels,time,label:kind"]
    for number in range(40):
        kind = "xy"[number % 2]
        rows = [[f"{value:.3f}" for value in row] for row in rng.normal(5.0, 0.2, (30, 3))]
        for row in rows if kind == "y" else ():
            row[:] = ["" if rng.random() < lost else value for value in row]
        (folder / f"{number}.csv").write_text(
            "a,b,c\n" + "".join(",".join(row) + "\n" for row in rows)
        )
        lines.append(f"{number}.csv,a[N] b[N] c[N],rate:10Hz,{kind}")
    (folder / "t.csv").write_text("\n".join(lines) + "\n")
    import_table(folder / "t.csv", folder / "set", options=ImportOptions(missing="keep"))
    return read_touch(folder / "set", "kind", lambda *_: None)


def test_lost_values_are_not_read_as_a_lower_level(tmp_path: Path) -> None:
    touch = read_set(tmp_path, 0.2)

    assert min(float(rows.min()) for rows in touch.rows) > 3.0
    found = {finding.kind: finding for finding in audit(touch, "lost").findings}
    assert found["level"].alone is not None
    assert found["level"].alone < 0.8
    assert not found["level"].alarm
    assert not found["first frame"].alarm


def test_an_unusable_value_is_the_channels_last_one_or_its_first() -> None:
    gap = np.nan
    values = np.array([[gap, 1, gap], [2, gap, gap], [gap, 3, gap]], np.float32)
    usable = np.isfinite(values)

    assert held_rows(values, usable).tolist() == [[2, 1, 0], [2, 1, 0], [2, 3, 0]]
    assert sums_of(values, usable).tolist() == [[1, 2, 0], [2, 4, 0], [4, 10, 0]]
    assert held_rows(values[:0], usable[:0]).shape == (0, 3)
