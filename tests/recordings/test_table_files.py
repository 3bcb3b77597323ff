"""A table reaches the files of its own folder, and no others unless a person allows it."""

import os
import re
import unicodedata
from pathlib import Path

import pytest

from taxel.cli.main import main
from taxel.errors import BadTable
from taxel.recordings.imports.importing import ImportOptions, import_table
from taxel.recordings.imports.video_rows import read_video_rows


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder that was sent, beside a file that was not: its owner's own numbers."""
    (tmp_path / "sent").mkdir()
    for file in ("own.csv", "sent/a.csv"):
        (tmp_path / file).write_text("ms,v\n" + "".join(f"{10 * i},{i}\n" for i in range(20)))
    os.symlink(tmp_path / "own.csv", tmp_path / "sent" / "link.csv")
    return tmp_path / "sent"


def table(folder: Path, file: object) -> Path:
    path = folder / "table.csv"
    path.write_text(f"file,channels,time,label:object\n{file},v[N],ms[ms],cup\n")
    return path


def test_a_file_of_the_folder_is_imported_however_it_is_written(folder):
    for n, name in enumerate(("a.csv", "./a.csv", "../sent/a.csv", folder / "a.csv")):
        (made,) = import_table(table(folder, name), folder / f"out{n}")
        assert made.name == "a.mcap"


@pytest.mark.parametrize("name", ["../own.csv", "link.csv", "{above}/own.csv", "/etc/hostname"])
def test_a_file_outside_is_refused_and_nothing_is_written(folder, name):
    path = table(folder, name.format(above=folder.parent))

    with pytest.raises(BadTable, match="which lies outside"):
        import_table(path, folder / "out")
    assert not (folder / "out").exists()


@pytest.mark.parametrize(("name", "link"), [
    ("link.csv", "link.csv"), ("../own.csv", ""), ("days/mon/b.csv", "days/mon"),
    ("days/{group:day}/b.csv", "days/mon"), ("days/mon/{group:n}.csv", "days/mon"),
    ("days/twice/*.csv", "days/twice"),
])  # fmt: skip
def test_a_link_that_leads_out_is_named(folder, name, link):
    """As it stands in the table, though a pattern that matches it names it by its own name."""
    (folder.parent / "monday").mkdir()
    (folder.parent / "monday" / "b.csv").write_bytes((folder / "a.csv").read_bytes())
    (folder / "days").mkdir()
    os.symlink(folder.parent / "monday", folder / "days" / "mon")
    os.symlink("mon", folder / "days" / "twice")
    with pytest.raises(BadTable, match="which lies outside") as caught:
        import_table(table(folder, name), folder / "out")
    message = (
        f"line 2, which lies outside, as '{link}' is a link that leads there; copy what it lea"
    )
    assert (message in str(caught.value)) == bool(link)
    assert re.search("taxel import .*--data.*--allow-outside", str(caught.value))
    assert not (folder / "out").exists()


@pytest.mark.parametrize("name", ["../own.csv", "link.csv", "{above}/own.csv"])
def test_a_person_may_allow_it(folder, name):
    path = table(folder, name.format(above=folder.parent))

    assert import_table(path, folder / "out", options=ImportOptions(allow_outside=True))
    main(["import", str(path), "--output", str(folder / "again"), "--allow-outside"])
    assert import_table(table(folder, "own.csv"), folder / "named", data_dir=folder.parent)


def test_videos_are_held_to_the_same(folder):
    path = folder / "videos.csv"
    path.write_text("left,label:object\n../own.avi,cup\n")

    with pytest.raises(BadTable, match="which lies outside"):
        read_video_rows(path, folder)
    (folder.parent / "own.avi").touch()
    assert read_video_rows(path, folder, outside=True)


def test_a_name_that_can_be_none_is_one_line(folder):
    (folder / "table.csv").write_bytes(b"file,channels,time,label:object\na" + b"x" * 5000 +
                                       b",v[N],ms[ms],cup\n")  # fmt: skip

    with pytest.raises(BadTable):
        import_table(folder / "table.csv", folder / "out")


@pytest.mark.parametrize("form", ["NFC", "NFD"])
def test_a_video_is_found_however_its_letters_are_composed(tmp_path, form):
    """Names that macOS decomposed look the same: "no file grün.avi" named what is there."""
    other = "NFC" if form == "NFD" else "NFD"
    file = tmp_path / unicodedata.normalize(form, "Öl/grün.avi")
    file.parent.mkdir()
    file.write_bytes(b"")
    (tmp_path / "own.avi").write_bytes(b"")
    os.symlink(tmp_path / "own.avi", file.parent / unicodedata.normalize(form, "ä.avi"))
    for cell, found in (("Öl/grün.avi", file.name), ("Öl/ä.avi", None)):
        path = file.parent / "t.csv"
        path.write_text(f"left\n{unicodedata.normalize(other, cell)}\n", encoding="utf-8")
        (row,) = read_video_rows(path, tmp_path)
        assert row.name == unicodedata.normalize("NFC", f"0001-{Path(cell).stem}")
        assert row.files["left"].is_file()
        assert found is None or row.files["left"] == file
    path.write_text(f"left\n{unicodedata.normalize(other, 'ä.avi')}\n", encoding="utf-8")
    with pytest.raises(BadTable, match="which lies outside"):
        read_video_rows(path, file.parent)
