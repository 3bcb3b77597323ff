"""Foreign text is printed literally, and only in one way."""

import ast
import html
import io
import json
import re
import subprocess
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.live import Live
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

import taxel
from taxel.plain_text import (
    MOST_NAME,
    figures,
    html_text,
    json_text,
    noun_of,
    number_of,
    several,
    shell_words,
    short_names,
    visible,
    visible_line,
    visible_names,
    without_controls,
)
from taxel.views.console import PlainConsole, progress_on

SOURCE = Path(taxel.__file__).parent
HOSTILE = ["cup[blue]", "cup[green]", "[/red]", "a\x1b[2Jb", "a\\x1b[2Jb", "$x^$", "<script>",
           "\u202eevil", ":cup:", "x\nall checksums valid", "\x9b31m", "\udcff", "\x00",
           "\ue000", "a\u200bb", "ab"]  # fmt: skip
ANY_TEXT = st.text(st.characters(exclude_categories=()), max_size=40) | st.text("\\xu\x1b01b")


@given(ANY_TEXT, ANY_TEXT)
def test_two_names_are_shown_alike_only_if_they_are_equal(first, second):
    assert (visible(first) == visible(second)) == (first == second)


@given(ANY_TEXT)
def test_a_shown_name_is_one_line_of_characters_that_can_be_seen(text):
    for show in (visible, visible_line):
        assert show(text).isprintable()


@given(ANY_TEXT)
def test_a_message_may_pass_twice(text):
    for show in (visible_line, without_controls):
        assert show(show(text)) == show(text)
    assert visible_line(visible(text)) == visible(text)


def test_escapes_are_those_of_python():
    assert visible("a\x1b[2Jb") == r"a\x1b[2Jb"
    assert visible("\u202e\U000e0041\x7f\n") == r"\u202e\U000e0041\x7f\x0a"
    assert visible("Tasse, чашка, 杯, 😀") == "Tasse, чашка, 杯, 😀"
    assert visible(r"C:\data") == r"C:\data"


def test_a_long_name_is_shortened_and_stays_itself():
    first, second = "x" * 10**6 + "a", "x" * 10**6 + "b"

    assert len(visible(first)) < MOST_NAME
    assert visible(first) != visible(second)
    assert "1,000,001 characters" in visible(first)


@given(st.lists(st.text(max_size=12), min_size=1, max_size=6), st.integers(2, 20))
def test_short_names_differ_where_the_names_do(names, most):
    short = short_names(names, most)

    assert len(set(short)) == len(set(names))
    assert all(len(name) <= max(most, 3) for name in short)


def test_names_are_cut_only_where_they_must_be():
    assert short_names(["sphere", "cube"], 6) == ["sphere", "cube"]
    assert short_names(["cup[blue]", "cup[green]", "cube"], 6) == ["cup[b…", "cup[g…", "cube"]
    assert short_names(["cup[blue]", "cup[green]", "cube"], 4) == ["cu…1", "cu…2", "cube"]


@given(st.recursive(ANY_TEXT | st.integers(), lambda deeper: st.lists(deeper) |
                    st.dictionaries(ANY_TEXT, deeper), max_leaves=8))  # fmt: skip
def test_json_gives_back_what_was_said_and_a_terminal_can_show_it(data):
    text = json_text(data)

    assert json.loads(text) == data
    assert text.isprintable()


def test_html_has_neither_tags_nor_controls_of_a_name():
    for name in HOSTILE:
        shown = html_text(name)
        assert not set(shown) & set("<>\"'")
        assert html.unescape(shown).isprintable()


@pytest.mark.parametrize("word", ["a b", "it's", "\x1b[2J", "\n", "a\\b\x1b", "\udcff", "é\u202e"])
def test_a_command_can_be_pasted_whatever_it_names(word):
    line = shell_words("printf", "%s", word)

    found = subprocess.run(["bash", "-c", line], capture_output=True, check=True).stdout
    assert line.isprintable()
    assert found == word.encode("utf-8", "surrogateescape")


