"""Claims about files of many trials: each value arrives in its own trial, row and channel."""

import h5py
import numpy as np
import pytest
from array_writers import FORMS, write_hdf5, write_mat5, write_mat73
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from stack_imports import HEADER, OBJECTS, OWN, SESSIONS, X, bring, refusal

from taxel.recordings.reader import list_recordings

pytestmark = pytest.mark.usefixtures("untried_hdf5")

UNSHARED = [HealthCheck.function_scoped_fixture]
"""Each example clears away its files itself."""


@pytest.mark.parametrize("form", FORMS)
def test_a_stack_becomes_a_recording_a_trial(tmp_path, form):
    """Values, times, labels, groups and names; its axes are found by labels and channels."""
    ending, write = FORMS[form]
    write(tmp_path / f"touch{ending}", {"X": X, "y": OBJECTS, "day": SESSIONS})
    notes: list[str] = []
    row = f"touch{ending},X,,from:y,from:day,{OWN},rate:50Hz"
    made = bring(tmp_path, row, notes=notes)
    assert [path.name for path in list_recordings(tmp_path / "out")] == [
        f"touch-{number}.mcap" for number in range(1, 7)
    ]
    for number, recording in enumerate(made):
        np.testing.assert_array_equal(recording.samples.values, X[number])
        np.testing.assert_allclose(recording.samples.fitted_s, np.arange(9) / 50)
        assert recording.manifest.labels == {"object": OBJECTS[number]}
        assert recording.manifest.groups == {
            "session": str(SESSIONS[number]), "file": f"touch{ending}:X[{number + 1}]",
        }  # fmt: skip
        assert recording.manifest.sensor.channels == ("a", "b", "c")
        assert recording.manifest.sensor.units == ("N", "N", "V")
    assert notes == [
        f"X in touch{ending}, 6 × 9 × 3, was read as 'trials rows channels': 6 trials of 9 scans "
        "of 3 channels"
    ]


KINDS = ["<f4", "<f8", ">f4", "<i2", ">u2", "u1", "?", "<f2"]


@pytest.mark.slow
@settings(settings.get_profile("fuzz"), max_examples=60, suppress_health_check=UNSHARED)
@given(data=st.data())
def test_every_value_arrives_bit_for_bit_from_every_form_and_order_of_axes(tmp_path, data):
    """Whatever the kind of number, the order in memory, a grid or not, and which file."""
    form = data.draw(st.sampled_from([*FORMS, "npy"]))
    grid = data.draw(st.booleans())
    words = ["trials", "rows", *(["height", "width"] if grid else ["channels"])]
    sides = [data.draw(st.integers(1, 4)) for _ in words]
    kind = data.draw(st.sampled_from(KINDS))
    if form.endswith("MATLAB 5") and kind in (">f4", ">u2", "<f2"):
        kind = "<f8"
    seed = data.draw(st.integers(0, 99))
    stack = np.random.default_rng(seed).normal(scale=50, size=sides).astype(kind)
    turned = data.draw(st.permutations(range(len(words))))
    array = stack.transpose(turned)
    if data.draw(st.booleans()):
        array = np.ascontiguousarray(array)
    axes = " ".join(words[axis] for axis in turned)
    if "MATLAB" in form:
        array = array.reshape(array.shape)  # MATLAB leaves out a last side of 1 itself
    ending, write = (".npy", None) if form == "npy" else FORMS[form]
    if write is None:
        np.save(tmp_path / "a.npy", array)
    else:
        write(tmp_path / f"a{ending}", {"X": array})
    name = "" if write is None else "X"
    made = bring(tmp_path, f"a{ending},{name},{axes},thing,1,*[N],rate:50Hz")
    expected = stack.reshape(sides[0], sides[1], -1).astype(np.float32)
    assert len(made) == sides[0]
    for recording, values in zip(made, expected, strict=True):
        np.testing.assert_array_equal(recording.samples.values, values)
    (tmp_path / f"a{ending}").unlink()
    for path in list_recordings(tmp_path / "out"):
        path.unlink()
    (tmp_path / "out").rmdir()


