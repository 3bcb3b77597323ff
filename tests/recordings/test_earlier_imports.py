"""Claims about importing again into a folder that is there."""

import pytest

from taxel.cli.main import main
from taxel.errors import BadTable
from taxel.recordings.imports.importing import ImportOptions, import_table
from taxel.recordings.reader import list_recordings
from taxel.recordings.writer import Recorder

HEADER = "file,label:object,channels,time\n"


@pytest.fixture
def folder(tmp_path):
    """Two tables and an import table for them."""
    for name in ("a", "b"):
        (tmp_path / f"{name}.csv").write_text("t,x\n10,1\n20,2\n30,3\n")
    (tmp_path / "table.csv").write_text(HEADER + "a.csv,cup,x[V],t[ms]\nb.csv,ball,x[V],t[ms]\n")
    return tmp_path


def test_an_output_folder_with_something_in_it_is_not_replaced_unasked(folder):
    """With overwrite it is replaced as a whole, unless something would be lost with it."""
    again = ImportOptions(overwrite=True)
    import_table(folder / "table.csv", folder / "out")
    with pytest.raises(BadTable, match="--overwrite"):
        import_table(folder / "table.csv", folder / "out")
    (folder / "out" / "old.mcap").write_text("precious")
    with pytest.raises(BadTable, match=r"with old\.mcap;"):
        import_table(folder / "table.csv", folder / "out", options=again)
    with pytest.raises(BadTable, match=r"and [0-9] more"):
        import_table(folder / "table.csv", folder, options=again)
    assert (folder / "out" / "old.mcap").read_text() == "precious"
    (folder / "out" / "old.mcap").unlink()
    import_table(folder / "table.csv", folder / "out", options=again)
    assert [path.name for path in list_recordings(folder / "out")] == ["a.mcap", "b.mcap"]


def test_recordings_of_an_earlier_import_may_go_with_overwrite(folder, capsys):
    """A table that was cleaned has fewer rows; a note says how many recordings are gone."""
    words = ["import", str(folder / "table.csv"), "--output", str(folder / "out")]
    main(words)
    (folder / "table.csv").write_text(HEADER + "b.csv,ball,x[V],t[ms]\n")
    capsys.readouterr()
    main([*words, "--overwrite"])
    note = "1 earlier recording was not written again, and removed: a.mcap\n"
    assert note in capsys.readouterr().out
    assert [path.name for path in list_recordings(folder / "out")] == ["b.mcap"]


def test_what_no_import_wrote_is_refused_by_name_with_overwrite(folder, manifest, numbered):
    """A recording of a sensor, a label's correction, a damaged recording, a folder: all stay."""
    again = ImportOptions(overwrite=True)
    first, _ = import_table(folder / "table.csv", folder / "out")
    imported = first.read_bytes()
    (folder / "table.csv").write_text(HEADER + "b.csv,ball,x[V],t[ms]\n")
    with Recorder(folder / "recorded.mcap", manifest) as recorder:
        recorder.write(numbered(4, 2))
    others = {
        "recorded.mcap": (folder / "recorded.mcap").read_bytes(), "a.labels.json": b"{}",
        "cut.mcap": imported[:-40], "a.csv": imported,
    }  # fmt: skip
    for name, content in others.items():
        (folder / "out" / name).write_bytes(content)
        with pytest.raises(BadTable, match=rf"of an earlier import, .* with {name};"):
            import_table(folder / "table.csv", folder / "out", options=again)
        assert (folder / "out" / name).read_bytes() == content
        (folder / "out" / name).unlink()
    (folder / "out" / "more.mcap").mkdir()
    with pytest.raises(BadTable, match=r"with more\.mcap;"):
        import_table(folder / "table.csv", folder / "out", options=again)
    assert first.read_bytes() == imported


def test_an_import_that_fails_leaves_the_earlier_recordings(folder):
    """Nothing is replaced before all is written."""
    made = import_table(folder / "table.csv", folder / "out")
    before = [path.read_bytes() for path in made]
    (folder / "c.csv").write_text("t,x\n10,text\n")
    rows = "b.csv,ball,x[V],t[ms]\nc.csv,ball,x[V],t[ms]\n"
    (folder / "table.csv").write_text(HEADER + rows)
    with pytest.raises(BadTable, match="'text'"):
        import_table(folder / "table.csv", folder / "out", options=ImportOptions(overwrite=True))
    assert [path.read_bytes() for path in list_recordings(folder / "out")] == before
