"""Claims about lines of an import table that stand for all files whose names match."""

import json
import os
import unicodedata
from pathlib import Path

import numpy as np
import pytest

from taxel.cli.main import main
from taxel.errors import BadTable
from taxel.recordings.imports import matched_files
from taxel.recordings.imports.importing import ImportOptions, import_table
from taxel.recordings.imports.notes import FileFacts, notes_of
from taxel.recordings.reader import read_recording
from taxel.windows.config import WindowConfig
from taxel.windows.dataset import load_dataset

PATTERN = "{group:session}/{label:object}_{label:force}_trial{group:trial_number}.csv"
REST = ",*[N],ms[ms]\n"


def put(folder: Path, *names: str) -> None:
    """Write a text of ten scans under each name."""
    for name in names:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("ms,a\n" + "".join(f"{10 * i},{i % 3}\n" for i in range(10)))


def bring(folder: Path, *lines: str, header: str = "file", **options: bool):
    """Import by a table of such lines; return the recordings and the notes."""
    table = folder / "table.csv"
    table.write_text(f"{header},channels,time\n" + "".join(line + REST for line in lines))
    facts: list[FileFacts] = []
    made = import_table(
        table, folder / "out", options=ImportOptions(overwrite=True, **options),
        on_file=facts.append,
    )  # fmt: skip
    return [read_recording(path).manifest for path in made], notes_of(facts)


def test_each_file_that_matches_is_a_recording_with_the_labels_in_its_name(tmp_path):
    names = [f"day{day}/cup_25N_trial{n}.csv" for day in (1, 2, 10) for n in (1, 9, 10)]
    put(tmp_path, *reversed(names))
    found, notes = bring(tmp_path, PATTERN + ",pad", header="file,group:hand")

    assert [own.groups["file"] for own in found] == names
    assert dict(found[5].labels) == {"object": "cup", "force": "25N"}
    assert dict(found[5].groups) == {"file": names[5], "hand": "pad", "session": "day2",
                                     "trial_number": "10"}  # fmt: skip
    assert notes == [f"{tmp_path}/table.csv, line 2: 9 files match, the first is {names[0]}, with "
                     "session=day1, object=cup, force=25N, trial_number=1"]  # fmt: skip


def test_the_same_in_a_table_that_names_each_file_gives_the_same_bytes(tmp_path):
    put(tmp_path, "cup_1.csv", "ball_2.csv")
    bring(tmp_path, "{label:object}_{group:n}.csv")
    by_pattern = [path.read_bytes() for path in sorted((tmp_path / "out").iterdir())]
    bring(tmp_path, "cup_1.csv,cup,1", "ball_2.csv,ball,2", header="file,label:object,group:n")

    assert by_pattern == [path.read_bytes() for path in sorted((tmp_path / "out").iterdir())]


def test_lines_with_and_without_a_pattern_stand_beside_one_another(tmp_path):
    put(tmp_path, "cup_1.csv", "cup_2.csv", "other.csv")
    found, _ = bring(tmp_path, "{label:object}_?.csv,,a", "other.csv,ball,b",
                     header="file,label:object,group:session")  # fmt: skip
    assert [own.labels["object"] for own in found] == ["cup", "cup", "ball"]


def test_files_of_arrays_are_matched_too_and_keep_each_trials_own_labels(tmp_path):
    for who in ("anna", "bo"):
        np.savez(tmp_path / f"{who}.npz", X=np.random.default_rng(0).normal(size=(3, 9, 2)),
                 y=[0, 1, 0])  # fmt: skip
        np.save(tmp_path / f"{who}_1.npy", np.arange(20.0).reshape(10, 2))
    table = tmp_path / "table.csv"
    table.write_text(
        "file,trials,axes,label:object,channels,time\n"
        "{group:who}.npz,X,trials rows channels,from:y,*[N],rate:100Hz\n"
        "{group:who}_{label:object}.npy,,,,*[N],rate:100Hz\n"
    )
    made = [read_recording(path).manifest for path in import_table(table, tmp_path / "out")]
    assert [(own.groups["who"], own.labels["object"]) for own in made] == [
        *[("anna", label) for label in "010"], *[("bo", label) for label in "010"],
        ("anna", "1"), ("bo", "1"),
    ]  # fmt: skip


