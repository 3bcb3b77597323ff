"""Claims about axes: stated in words, found where one reading only is possible, never guessed."""

import numpy as np
import pytest

from taxel.errors import BadTable
from taxel.recordings.imports.stacks.axes import Axes, check_axes, find_axes, parse_axes

ANY = range(1, 100)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("trials rows channels", ("trials", "rows", "channels")),
        (" Trials, rows,height ,width ", ("trials", "rows", "height", "width")),
        ("trials 1 channels rows 1", ("trials", "1", "channels", "rows", "1")),
        ("rows", ("rows",)),
        ("trials channels", ("trials", "channels")),
        ("trials height width", ("trials", "height", "width")),
    ],
)
def test_axes_are_words(text, words):
    """With blanks or commas between them, in capitals or not."""
    assert parse_axes(text, "here") == Axes(words)


@pytest.mark.parametrize(
    "text", ["trials", "channels", "height width", "trials rows rows", "trial rows", "rows 2", ""]
)
def test_other_words_are_refused(text):
    """Rows, or trials of a single scan, must be there, and no word twice but the 1."""
    with pytest.raises(BadTable, match="correct the column 'axes'"):
        parse_axes(text, "here")


def test_a_second_axis_of_channels_is_called_parts():
    """It claims no grid; the refusal of the same word twice says so."""
    axes = parse_axes("trials channels parts rows", "here")
    trial = np.arange(39 * 2 * 5).reshape(1, 39, 2, 5)
    table, names = axes.table(trial), axes.names(trial.shape)

    assert (table.shape, names[:3], names[-1]) == ((5, 78), ("1_1", "1_2", "2_1"), "39_2")
    np.testing.assert_array_equal(table[:, 3], trial[0, 1, 1])
    with pytest.raises(BadTable, match="write parts for the second axis of channels"):
        parse_axes("channels channels rows", "here")


def test_axes_fit_the_shape():
    """As many, and a 1 of length 1."""
    check_axes(Axes(("trials", "rows", "1")), (4, 3, 1), "X")
    for axes in (("trials", "rows"), ("trials", "rows", "channels", "1"), ("trials", "1", "rows")):
        with pytest.raises(BadTable, match="as many axes as X has"):
            check_axes(Axes(axes), (4, 3, 1), "X")


@pytest.mark.parametrize(
    ("words", "names"),
    [
        ("rows channels", ("1", "2", "3", "4", "5", "6")),
        ("rows", ("1",)),
        ("rows height width", ("r1c1", "r1c2", "r1c3", "r2c1", "r2c2", "r2c3")),
        ("rows width height", ("r1c1", "r1c2", "r2c1", "r2c2", "r3c1", "r3c2")),
        ("rows channels parts", ("1_1", "1_2", "1_3", "2_1", "2_2", "2_3")),
        ("rows parts channels", ("1_1", "1_2", "2_1", "2_2", "3_1", "3_2")),
        ("rows height parts", ("r1_1", "r1_2", "r1_3", "r2_1", "r2_2", "r2_3")),
        ("rows height channels", ("r1_1", "r1_2", "r1_3", "r2_1", "r2_2", "r2_3")),
    ],
)
def test_channels_are_called_by_number_or_by_row_and_column(words, names):
    """Whatever the order of a grid's sides in the array."""
    axes = parse_axes(words, "here")
    shape = {1: (7,), 2: (7, 6), 3: (7, 2, 3)}[len(axes.words)]
    assert axes.names(shape) == names


def test_each_value_is_at_its_own_row_and_name():
    """Also where channels stand before rows, and the grid's columns before its rows."""
    trial = np.arange(2 * 3 * 4).reshape(1, 2, 3, 4)
    axes = parse_axes("trials width rows height", "here")
    table, names = axes.table(trial), axes.names(trial.shape)
    assert table.shape == (3, 8)
    for row in range(3):
        for height in range(4):
            for width in range(2):
                at = names.index(f"r{height + 1}c{width + 1}")
                assert table[row, at] == trial[0, width, row, height]


