"""Nothing of a bundle becomes C but names of known characters and whole numbers."""

import string

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taxel.bundles.avr.c_text import c_number, c_numbers, c_origin, c_strings
from taxel.errors import BadBundle

DIGEST = "0123456789abcdef" * 4


@pytest.mark.parametrize("software", [
    "taxel **//\n__attribute__((constructor)) void f(void) {}\n/*", "taxel */", "taxel 1\\",
    "taxel", "taxel 1 2", "taxel 1\n", "", "taxel " + "1" * 99])  # fmt: skip
def test_a_version_that_is_none_is_refused(software: str) -> None:
    with pytest.raises(BadBundle, match="version"):
        c_origin(DIGEST, software)


@pytest.mark.parametrize("digest", ["*/ int x; /*" * 6, "G" * 64, "a" * 63, "a" * 64 + "\n", ""])
def test_a_digest_is_hexadecimal(digest: str) -> None:
    with pytest.raises(BadBundle, match="hexadecimal"):
        c_origin(digest, "taxel 0.1.0")
    assert c_origin(DIGEST, "taxel 0.1.0") == "data 0123456789ab with taxel 0.1.0"


@given(st.lists(st.text(max_size=70), min_size=1, max_size=4))
@settings(settings.get_profile("fuzz"))
def test_a_name_is_a_string_of_known_characters_or_refused(names: list[str]) -> None:
    """The quotes that stand are those that were put there; nothing escapes, begins or ends."""
    try:
        found = c_strings(names, "classes")
    except BadBundle:
        return
    inner = found[1:-1].split('", "')
    assert len(inner) == len(names) == len(set(inner))
    allowed = set(string.printable) - set('"\\?%\t\n\r\x0b\x0c`')
    assert all(set(name) <= allowed for name in inner)


def test_names_that_become_one_are_refused() -> None:
    assert c_strings(["é", "b"], "classes") == '"_", "b"'
    with pytest.raises(BadBundle, match="stay apart"):
        c_strings(["é", "ü"], "classes")


@pytest.mark.parametrize("value", ["12; int x", 1.5, True, None, -1, 256, np.float64(3)])
def test_a_number_is_whole_and_in_its_range(value: object) -> None:
    with pytest.raises(BadBundle):
        c_number(value, 0, 255)
    assert c_number(np.int16(-3), -5, 5, "U") == "(-3)"
    assert c_number(7, 0, 255, "UL") == "7UL"


def test_numbers_of_arrays_are_whole() -> None:
    assert c_numbers(np.array([[1, -2]], np.int8)) == ["1", "-2"]
    for wrong in (np.array([0.5]), np.array(["1; x"]), np.array([{}])):
        with pytest.raises(BadBundle):
            c_numbers(wrong)