def drawn(*things: object, terminal: bool = True) -> str:
    """Return what a console hands to the terminal."""
    out = io.StringIO()
    console = PlainConsole(file=out, width=200, force_terminal=terminal, color_system="truecolor")
    for thing in things:
        console.print(thing)
    return out.getvalue()


def without_colours(text: str) -> str:
    """Take away what Rich itself sends: colours and the cursor's visibility and movement."""
    return re.sub(r"\x1b\[(?:[0-9;]*m|\?25[lh]|[0-9]*[AK]|[0-9]*G)|\r", "", text)


@pytest.mark.parametrize("name", HOSTILE)
def test_a_console_prints_a_name_literally_wherever_it_stands(name):
    table = Table(title=name, caption=name)
    table.add_column(name)
    table.add_row(name)
    table.add_row(Text(name, "red"))

    for thing in (name, Text(name, "bold"), table, Panel(Text(name), title=Text(name))):
        shown = without_colours(drawn(thing))
        assert all(line.isprintable() for line in shown.split("\n")), shown
        first = without_controls(name).split("\n")[0]
        assert first in shown


def test_live_screens_and_progress_obey_no_name_either():
    out = io.StringIO()
    console = PlainConsole(file=out, width=200, force_terminal=True)
    with Live(console=console, auto_refresh=False) as live:
        live.update(Text("a\x1b[2Jb"), refresh=True)
    with progress_on(console) as bar:
        bar.add_task("a[red]\x1b[2Jb[/]", total=2)
        bar.refresh()

    shown = without_colours(out.getvalue())
    assert "\x1b" not in shown
    assert r"a\x1b[2Jb" in shown
    assert r"a[red]\x1b[2J" in shown


def test_progress_prints_a_line_now_and_then_where_there_is_no_terminal(
    monkeypatch: pytest.MonkeyPatch,
):
    now_s = [100.0]
    monkeypatch.setattr("taxel.views.console.monotonic", lambda: now_s[0])
    out = io.StringIO()
    with progress_on(PlainConsole(file=out, width=40)) as bar:
        task = bar.add_task("starting", total=None)
        for passed_s in range(0, 50, 5):
            now_s[0] = 100.0 + passed_s
            bar.update(task, description=f"choosing\x1b {passed_s}", completed=passed_s)
        bar.update(task, total=60)
        now_s[0] = 170.0
        bar.update(task, advance=1)

    assert out.getvalue().splitlines() == [
        r"20 s · choosing\x1b 20", r"40 s · choosing\x1b 40", r"70 s · choosing\x1b 45 · 46 of 60"
    ]  # fmt: skip


def test_quick_work_prints_no_progress_where_there_is_no_terminal():
    out = io.StringIO()
    with progress_on(PlainConsole(file=out)) as bar:
        bar.update(bar.add_task("starting", total=None), description="reading")

    assert out.getvalue() == ""


WRITERS = {
    "cli/printing.py": {"print", "sys.stdout.write"},
    # Before anything is imported that could print: its own words, and one line made visible.
    "cli/main.py": {"print", "sys.stderr.write"},
    # Children that speak JSON to the process that started them.
    "sources/cameras/process.py": {"sys.stdout.write"},
    "bench/teng/kill_recorder.py": {"sys.stdout.write"},
    "bench/faults/supervised_station.py": {"sys.stdout.write"},
    # Tools for whoever makes the shipped shading or a page of the docs, not verbs.
    "gel/shading_fit.py": {"print"},
    "decisions/reasons.py": {"print"},
}
"""Module → what it may write with; all others print through cli/printing.py."""
MAKERS = {
    "views/console.py": {"Console", "PlainConsole", "TextColumn", "BarColumn"},
    "plain_text.py": {"html.escape", "escape"},
    "plotting.py": {"matplotlib.use", "matplotlib.pyplot"},
}
"""Module → what it alone calls or imports, for all others."""
FORBIDDEN = ("rich.markup", "rich.print", "rich.pretty", "rich.progress.track", "rich.prompt")


def modules() -> list[Path]:
    return sorted(SOURCE.rglob("*.py"))


