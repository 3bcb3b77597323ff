"""How large the code is: what is counted, and the limits that hold (docs/decisions/0048)."""

from pathlib import Path

import pytest
from supply.size import Size, measure

SOURCE = Path(__file__).parents[2] / "src"
MODULE = '''"""Says what it is."""

LIMIT = 3.0  # a comment
"""What the constant is: documentation too."""


class Force:
    """A class."""

    def read_n(self, a, *, b=1, **more: float) -> float:
        """Return the force.

        Two lines more.
        """
        # a comment

        def inner():
            return """two
            lines"""

        return inner() and a

    def bare(self, volts: float): ...


def _hidden(one, two, three, four, five, six, seven, *eight): ...
'''


@pytest.fixture(scope="module")
def size() -> Size:
    return measure(SOURCE)


def test_code_lines_leave_out_documentation_comments_and_blank_lines(tmp_path: Path):
    (tmp_path / "force.py").write_text(MODULE)
    found = measure(tmp_path)

    assert (found.modules, found.lines, found.code_lines) == (1, 26, 9)
    assert [(own.name, own.lines, own.parameters) for own in found.functions] == [
        ("Force.read_n", 5, 3), ("Force.read_n.inner", 3, 0), ("Force.bare", 1, 1),
        ("_hidden", 1, 8),
    ]  # fmt: skip
    assert found.wide == ["force.py: _hidden"]
    assert found.undocumented == ["force.py: Force.bare"]
    assert (found.median, found.p90, found.units_named) == (2.0, 5, 1.0)


def test_a_protocols_method_is_documented_once_and_a_quantity_needs_its_unit(tmp_path: Path):
    (tmp_path / "one.py").write_text(
        "class Gauge(Protocol):\n    def push(self, value: float) -> None:\n"
        '        """Take it."""\n'
        "class Own:\n    def push(self, value: float) -> None: ...\n"
        'def scale(value: float) -> float:\n    """Return it."""\n'
    )
    found = measure(tmp_path)

    assert found.undocumented == []
    assert found.units_named == pytest.approx(2 / 3)


def test_functions_stay_short(size: Size):
    assert size.median <= 8
    assert size.p90 <= 22


def test_no_function_takes_more_than_seven_parameters(size: Size):
    assert size.wide == []


def test_every_public_function_is_documented_and_units_are_named(size: Size):
    assert size.undocumented == []
    assert size.units_named >= 0.9


@pytest.mark.parametrize("place", ["src", "tests"])
def test_no_file_is_longer_than_400_lines(place: str):
    long = {
        str(path): count
        for path in sorted((SOURCE.parent / place).rglob("*.py"))
        if (count := len(path.read_text("utf-8").splitlines())) > 400
    }

    assert not long
