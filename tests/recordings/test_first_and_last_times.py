"""Claims about a garbled time in the first or the last row, which have one neighbour."""

from pathlib import Path

import numpy as np
import pytest

from taxel.errors import BadTable
from taxel.recordings.imports.importing import ImportOptions, import_table
from taxel.recordings.imports.value_tables.stray_times import strays_of
from taxel.recordings.reader import Recording, read_recording

REFUSE, DROP = ImportOptions(), ImportOptions(garbled_times="drop")


def import_times(
    folder: Path, times: list[int], options: ImportOptions, trials: str = ""
) -> list[Recording]:
    """Import a table whose channel counts the rows; times are milliseconds."""
    rows = "".join(f"{time},{row}\n" for row, time in enumerate(times))
    (folder / "a.csv").write_text(f"ms,a\n{rows}")
    column, cell = (",trials", f",{trials}") if trials else ("", "")
    (folder / "table.csv").write_text(f"file{column},channels,time\na.csv{cell},a[N],ms[ms]\n")
    out = folder / options.garbled_times
    made = import_table(folder / "table.csv", out, options=options)
    return [read_recording(path) for path in made]


@pytest.mark.parametrize(("times", "words"), [
    ([9000, *range(10, 200, 10)], "got 9 s in {}, line 2, beside 0.01 s below; such a time is gar"),
    ([*range(1000, 1190, 10), 1050], "got 1.05 s in {}, line 21, beside 1.18 s above; such a time"),
])  # fmt: skip
def test_it_is_refused_and_left_out_as_one_between_others(tmp_path, times, words):
    with pytest.raises(BadTable) as caught:
        import_times(tmp_path, times, REFUSE)
    assert words.format(tmp_path / "a.csv") in str(caught.value)
    (recording,) = import_times(tmp_path, times, DROP)

    first = int(times[0] == 9000)
    assert recording.samples.values[:, 0].tolist() == list(range(first, first + 19))


@pytest.mark.parametrize("times", [[-900, *range(10, 200, 10)], [*range(0, 190, 10), 9000]])
def test_a_leap_that_may_follow_a_pause_is_left_out_only_where_asked(tmp_path, times):
    (whole,) = import_times(tmp_path, times, REFUSE)
    (left,) = import_times(tmp_path, times, DROP)

    assert (len(whole.samples), len(left.samples)) == (20, 19)
    assert np.ptp(left.samples.fitted_s) < 0.2


def test_a_leap_is_kept_where_it_would_be_one_row_too_many(tmp_path):
    (kept,) = import_times(tmp_path, [0, 10, 900, 20, 30, 40, 5000], DROP)

    assert kept.samples.values[:, 0].tolist() == [0, 1, 3, 4, 5, 6]


def test_it_cuts_no_trial_off_a_text_that_is_cut_at_restarts(tmp_path):
    times = [9000, *range(10, 200, 10), *range(0, 200, 10)]
    made = import_times(tmp_path, times, DROP, "restarts")

    assert [len(recording.samples) for recording in made] == [19, 20]


@pytest.mark.parametrize("times", [
    [900, 800, 0, 10, 20, 30, 40, 50, 60, 70],  # two above all others
    [0, 10, 20, 30, 40, 50, 60, 70, -900, -910],  # two below
    [0, 10, 20, 30, 40, 50, 60, 15],  # the last row, back by less
    [*range(5000, 5300, 10), *range(0, 300, 10), 0],  # a restart in the last row of the second
    [-900, 0, 10, 20],  # after a pause, perhaps
    [0, 10, 20, 900],
])  # fmt: skip
def test_other_times_at_the_ends_are_not_called_garbled(times):
    assert strays_of(np.array(times, float)) == []