def called(path: Path) -> set[str]:
    """Return what a module calls, such as html.escape, and the modules that it imports."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module} | {f"{node.module}.{name.name}" for name in node.names}
        elif isinstance(node, ast.Import):
            found |= {name.name for name in node.names}
        elif isinstance(node, ast.Call):
            found.add(ast.unparse(node.func))
    return found


@pytest.mark.slow
def test_no_other_module_writes_to_the_output():
    for path in modules():
        allowed = WRITERS.get(path.relative_to(SOURCE).as_posix(), set())
        used = called(path) & {"print", "sys.stdout.write", "sys.stderr.write"}
        assert used <= allowed, path


@pytest.mark.slow
def test_consoles_escapes_and_figures_are_made_in_one_place_each():
    for path in modules():
        used = called(path)
        for place, names in MAKERS.items():
            if path.relative_to(SOURCE).as_posix() != place:
                assert not used & names, path
        assert not any(name.startswith(FORBIDDEN) for name in used), path


@pytest.mark.slow
def test_no_string_is_rich_markup():
    """`[red]…[/]` would be printed as it stands: colours are styles."""
    for path in modules():
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                assert "[/]" not in node.value, (path, node.lineno)
                assert "[bold]" not in node.value, (path, node.lineno)


def test_the_page_s_script_never_makes_html_of_text():
    for path in (SOURCE / "views" / "page" / "static").glob("*.js"):
        text = path.read_text()
        for way in ("innerHTML", "outerHTML", "insertAdjacentHTML", "document.write", "eval("):
            assert way not in text, path


def test_a_list_of_names_shows_where_each_ends():
    """A name that holds a comma stands in quotes; the others as they are."""
    assert visible_names(["cup, red", "cup", "a\nb"]) == '"cup, red", cup, a\\x0ab'


@pytest.mark.parametrize(("numbers", "shown"), [
    ((0.0, 90.0, 88.2), ["0", "90", "88.2"]),
    ((151.345, 151.345002), ["151.345", "151.345002"]),
    ((1709294400.01, 9999.0), ["1709294400.01", "9999"]),
    ((0.5, 0.5 + 1e-9, 0.5), ["0.5", "0.500000001", "0.5"]),
    ((1.0, 1.0 + 2.0**-52), ["1", "1.0000000000000002"]),
    ((1e300, float("inf"), 100.0), ["1e+300", "inf", "100"]),
])  # fmt: skip
def test_figures_that_differ_look_different(numbers: tuple[float, ...], shown: list[str]) -> None:
    """To the sixth decimal at least, without zeros behind."""
    assert figures(*numbers) == shown


@pytest.mark.parametrize(
    ("name", "several_named"),
    [("session", "sessions"), ("day", "days"), ("pitch", "pitches"), ("body", "bodies"),
     ("box", "boxes"), ("class", "classes"), ("epoch", "epochs"), ("axis", "axes"),
     ("cut_from", "files")],
)  # fmt: skip
def test_several_of_a_group_are_named_as_in_english(name: str, several_named: str) -> None:
    assert several(name) == several_named


@pytest.mark.parametrize(("count", "form", "shown"), [
    (0, "", "0 more tries"), (1, "", "1 more try"), (1, ",", "1 more try"),
    (1234, "", "1234 more tries"), (1234, ",", "1,234 more tries"),
])  # fmt: skip
def test_a_number_stands_before_the_singular_only_where_it_is_1(
    count: int, form: str, shown: str
) -> None:
    assert number_of(count, "more try", form) == shown


def test_a_group_whose_name_is_no_noun_is_named_by_what_its_values_are() -> None:
    assert number_of(1, "cut_from") == "1 file"
    assert number_of(4, "cut_from") == "4 files"
    assert noun_of("session") == "session"


def test_no_text_leaves_the_plural_open() -> None:
    """Of "1 thread(s)" a reader would have to choose; the notes of stored figures stay."""
    open_ended = re.compile(r"\} [a-z -]+\(e?s\)")
    found = [path.name for path in modules() if open_ended.search(path.read_text())]
    assert found == ["claims_card.py"]
