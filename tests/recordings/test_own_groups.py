"""Claims about groups that taxel gives each trial itself: no table may fill them in."""

from pathlib import Path

import pytest

from taxel.cli.main import main
from taxel.errors import BadTable
from taxel.labels.trials import trials_of
from taxel.recordings.imports.intervals import read_intervals
from taxel.recordings.imports.own_groups import OWN_GROUPS, refuse_own_groups
from taxel.recordings.manifest import NO_ARRAY, Manifest


def test_these_are_the_groups_that_a_trial_gets_when_it_is_read():
    manifest = Manifest(sensor=NO_ARRAY, groups={"session": "a"})
    (trial,) = trials_of(Path("a.mcap"), manifest, [], 0.0, 1.0)
    assert sorted(set(trial.groups) - {"session"}) == sorted(OWN_GROUPS)


@pytest.mark.parametrize("name", OWN_GROUPS)
def test_a_column_that_would_be_overwritten_is_refused_in_one_line(tmp_path, capsys, name):
    (tmp_path / "cup.csv").write_text("ms,a\n0,1\n10,2\n")
    table = tmp_path / "table.csv"
    table.write_text(f"file,Group: {name},channels,time\ncup.csv,1,*[N],ms[ms]\n")
    with pytest.raises(SystemExit) as ended:
        main(["import", str(table), "--output", str(tmp_path / "out")])

    assert ended.value.code == 2
    assert capsys.readouterr().err == (
        "taxel: needed groups but recording and trial, which taxel fills in itself; got "
        f"'group:{name}' in {table}, line 1; call it group:{name}_number, or leave it out.\n"
    )
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", OWN_GROUPS)
def test_so_is_one_of_a_table_of_intervals(tmp_path, name):
    table = tmp_path / "marks.csv"
    table.write_text(f"file,start_s,end_s,label:a,group:{name}\ncup,0,1,x,1\n")
    with pytest.raises(BadTable, match=f"got 'group:{name}' in {table}"):
        read_intervals(table, ["cup"])


@pytest.mark.parametrize("name", ["cut_from", "piece_number"])
def test_so_are_the_groups_of_pieces(name):
    with pytest.raises(BadTable, match=f"groups but cut_from and piece_number.*group:{name}"):
        refuse_own_groups(["file", f"group:{name}"], "table")


def test_other_groups_and_labels_may_have_any_name():
    refuse_own_groups(["file", "label:trial", "group:Trial", "group:trial_number"], "table")
