"""Claims about the tree of errors: it is drawn as it is, and each message is one plain line."""

import inspect
import pickle
import re

import pytest

from taxel import errors
from taxel.errors import BadInput, MissingExtra, RecordingFailed, TaxelError

CLASSES = [kind for _, kind in inspect.getmembers(errors, inspect.isclass)
           if issubclass(kind, TaxelError)]  # fmt: skip
BAD_INPUTS = [kind for kind in CLASSES if issubclass(kind, BadInput)]


def test_the_drawn_tree_is_the_tree():
    """Name, parent by indent, and the built-in class in brackets, line by line."""
    drawn: dict[str, tuple[str, str | None]] = {}
    parents = ["TaxelError"]
    for line in (errors.__doc__ or "").splitlines():
        match = re.match(r"^ {4}([│ ]*)[├└]── (\w+)(?: \((\w+)\))?", line)
        if match:
            depth = len(match[1]) // 4
            drawn[match[2]] = (parents[depth], match[3])
            parents = [*parents[: depth + 1], match[2]]
    assert set(drawn) == {kind.__name__ for kind in CLASSES} - {"TaxelError"}
    for name, (parent, built_in) in drawn.items():
        bases = [base.__name__ for base in getattr(errors, name).__bases__]
        assert bases == [parent, *([built_in] if built_in else [])], name


def test_every_error_but_the_first_says_what_it_is():
    assert all(kind.__doc__ for kind in CLASSES)
    assert all(issubclass(kind, Exception) for kind in CLASSES)


@pytest.mark.parametrize("kind", BAD_INPUTS)
def test_a_bad_input_says_needed_got_and_mend_in_one_line(kind: type[BadInput]):
    error = kind("a whole file", "half of one", "copy it again")
    assert str(error) == "needed a whole file; got half of one; copy it again."
    assert (error.needed, error.got, error.mend) == ("a whole file", "half of one", "copy it again")
    assert isinstance(error, ValueError)


@pytest.mark.parametrize("end", ["\n", "\r\n", "\x0b", "\u2028"])
def test_a_line_end_in_somebodys_name_does_not_break_the_line(end: str):
    error = BadInput("a known column", f"'force{end}N'", f"call it label:force{end}N")
    assert len(str(error).splitlines()) == 1
    assert error.mend == f"call it label:force{end}N"


def test_a_missing_package_names_the_extra_to_install():
    line = str(MissingExtra("scipy", "sim", "the simulators"))
    assert line.startswith("needed ")
    assert "pip install 'taxel[sim]'" in line
    assert "\n" not in line


def test_a_refused_disk_is_an_oserror_with_its_line_unchanged():
    error = RecordingFailed("needed room; got none; free some.")
    assert isinstance(error, OSError)
    assert str(error) == "needed room; got none; free some."


@pytest.mark.parametrize(
    "error",
    [
        *(kind("a", "b", "c") for kind in BAD_INPUTS),
        RecordingFailed("needed room; got none; free some."),
        MissingExtra("scipy", "sim", "the simulators"),
    ],
    ids=lambda error: type(error).__name__,
)
def test_an_error_crosses_from_a_worker_process_unchanged(error: TaxelError):
    """Table 4.1 works in processes: an error that cannot be unpickled breaks the whole pool."""
    there = pickle.loads(pickle.dumps(error))
    assert type(there) is type(error)
    assert str(there) == str(error)
