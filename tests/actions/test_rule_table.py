"""From a class and its confidence to an action, by a table that is checked before anything runs."""

from pathlib import Path

import pytest

from taxel.actions.alarm import Level
from taxel.actions.rule_table import read_rules
from taxel.errors import BadTable

KNOWN = {"material": ("aluminium", "glass", "plastic"), "shape": ("ball", "cube")}
TABLE = """# waste
class,least_confidence,action
aluminium,0.9,metal bin
aluminium,0.6,by hand
glass,0,glass bin
*,0.5,other bin
UNKNOWN,0,by hand
"""


def write(folder: Path, text: str) -> Path:
    path = folder / "rules.csv"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("label", "confidence", "action"),
    [
        ("aluminium", 0.95, "metal bin"),
        ("aluminium", 0.9, "metal bin"),
        ("aluminium", 0.89, "by hand"),
        ("aluminium", 0.59, ""),
        ("glass", None, "glass bin"),
        ("plastic", 0.5, "other bin"),
        ("plastic", float("nan"), ""),
        ("UNKNOWN", float("nan"), "by hand"),
    ],
)
def test_the_surest_line_that_is_reached_gives_the_action(
    tmp_path: Path, label: str, confidence: float | None, action: str
) -> None:
    assert read_rules(write(tmp_path, TABLE), KNOWN).action("material", label, confidence) == action


def test_any_class_stands_for_those_without_a_line_and_never_for_unknown(tmp_path: Path) -> None:
    table = read_rules(write(tmp_path, "class,least_confidence,action\nglass,1,a\n*,0,b\n"), KNOWN)

    assert table.action("material", "glass", 0.5) == ""
    assert table.action("material", "plastic", 0.5) == "b"
    assert table.action("material", "UNKNOWN", 0.5) == ""


def test_a_line_with_a_target_is_for_that_label_alone(tmp_path: Path) -> None:
    text = "target,class,least_confidence,action\nshape,ball,0.5,roll\nmaterial,*,0,pick\n"
    table = read_rules(write(tmp_path, text), KNOWN)

    assert table.action("shape", "ball", 0.6) == "roll"
    assert table.action("shape", "cube", 0.6) == ""
    assert table.action("material", "glass", 0.6) == "pick"


def test_a_line_may_raise_an_alarm_of_a_level(tmp_path: Path) -> None:
    text = "class,least_confidence,action,alarm\nglass,0.5,stop,danger\nplastic,0,go on,\n"
    table = read_rules(write(tmp_path, text), KNOWN)

    assert table.alarms
    assert [rule.alarm for rule in table.rules] == [Level.DANGER, None]
    assert not read_rules(write(tmp_path, TABLE), KNOWN).alarms


HEAD = "class,least_confidence,action\n"


@pytest.mark.parametrize(
    ("text", "needed"),
    [
        ("", "a first line class,least_confidence,action"),
        ("class,action\nglass,bin\n", "a first line"),
        ("class,least_confidence,action,bell\nglass,0,a,1\n", "a first line"),
        (
            "class,least_confidence,action,alarm\nglass,0,a,yes\n",
            "an alarm that is warning or danger",
        ),
        (HEAD, "at least one line of rules"),
        (HEAD + "glass,0.5\n", "3 cells"),
        (HEAD + "wood,0.5,bin\n", "a class among aluminium, ball, cube, glass, plastic"),
        (HEAD + "glass,1.5,bin\n", "a least_confidence within 0 and 1"),
        (HEAD + "glass,nan,bin\n", "a least_confidence within 0 and 1"),
        (HEAD + "glass,much,bin\n", "a least_confidence within 0 and 1"),
        (HEAD + "UNKNOWN,0.5,wait\n", "least_confidence 0 for UNKNOWN, which has no confidence"),
        (HEAD + "glass,0.5,\n", "an action of 1 to 64"),
        (HEAD + f"glass,0.5,{'x' * 65}\n", "an action of 1 to 64"),
        (HEAD + "glass,0.5,a\nglass,0.50,b\n", "one action for a class and confidence"),
        ("target," + HEAD + "colour,glass,0.5,bin\n", "a target among material, shape"),
        ("target," + HEAD + "shape,glass,0.5,bin\n", "a class among ball, cube"),
        (HEAD + f"glass,0.5,{140_000 * 'x'}\n", "a table (CSV)"),
    ],
)
def test_what_cannot_be_a_table_is_refused_in_one_line(
    tmp_path: Path, text: str, needed: str
) -> None:
    with pytest.raises(BadTable) as refused:
        read_rules(write(tmp_path, text), KNOWN)

    assert str(refused.value).startswith(f"needed {needed}")
    assert "\n" not in str(refused.value)