def test_a_grid_of_taxels_is_named_by_row_and_column(tmp_path):
    """All of them, or some by name."""
    np.save(tmp_path / "a.npy", np.arange(2 * 5 * 2 * 3, dtype="i2").reshape(2, 5, 2, 3))
    first, _ = bring(tmp_path, "a.npy,,trials rows height width,x,1,*[count],rate:50Hz")
    assert first.manifest.sensor.channels == ("r1c1", "r1c2", "r1c3", "r2c1", "r2c2", "r2c3")
    np.testing.assert_array_equal(first.samples.values[1], [6, 7, 8, 9, 10, 11])
    first, _ = bring(tmp_path, "a.npy,,trials rows height width,x,1,r2c1[count],rate:50Hz")
    np.testing.assert_array_equal(first.samples.values[:, 0], [3, 9, 15, 21, 27])
    assert "r1c1 to r2c3" in refusal(
        tmp_path, "a.npy,,trials rows height width,x,1,r3c1[count],rate:50Hz"
    )


def test_parts_of_channels_are_channels_that_claim_no_grid(tmp_path):
    """All of them, or some by name."""
    np.save(tmp_path / "a.npy", np.arange(2 * 3 * 2 * 5, dtype="i2").reshape(2, 3, 2, 5))
    first, _ = bring(tmp_path, "a.npy,,trials channels parts rows,x,1,*[count],rate:50Hz")
    assert first.manifest.sensor.channels == ("1_1", "1_2", "2_1", "2_2", "3_1", "3_2")
    np.testing.assert_array_equal(first.samples.values[:, 2], range(10, 15))
    first, _ = bring(tmp_path, "a.npy,,trials channels parts rows,x,1,3_1[count],rate:50Hz")
    np.testing.assert_array_equal(first.samples.values[:, 0], range(20, 25))


def test_cells_and_arrays_that_are_called_alike_are_trials_of_their_own_length(tmp_path):
    """MATLAB's cells, np.savez(path, *trials), and a group of HDF5 for each trial."""
    trials = [X[0], X[1, :4], X[2, :7]]
    cells = np.empty(3, object)
    cells[:] = trials
    write_mat5(tmp_path / "five.mat", {"X": cells, "y": OBJECTS[:3]})
    write_mat73(tmp_path / "seven.mat", {"X": trials, "y": OBJECTS[:3]})
    np.savez(tmp_path / "a.npz", *trials, y=OBJECTS[:3])
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for number, trial in enumerate(trials, start=9):  # 9, 10, 11: not in the order of letters
            group = file.create_group(f"demo_{number}")
            group["force"], group["day"] = trial, number
            group.attrs["object"] = str(OBJECTS[number - 9])
    for row, names in (
        ("five.mat,X,,from:y,1", ["five-1", "five-2", "five-3"]),
        ("seven.mat,X,,from:y,1", ["seven-1", "seven-2", "seven-3"]),
        ("a.npz,arr_*,,from:y,1", ["a-0", "a-1", "a-2"]),
        ("a.h5,demo_*/force,,from:demo_*@object,from:demo_*/day", ["a-09", "a-10", "a-11"]),
    ):
        made = bring(tmp_path, f"{row},*[N],rate:50Hz")
        assert [path.stem for path in list_recordings(tmp_path / "out")] == names
        assert [item.manifest.labels["object"] for item in made] == ["cup", "ball", "cup"]
        for recording, trial in zip(made, trials, strict=True):
            np.testing.assert_array_equal(recording.samples.values, trial)
        for path in list_recordings(tmp_path / "out"):
            path.unlink()


