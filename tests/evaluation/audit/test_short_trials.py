"""Claims about trials that are too short for an audit: a refusal that they cause names them."""

from pathlib import Path

import pytest

from taxel.errors import BadDataset
from taxel.evaluation.audit.reading import read_touch
from taxel.recordings.imports.importing import import_table


def test_where_all_trials_of_a_class_are_too_short_the_refusal_says_so(tmp_path: Path) -> None:
    """The recordings have two classes: "label the recordings" alone would mislead."""
    (tmp_path / "a.csv").write_text("x\n" + "".join(f"{i % 7}\n" for i in range(100)))
    (tmp_path / "t.csv").write_text("file,channels,time\na.csv,x[N],rate:10Hz\n")
    (tmp_path / "i.csv").write_text(
        "start_s,end_s,label:outcome\n0,1,held\n2,3,held\n4,5,held\n6,6.1,slip\n7,7.1,slip\n"
    )
    import_table(tmp_path / "t.csv", tmp_path / "set", intervals=tmp_path / "i.csv")

    with pytest.raises(BadDataset, match=r"outcome; 2 trials of fewer than 3 rows: left out"):
        read_touch(tmp_path / "set", None, lambda *_: None)
