"""Import a file of many trials by a table of one line. Not a test itself."""

import numpy as np
import pytest

from taxel.errors import BadTable
from taxel.recordings.imports.importing import ImportOptions, import_table
from taxel.recordings.imports.notes import notes_of
from taxel.recordings.reader import list_recordings, read_recording

HEADER = "file,trials,axes,label:object,group:session,channels,time\n"
X = np.random.default_rng(0).normal(size=(6, 9, 3)).astype(np.float32)
OBJECTS = np.array(["cup", "ball"] * 3)
SESSIONS = np.repeat([1, 2, 3], 2)
OWN = "a[N] b[N] c[V]"


def bring(folder, row, *, header=HEADER, missing="refuse", notes=None):
    """Import a table of one row, or several, and read what was made."""
    (folder / "table.csv").write_text(header + row + "\n", encoding="utf-8")
    facts = []
    made = import_table(
        folder / "table.csv", folder / "out", on_file=facts.append,
        options=ImportOptions(missing=missing, overwrite=True),
    )  # fmt: skip
    assert sorted(made) == list_recordings(folder / "out")
    if notes is not None:
        notes.extend(notes_of(facts))
    return [read_recording(path) for path in made]


def refusal(folder, row, header=HEADER) -> str:
    """Return the one line of an import that must be refused, and leave nothing."""
    before = sorted(path.name for path in folder.iterdir())
    (folder / "table.csv").write_text(header + row + "\n", encoding="utf-8")
    with pytest.raises(BadTable) as caught:
        import_table(folder / "table.csv", folder / "out")
    assert sorted({*before, "table.csv"}) == sorted(path.name for path in folder.iterdir())
    assert "\n" not in str(caught.value)
    return str(caught.value)