def test_files_beside_that_are_in_no_line_are_counted(tmp_path):
    """Of the same ending, in the same folders, hidden ones and the table itself not."""
    put(tmp_path, "day1/cup_1N_trial1.csv", "day2/cup-1N_trial10.csv", "day2/cup-1N_trial9.csv",
        "day2/cup_1N_trial1.csv", "day1/.cup_1N_trial1.csv", "day1/notes.txt", "other.csv",
        "day2/known.csv")  # fmt: skip
    _, notes = bring(tmp_path, PATTERN, "day2/known.csv")
    assert f"{tmp_path}/table.csv: 2 files beside those that match are in no line, and not " \
           "imported; the first is day2/cup-1N_trial9.csv" in notes  # fmt: skip


def test_a_name_that_can_be_read_in_two_ways_is_said(tmp_path):
    put(tmp_path, "day1/cup_1N_trial1.csv", "day1/big_cup_1N_trial1.csv")
    found, notes = bring(tmp_path, PATTERN)
    assert found[0].labels["object"] == "big"
    (note,) = [note for note in notes if "in two ways" in note]
    assert "1 of 2 names" in note
    assert "taken as session=day1, object=big, force=cup_1N, trial_number=1, not" in note
    assert "object=big_cup, force=1N" in note


def test_names_that_are_there_count_as_they_stand(tmp_path):
    put(tmp_path, "{label:a}.csv", "a*.csv", "ab.csv")
    found, notes = bring(tmp_path, "{label:a}.csv,x", "a*.csv,y", header="file,label:kind")
    assert [(own.groups["file"], dict(own.labels)) for own in found] == [
        ("{label:a}.csv", {"kind": "x"}), ("a*.csv", {"kind": "y"}),
    ]  # fmt: skip
    assert notes == []


def test_a_value_in_a_name_is_never_a_reference(tmp_path):
    put(tmp_path, "day/rows:a_1.csv", "day/from:a_1.csv")
    found, _ = bring(tmp_path, "day/{label:object}_1.csv")
    assert [own.labels["object"] for own in found] == ["from:a", "rows:a"]


def test_the_table_itself_matches_no_pattern(tmp_path):
    put(tmp_path, "cup.csv")
    found, notes = bring(tmp_path, "{label:object}.csv")
    assert [own.labels["object"] for own in found] == ["cup"]
    assert len(notes) == 1


@pytest.mark.parametrize(
    ("header", "lines", "words"),
    [
        ("file", ["day1/{label:object}-*.csv"], r"matches 'day1/{label:object}-\*.csv' in the "
         r"folder \S+; got none of 2 there, such as 'day1/cup_1.csv', by \S+, line 2; correct"),
        ("file", ["gone/*.csv"], r"got none by \S+, line 2"),
        ("file", ["day1/*_1.csv", "day1/cup_?.csv"], r"each file in one line of the table; got "
         r"'day1/cup_1.csv' by \S+, line 2 and by \S+, line 3"),
        ("file", ["day1/cup_1.csv", "*/cup_?.csv"], "each file in one line"),
        ("file", ["day1/cup_1.csv", "day1/{label:a}_2.csv", "day1/cup_*.csv"], "line 2 and by"),
        ("file,label:object", ["day1/{label:object}_*.csv,cup"], "a value of 'label:object' from "
         r"the file's name or from its column; got both in \S+, line 2"),
        ("file,group:day", ["{group:day}/*.csv,", "day1/cup_1.csv,"], "each file in one line"),
        ("file,group:day,group:who", ["{group:day}/cup_1.csv,,x", "{group:day}/cup_2.csv,,"],
         "the column 'group:who'; got nothing in .*line 3"),
        ("file,label:object", ["*/*.csv,"], "something in the column 'label:object'; got nothing"),
        ("file", ["{day}/*.csv"], "got '{day}' in the column 'file' in"),
    ],
)  # fmt: skip
def test_a_slip_in_the_table_is_one_plain_line_and_no_output(tmp_path, header, lines, words):
    put(tmp_path, "day1/cup_1.csv", "day1/cup_2.csv")
    with pytest.raises(BadTable, match=words) as caught:
        bring(tmp_path, *lines, header=header)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "out").exists()