@pytest.mark.parametrize("axes", ["", "rows channels"])
def test_an_empty_trial_is_named(tmp_path, axes):
    """The axes are right; one cell holds nothing."""
    cells = np.empty(3, object)
    cells[:] = [X[0], np.zeros((0, 0)), X[2]]
    write_mat5(tmp_path / "five.mat", {"X": cells, "y": OBJECTS[:3]})
    message = refusal(tmp_path, f"five.mat,X,{axes},from:y,1,*[N],rate:50Hz")
    assert "none in trial 2 of X" in message


def test_rows_of_nan_at_the_end_are_padding(tmp_path):
    """Cut, with a note; kept with --missing keep; NaN further up is refused as ever."""
    padded = X.copy()
    padded[1, 5:] = np.nan
    padded[2, 8:] = np.nan
    np.savez(tmp_path / "a.npz", X=padded, y=OBJECTS)
    row = f"a.npz,X,,from:y,1,{OWN},rate:50Hz"
    notes: list[str] = []
    made = bring(tmp_path, row, notes=notes)
    assert [len(item.samples.values) for item in made] == [9, 5, 8, 9, 9, 9]
    assert notes[1] == (
        "2 of 6 trials end before their array does: rows of NaN at the end were taken as padding "
        "and cut, at most 4 (a.npz[2]); --missing keep keeps them"
    )
    kept = bring(tmp_path, row, missing="keep")
    assert [len(item.samples.values) for item in kept] == [9] * 6
    assert np.isnan(kept[1].samples.values[5:]).all()
    padded[3, 2, 1] = np.nan
    np.savez(tmp_path / "a.npz", X=padded, y=OBJECTS)
    for path in list_recordings(tmp_path / "out"):
        path.unlink()
    (tmp_path / "out").rmdir()
    assert "nan in" in (message := refusal(tmp_path, row))
    assert "trial 4, line 3, column 'b'" in message
    padded[:] = np.nan
    np.savez(tmp_path / "a.npz", X=padded, y=OBJECTS)
    assert "rows of numbers; got none in" in refusal(tmp_path, row)


def test_an_array_of_lengths_cuts_what_is_padded_with_zeros(tmp_path):
    """One number of rows a trial; more than there are is refused."""
    header = HEADER.replace("axes,", "axes,length,")
    lengths = [9, 5, 1, 9, 8, 2]
    np.savez(tmp_path / "a.npz", X=X, y=OBJECTS, n=lengths)
    row = f"a.npz,X,,from:n,from:y,1,{OWN},rate:50Hz"
    made = bring(tmp_path, row, header=header)
    assert [len(item.samples.values) for item in made] == lengths
    for path in list_recordings(tmp_path / "out"):
        path.unlink()
    (tmp_path / "out").rmdir()
    np.savez(tmp_path / "a.npz", X=X, y=OBJECTS, n=[10, 5, 1, 9, 8, 2])
    assert "a length of 1 to 9 rows; got 10 for trial 1" in refusal(tmp_path, row, header)
    np.savez(tmp_path / "a.npz", X=X, y=OBJECTS, n=[0.5] * 6)
    assert "a length of 1 to 9 rows; got 0 for trial 1" in refusal(tmp_path, row, header)
    assert "from:NAME in the column 'length'; got '9'" in refusal(
        tmp_path, row.replace("from:n", "9"), header
    )


def test_rows_of_zeros_at_the_end_of_several_trials_bring_a_note(tmp_path):
    """They may be values, and are kept; not where lengths are given, or one trial rests."""
    padded = X.copy()
    padded[1, 5:] = 0
    np.savez(tmp_path / "a.npz", X=padded, y=OBJECTS, n=[9, 5, 9, 6, 9, 9])
    row = f"a.npz,X,,from:y,1,{OWN},rate:50Hz"
    single: list[str] = []
    bring(tmp_path, row, notes=single)
    assert len(single) == 1
    padded[3, 6:] = 0
    np.savez(tmp_path / "a.npz", X=padded, y=OBJECTS, n=[9, 5, 9, 6, 9, 9])
    notes: list[str] = []
    made = bring(tmp_path, row, notes=notes)
    assert [len(item.samples.values) for item in made] == [9] * 6
    assert notes[1].startswith("2 of 6 trials end in rows of zeros, at most 4 (a.npz[2]); if these")
    given: list[str] = []
    header = HEADER.replace("axes,", "axes,length,")
    bring(tmp_path, row.replace("X,,", "X,,from:n,"), header=header, notes=given)
    assert len(given) == 1


