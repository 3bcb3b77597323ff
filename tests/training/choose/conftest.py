"""Recordings to choose for: of two kinds, in several sessions."""

from pathlib import Path

import numpy as np
import pytest
from drifting_sessions import touches

from taxel.recordings.imports.importing import ImportRow, import_rows


def _write_set(folder: Path) -> Path:
    """Write 16 recordings of two classes that differ in frequency, each session at its level."""
    rng = np.random.default_rng(0)
    import_from = []
    for number in range(16):
        kind, session = number % 2, number // 4
        course = np.sin(np.arange(30)[:, None] * (0.4 + 0.8 * kind) + np.arange(4))
        values = course + 3.0 * session + rng.normal(0, 0.1, (30, 4))
        file = folder / f"t{number}.csv"
        lines = ["a,b,c,d", *(",".join(f"{v:.3f}" for v in row) for row in values)]
        file.write_text("\n".join(lines) + "\n")
        import_from.append(
            ImportRow(file=file, labels={"kind": "xy"[kind]}, groups={"session": f"s{session}"},
                      channels="a[N] b[N] c[N] d[N]", time="rate:50Hz")
        )  # fmt: skip
    import_rows(import_from, folder / "recordings")
    return folder / "recordings"


@pytest.fixture(scope="session")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return _write_set(tmp_path_factory.mktemp("set"))


@pytest.fixture(scope="session")
def drifting(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return recordings of sessions whose channels' gains differ."""
    return touches(tmp_path_factory.mktemp("drifting"), 0.3)