@pytest.fixture
def sent(tmp_path: Path) -> Path:
    """A folder that was sent, with links that lead out of it to its reader's own files."""
    put(tmp_path, "own/secret_1.csv", "sent/cup_1.csv", "sent/in/cup_2.csv")
    os.symlink(tmp_path / "own", tmp_path / "sent" / "linked")
    os.symlink(tmp_path / "own/secret_1.csv", tmp_path / "sent" / "link_3.csv")
    os.symlink(tmp_path / "sent", tmp_path / "sent" / "in" / "ring")
    os.symlink(tmp_path / "nowhere", tmp_path / "sent" / "dead.csv")
    return tmp_path / "sent"


@pytest.mark.parametrize(
    ("pattern", "got"),
    [
        ("{label:object}_?.csv", "'link_3.csv'"),
        ("*/{label:object}_?.csv", "'linked'"),
        ("linked/{label:object}_?.csv", "'linked/"),
        ("*/secret_1.csv", "'linked'"),
        ("../own/{label:object}_?.csv", "'../own/"),
        ("in/*/../own/{label:object}_?.csv", "'in/"),
    ],
)
def test_a_match_outside_the_folder_is_refused_unless_a_person_allows_it(sent, pattern, got):
    with pytest.raises(BadTable, match=rf"got {got}.*which lies outside"):
        bring(sent, pattern)
    found, _ = bring(sent, pattern, allow_outside=True)
    assert any(own.labels.get("object", "secret") in ("link", "secret") for own in found)


def test_links_within_the_folder_are_followed_and_no_ring_is_endless(sent):
    found, _ = bring(sent, "in/ring/in/ring/c*_{group:n}.csv")
    assert [own.groups["n"] for own in found] == ["1"]


@pytest.mark.parametrize("literal", ["in", "in/deeper"])
def test_no_name_outside_the_folder_is_ever_shown(tmp_path, literal):
    """A folder that does not match is looked into for the note; a link in it is not."""
    put(tmp_path, "own/secret_2.csv", "own/deeper/secret_2.csv", "sent/a1/cup_1.csv")
    put(tmp_path / "sent/a1" / literal, "cup_1.csv")
    (tmp_path / "sent" / "zz").mkdir()
    os.symlink(tmp_path / "own", tmp_path / "sent" / "zz" / "in")
    cell = f"{{group:s}}1/{literal}/{{label:object}}_1.csv"
    _, notes = bring(tmp_path / "sent", cell)
    assert [("1 file matches" in note, "secret" in note) for note in notes] == [(True, False)]

    with pytest.raises(BadTable, match="matches") as caught:
        bring(tmp_path / "sent", cell.replace("_1.csv", "_3.csv"), allow_outside=True)
    assert "secret" not in str(caught.value)


@pytest.mark.parametrize(
    ("pattern", "link", "got"),
    [
        ("day1/{label:object}_*.csv", "day1/cup_8.csv", "'day1/cup_8.csv'"),
        ("day?/cup_1.csv", "day2/cup_1.csv", "'day2/cup_1.csv'"),
        ("{group:day}/cup_1.csv", "day3", "'day3'"),
        ("day?/in/cup_1.csv", "day2/in", "'day2/in'"),
    ],
)
def test_a_match_that_leads_nowhere_is_refused(tmp_path, pattern, link, got):
    """As git-annex leaves files that were not fetched."""
    put(tmp_path, "day1/cup_1.csv", "day1/in/cup_1.csv")
    (tmp_path / link).parent.mkdir(exist_ok=True)
    os.symlink("gone", tmp_path / link)
    with pytest.raises(BadTable, match="needed a match that can be read; got " + got + ", a link "
                       r"that leads nowhere, by \S+, line 2; bring what it leads to"):  # fmt: skip
        bring(tmp_path, pattern)


def test_a_link_to_nothing_that_does_not_match_stops_nothing(tmp_path):
    """Nor does one that was a file, where folders are wanted."""
    put(tmp_path, "day1/cup_1.csv")
    os.symlink("gone", tmp_path / "day1" / "notes.csv")
    os.symlink("gone", tmp_path / "notes.pdf")
    found, notes = bring(tmp_path, "{group:day}/{label:object}_1.csv")
    assert (len(found), len(notes)) == (1, 1)