def test_time_is_a_rate_a_channel_or_an_array_of_its_own(tmp_path):
    """Common to all trials, or one for each; in the unit that the table says."""
    stamps = np.cumsum(np.full((6, 9), 20.0), axis=1) + np.arange(6)[:, None] * 1000
    with_time = np.concatenate([stamps[..., None].astype("f4"), X], axis=2)
    np.savez(tmp_path / "a.npz", X=X, T=with_time, y=OBJECTS, t=stamps, first=stamps[0])
    for time, expected in (("from:t[ms]", stamps), ("from:first[ms]", stamps[[0] * 6])):
        made = bring(tmp_path, f"a.npz,X,,from:y,1,{OWN},{time}")
        for recording, own in zip(made, expected, strict=True):
            np.testing.assert_allclose(recording.samples.fitted_s, own / 1000)
    for channels in (OWN, "2[N] 3[N] 4[V]", "*[N]"):
        made = bring(tmp_path, f"a.npz,T,trials rows channels,from:y,1,{channels},1[ms]")
        np.testing.assert_allclose(made[3].samples.fitted_s, stamps[3] / 1000)
        np.testing.assert_array_equal(made[3].samples.values, X[3])
    for path in list_recordings(tmp_path / "out"):
        path.unlink()
    (tmp_path / "out").rmdir()
    words = refusal(tmp_path, "a.npz,X,trials rows channels,from:y,1,*[N],pad_*/t[ms]")
    assert "line 2, column 'time'; write from: in front of it if arrays have that name" in words
    assert "a time for each of 9 rows" in refusal(tmp_path, f"a.npz,X,,from:y,1,{OWN},from:y[ms]")
    np.savez(tmp_path / "a.npz", X=X, y=OBJECTS, t=np.zeros((6, 9)))
    assert "times that increase" in refusal(tmp_path, f"a.npz,X,,from:y,1,{OWN},from:t[ms]")


def test_several_arrays_are_not_joined_and_the_refusal_says_what_to_do(tmp_path):
    """A name with a plus that is there is a name; one that is not there is said as ever."""
    np.savez(tmp_path / "a.npz", **{"F0": X, "F1": X, "F0+F2": X, "y": OBJECTS})
    for trials in ("F0+F1", "F0 + F1", "F*+y"):
        words = refusal(tmp_path, f"a.npz,{trials},,from:y,1,{OWN},rate:9Hz")
        assert "no arrays are joined" in words
        assert f"got 2, {trials}; save one array that holds the channels of all, as numpy" in words
    assert len(bring(tmp_path, f"a.npz,F0+F2,,from:y,1,{OWN},rate:9Hz")) == 6
    (tmp_path / "out").rename(tmp_path / "made")
    words = refusal(tmp_path, f"a.npz,F0+F9,,from:y,1,{OWN},rate:9Hz")
    assert "needed the name of an array; got 'F0+F9'" in words


@pytest.mark.parametrize("order", ["trials channels", "channels trials"])
def test_each_trial_may_be_a_single_scan(tmp_path, order):
    """One reading a grasp: an array of (trials, channels), whose axes have to be stated."""
    grasps = X[:, 0]
    np.save(tmp_path / "g.npy", grasps if order == "trials channels" else grasps.T)
    np.save(tmp_path / "y.npy", OBJECTS)
    words = refusal(tmp_path, "g.npy,,,from:y.npy,1,*[N],rate:1Hz")
    assert "6 trials of 3 scans of 1 channel" in words
    assert "6 trials of 1 scan of 3" in words
    made = bring(tmp_path, f"g.npy,,{order},from:y.npy,1,*[N],rate:1Hz")
    assert [item.manifest.labels["object"] for item in made] == OBJECTS.tolist()
    for recording, grasp in zip(made, grasps, strict=True):
        np.testing.assert_array_equal(recording.samples.values, grasp[None])
        assert recording.manifest.sensor.rate_hz == 1.0