@pytest.mark.parametrize(
    ("shape", "trials", "channels", "found"),
    [
        ((20, 50, 3), 20, range(3, 4), "trials rows channels"),
        ((20, 3, 50), 20, range(3, 4), "trials channels rows"),
        ((50, 3, 20), 20, range(3, 4), "rows channels trials"),
        ((20, 50), 20, range(1, 2), "trials rows"),
        ((50, 20), 20, range(1, 2), "rows trials"),
        ((20, 50), 20, range(50, 51), "trials channels"),
        ((20, 72), 20, range(72, 100), "trials channels"),
        ((20, 50, 300), 20, ANY, "trials channels rows"),  # no more than 99 channels here
    ],
)
def test_axes_are_found_where_one_reading_only_is_possible(shape, trials, channels, found):
    """By how many labels and how many channels there are."""
    axes = find_axes([shape], "X", many=True, trials=trials, channels=channels)
    assert str(axes) == found


@pytest.mark.parametrize(
    ("shape", "trials", "channels", "words"),
    [
        ((20, 50, 16), 20, ANY, "'trials rows channels' .20 trials of 50 scans of 16 channels. or "
                                "'trials channels rows' .20 trials of 16 scans of 50 channels."),
        ((20, 20, 3), 20, range(3, 4), "'trials rows channels' .* or 'rows trials channels'"),
        ((20, 3, 3), 20, range(3, 4), "'trials rows channels' .* or 'trials channels rows'"),
        ((20, 50, 3), None, range(3, 4), "'trials rows channels' .* or 'rows trials channels'"),
        ((20, 72), 20, ANY, "'trials rows' .20 trials of 72 scans of 1 channel. or "
                            "'trials channels' .20 trials of 1 scan of 72 channels."),
        ((20, 9, 4, 4), 20, ANY, "'trials rows height width' .* or 'trials height rows width'"),
    ],
)  # fmt: skip
def test_two_readings_are_refused_with_both(shape, trials, channels, words):
    """In one line that says what each of them would make of the array."""
    with pytest.raises(BadTable, match=words) as caught:
        find_axes([shape], "X", many=True, trials=trials, channels=channels)
    assert "write the right one in the column 'axes'" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("shape", "trials", "channels"),
    [((20, 50, 16), 21, ANY), ((20, 50, 16), 20, range(3, 4)), ((2,) * 5, 2, ANY), ((), None, ANY)],
)
def test_no_reading_is_refused(shape, trials, channels):
    """With what was wanted."""
    with pytest.raises(BadTable, match="say in the column 'axes'"):
        find_axes([shape], "X", many=True, trials=trials, channels=channels)


def test_an_array_with_one_label_may_be_one_trial():
    """Both are named; it is taken so only where nothing else is possible."""

    def find(channels, one_label=True):
        return str(find_axes([(39, 2, 250)], "X", many=True, trials=None, channels=channels,
                             one_label=one_label))  # fmt: skip

    with pytest.raises(BadTable, match="one reading of X of shape 39 × 2 × 250") as caught:
        find(range(1, 20_000))
    single, many = str(caught.value).split("suggests; ")
    assert "'height width rows' (250 scans of 78 channels) if the file is one trial, as" in single
    assert "'rows height width' (39 scans of 500 channels) or" in single
    assert many.startswith("'trials rows channels' (39 trials of 2 scans of 250 channels) or 'tria")
    assert "if it holds many; write the right one in the column 'axes'" in many

    with pytest.raises(BadTable, match="'trials rows channels'") as caught:
        find(range(1, 20_000), one_label=False)
    assert "one trial" not in str(caught.value)
    assert find(range(78, 79)) == "height width rows"
    with pytest.raises(BadTable, match="say in the column 'axes'"):
        find(range(78, 79), one_label=False)
    with pytest.raises(BadTable, match=r"'height rows width' .* if the .* suggests; write"):
        find(range(300, 9_999))


def test_trials_of_different_length_say_which_axis_is_which():
    """All of them have the same channels; where they are equally long, both readings are."""
    shapes = [(50, 16), (61, 16), (16, 16)]
    assert str(find_axes(shapes, "X", many=False, trials=None, channels=ANY)) == "rows channels"
    turned = [shape[::-1] for shape in shapes]
    assert str(find_axes(turned, "X", many=False, trials=None, channels=ANY)) == "channels rows"
    with pytest.raises(BadTable, match="one reading"):
        find_axes([(50, 16)] * 3, "X", many=False, trials=None, channels=ANY)
    with pytest.raises(BadTable, match="say in the column"):
        find_axes([(50, 16), (50,)], "X", many=False, trials=None, channels=ANY)