def test_a_folder_that_may_not_be_listed_is_refused_if_it_matches(tmp_path, monkeypatch):
    put(tmp_path, "day1/cup_1.csv", "day2/cup_1.csv", "other/cup_1.csv")
    listed = os.listdir

    def forbidden(path: Path) -> list[str]:  # root may list what is forbidden to all
        if Path(path).name in ("day2", "other"):
            raise PermissionError(13, "Permission denied", str(path))
        return listed(path)

    monkeypatch.setattr(os, "listdir", forbidden)
    with pytest.raises(BadTable, match=r"got 'day2', which cannot be read \(Permission denied\), "
                       r"by \S+, line 2; allow reading it"):  # fmt: skip
        bring(tmp_path, "day?/{label:object}_*.csv")
    found, _ = bring(tmp_path, "day1/{label:object}_*.csv")
    assert len(found) == 1
    found, _ = bring(tmp_path, "{group:d}1/{label:object}_*.csv")
    assert len(found) == 1


@pytest.mark.parametrize("there", ["NFC", "NFD"])
def test_accents_may_be_typed_either_way_in_names_without_a_part_too(tmp_path, there):
    put(tmp_path, unicodedata.normalize(there, "caf\u00e9/in/cup_1.csv"),
        unicodedata.normalize(there, "day1/caf\u00e9/cup_2.csv"))  # fmt: skip
    for form in ("NFC", "NFD"):
        lines = (unicodedata.normalize(form, "caf\u00e9/in/{label:object}_?.csv"),
                 unicodedata.normalize(form, "day?/caf\u00e9/{label:object}_?.csv"))  # fmt: skip
        found, _ = bring(tmp_path, *lines)
        assert [own.labels["object"] for own in found] == ["cup", "cup"]


@pytest.mark.parametrize(("most", "count"), [(3, "at least 3 files"), (40, "10 files")])
def test_folders_beside_never_stop_an_import(tmp_path, monkeypatch, most, count):
    put(tmp_path, "day1/cup_1.csv", "day2/cup_1.csv", "day2/cup_2.csv",
        *(f"images/{n:02d}.csv" for n in range(9)))  # fmt: skip
    monkeypatch.setattr(matched_files, "MOST_LOOKED_AT", 8)
    monkeypatch.setattr(matched_files, "MOST_BESIDE", most + 2)  # the table, the folder
    found, notes = bring(tmp_path, "day?/{label:object}_1.csv")
    assert len(found) == 2
    assert f"table.csv: {count} beside those that match are in no line" in notes[-1]

    with pytest.raises(BadTable, match="got none of") as caught:
        bring(tmp_path, "day?/{label:object}_1.txt")
    assert ("at least" in str(caught.value)) == ("at least" in count)


def test_the_names_that_are_looked_at_have_a_bound(tmp_path, monkeypatch):
    put(tmp_path, *(f"{n}.csv" for n in range(5)))
    monkeypatch.setattr(matched_files, "MOST_LOOKED_AT", 4)
    with pytest.raises(BadTable, match="at most 4 names"):
        bring(tmp_path, "*.csv")


@pytest.mark.skipif(os.name == "nt", reason="names are text there")
def test_a_name_that_is_no_text_is_refused(tmp_path):
    put(tmp_path, "cup_1.csv")
    try:
        os.rename(tmp_path / "cup_1.csv", os.fsencode(tmp_path) + b"/c\xff_1.csv")
    except OSError:
        pytest.skip("this disk takes no such names")
    with pytest.raises(BadTable, match="file names in UTF-8"):
        bring(tmp_path, "{label:object}_1.csv")


def test_a_trial_without_a_value_is_imported_and_left_out_where_it_is_the_target(tmp_path):
    put(tmp_path, "a.csv", "b.csv", "c.csv")
    _, notes = bring(tmp_path, "a.csv,cup,1", "b.csv,ball,", "c.csv,cup,2",
                     header="file,label:object,label:force")  # fmt: skip
    assert notes == ["1 of 3 files has no label:force, the first is b.csv: left out where it is "
                     "to be predicted"]  # fmt: skip

    rows = WindowConfig(steps=2, stride=2, grid_hz=None)
    whole = load_dataset(tmp_path / "out", rows, target="object")
    part = load_dataset(tmp_path / "out", rows, target="force")
    assert [trial.recording for trial in part.trials] == ["a.mcap", "c.mcap"]
    assert len(part) == 2 * len(whole) // 3
    assert [note for note in part.notes if "lack the label 'force': left out" in note] == [
        "1 of 3 trials lack the label 'force': left out"
    ]