def test_rows_are_padding_only_where_all_channels_of_the_array_end(tmp_path):
    """A channel that fails before the others is refused, also where it is the only one wanted."""
    padded = X.astype("f8")
    padded[2, 5:, 0] = np.nan
    np.savez(tmp_path / "a.npz", X=padded, y=OBJECTS)
    row = "a.npz,X,trials rows channels,from:y,1,{},rate:50Hz"
    assert "got nan in" in refusal(tmp_path, row.format("1[N]"))
    padded[2, 5:] = np.nan
    np.savez(tmp_path / "a.npz", X=padded, y=OBJECTS)
    lengths = [len(item.samples) for item in bring(tmp_path, row.format("1[N]"))]
    assert lengths == [9, 9, 5, 9, 9, 9]


def _cells(items):
    cells = np.empty(len(items), object)
    cells[:] = items
    return cells


@pytest.mark.parametrize("write", [write_mat5, write_mat73])
def test_each_cell_may_have_a_cell_of_times(tmp_path, write):
    """As the fields force and time of MATLAB's structures; another number of cells is refused."""
    lengths = range(5, 9)
    force = [X[n, :length].astype("f8") for n, length in enumerate(lengths)]
    stamps = [np.cumsum(np.arange(1.0, length + 1))[:, None] for length in lengths]
    held = {"force": force, "t": stamps, "fewer": stamps[:3]}
    write(tmp_path / "a.mat", {name: _cells(items) for name, items in held.items()}
          if write is write_mat5 else held)  # fmt: skip
    words = refusal(tmp_path, f"a.mat,force,rows channels,cup,1,{OWN},from:fewer[ms]")
    assert "a time for each of 5 rows" in words
    assert "3 cells" in words
    made = bring(tmp_path, f"a.mat,force,rows channels,cup,1,{OWN},from:t[ms]")
    for recording, values, times in zip(made, force, stamps, strict=True):
        np.testing.assert_array_equal(recording.samples.values, values.astype("f4"))
        np.testing.assert_allclose(recording.samples.fitted_s, times[:, 0] / 1000)


def test_a_stack_of_plain_arrays_needs_no_word_of_its_own(tmp_path):
    """Tables of before, of arrays (rows, columns), mean what they meant."""
    np.save(tmp_path / "a.npy", X[0])
    header = "file,label:object,channels,time\n"
    (made,) = bring(tmp_path, "a.npy,cup,1[N] 3[N],rate:50Hz", header=header)
    np.testing.assert_array_equal(made.samples.values, X[0][:, [0, 2]])
    assert made.manifest.groups == {"file": "a.npy"}
    (made,) = bring(tmp_path, "a.npy,cup,*[N],rate:50Hz", header=header)
    np.testing.assert_array_equal(made.samples.values, X[0])
    assert made.manifest.sensor.channels == ("1", "2", "3")


def test_a_large_stack_is_read_in_blocks(tmp_path, monkeypatch):
    """Trials of a block come from one read, whichever axis they lie on."""
    monkeypatch.setattr("taxel.recordings.imports.stacks.trials._BLOCK_BYTES", 2 * 9 * 3 * 4)
    write_hdf5(tmp_path / "a.h5", {"X": X, "Y": X.transpose(1, 2, 0), "y": OBJECTS})
    for row in ("a.h5,X,trials rows channels", "a.h5,Y,rows channels trials"):
        made = bring(tmp_path, f"{row},from:y,1,*[N],rate:50Hz")
        for recording, trial in zip(made, X, strict=True):
            np.testing.assert_array_equal(recording.samples.values, trial)
        for path in list_recordings(tmp_path / "out"):
            path.unlink()