def test_the_command_line_prints_the_notes_and_refuses_in_one_line(tmp_path, capsys):
    put(tmp_path, "cup_1.csv", "cup-2.csv")
    (tmp_path / "table.csv").write_text("file,channels,time\n{label:object}_*.csv" + REST)
    main(["import", str(tmp_path / "table.csv"), "--output", str(tmp_path / "out"), "--json"])
    notes = json.loads(capsys.readouterr().out)["notes"]
    assert ["1 file matches" in notes[0], "1 file beside" in notes[1]] == [True, True]

    (tmp_path / "table.csv").write_text("file,channels,time\n{label:object}+*.csv" + REST)
    with pytest.raises(SystemExit) as ended:
        main(["import", str(tmp_path / "table.csv"), "--output", str(tmp_path / "again")])
    assert ended.value.code == 2
    assert capsys.readouterr().err.startswith("taxel: needed a file that matches")


def test_files_of_one_name_in_two_folders_are_counted_as_two(tmp_path):
    """The notes on how arrays were read and the number of the others make the number of files."""
    for side in ("train", "test"):
        (tmp_path / side).mkdir()
        for number in range(6):
            np.save(tmp_path / side / f"{number}_cup.npy", np.ones((9, 3)))
    (tmp_path / "table.csv").write_text(
        "file,axes,channels,time\n{group:side}/*_{label:object}.npy,rows channels,*[N],rate:9Hz\n"
    )
    facts: list[FileFacts] = []
    import_table(tmp_path / "table.csv", tmp_path / "out", on_file=facts.append)
    first, *arrays, rest = notes_of(facts)

    assert "12 files match, the first is test/0_cup.npy" in first
    assert [note.split(",")[0] for note in arrays] == [
        f"the array in test/{number}_cup.npy was read as 1 trial of 'rows channels': 9 scans of 3 "
        "channels" for number in range(4)
    ]  # fmt: skip
    assert rest == "8 more files or arrays were read likewise"


def test_of_many_lines_of_the_table_the_first_are_said_and_the_others_counted(tmp_path):
    """Apart from the arrays: a line stands for many of these."""
    for number in range(7):
        np.save(tmp_path / f"{number}_cup.npy", np.ones((9, 3)))
    (tmp_path / "table.csv").write_text(
        "file,axes,channels,time\n"
        + "".join(f"{n}_{{label:object}}.npy,rows channels,*[N],rate:9Hz\n" for n in range(7))
    )
    facts: list[FileFacts] = []
    import_table(tmp_path / "table.csv", tmp_path / "out", on_file=facts.append)
    notes = notes_of(facts)

    assert ["1 file matches" in note for note in notes] == [True] * 4 + [False] * 6
    assert notes[4] == "3 more lines of the table were read likewise"
    assert notes[-1] == "3 more files or arrays were read likewise"


def test_a_doubt_on_channels_names_the_file_as_the_table_does(tmp_path):
    for side in ("train", "test"):
        (tmp_path / side).mkdir()
        (tmp_path / side / "a.csv").write_text("ms,a,label\n0,1,2\n10,2,2\n")
    _, notes = bring(tmp_path, "{group:side}/a.csv")

    assert [note.split(":")[0] for note in notes if "* took label" in note] == [
        "test/a.csv", "train/a.csv",
    ]  # fmt: skip


def test_an_array_whose_label_is_in_its_name_may_be_one_trial(tmp_path):
    """The refusal says which axes that would be; so does it where the table has its label."""
    np.save(tmp_path / "0_cup.npy", np.ones((39, 2, 250)))
    for header, cells in (("", "*_{label:object}.npy"), (",label:object", "0_cup.npy,cup")):
        (tmp_path / "table.csv").write_text(f"file{header},channels,time\n{cells},*[N],rate:9Hz\n")
        with pytest.raises(BadTable, match=r"'height width rows' .250 scans of 78 channels. if"):
            import_table(tmp_path / "table.csv", tmp_path / "out")
    with (tmp_path / "table.csv").open("w") as file:
        file.write(
            "file,axes,channels,time\n*_{label:object}.npy,height width rows,*[N],rate:9Hz\n"
        )
    (made,) = import_table(tmp_path / "table.csv", tmp_path / "out")
    assert read_recording(made).samples.values.shape == (250, 78)
