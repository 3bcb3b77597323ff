"""The documentation is true: its links lead somewhere, its verbs exist, its walk-through works."""

import csv
import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from taxel.bundles.shipped import CUP_POUR, DEFAULT_WARNING
from taxel.cli.main import VERBS, load_verb, main, split_command
from taxel.cli.old_spellings import refuse_old
from taxel.cli.options.rules import check_rules
from taxel.cli.parsing import BadOption, parse
from taxel.errors import TaxelError

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
OWN_ARRAY = ROOT / "docs" / "how-to" / "own-array.md"
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
SHELL = re.compile(r"^```(?:sh|bash|console)\n(.*?)^```", re.M | re.S)
RUNS_WARNING = re.compile(r"taxel (?:live|sweep) +(slip-both-gels|cup-pour|slip-rule)\b")
PICTURED = re.compile(r"(?<=^!\[The page)[^\n]*page\.png\)\n\n\*.*?\*$", re.M | re.S)
"""A picture's caption names what ran when it was taken."""
ANY_BLOCK = re.compile(r"^```.*?^```", re.M | re.S)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_relative_links_lead_to_files_and_headings_that_exist(page: Path):
    broken = []
    for target in LINK.findall(ANY_BLOCK.sub("", page.read_text("utf-8"))):
        if re.match(r"[a-z]+:", target):
            continue
        path, _, heading = target.partition("#")
        there = (page.parent / path) if path else page
        if not there.exists() or (heading and heading not in _headings(there)):
            broken.append(target)

    assert broken == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_verb_in_a_code_block_or_in_backticks_exists(page: Path):
    text = page.read_text("utf-8")
    code = [*ANY_BLOCK.findall(text), *re.findall(r"`[^`\n]+`", ANY_BLOCK.sub("", text))]
    named = {
        verb
        for part in code
        for verb in re.findall(r"(?:^|[`$ ])taxel ([a-z]+(?:-[a-z]+)*)\b(?!:)", part, re.M)
    }

    assert named - set(VERBS) == set()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_command_as_it_is_printed_is_understood(page: Path):
    """Options exist, take what is given, and none swallows the word behind it."""
    refused = []
    for line, whole in _commands(page.read_text("utf-8")):
        words = shlex.split(line, comments=True)[1:]
        if words[1:] == ["--help"]:
            continue
        try:
            refuse_old(words)
            command, rest = split_command(words)
            check_rules(parse(load_verb(command), command, rest), rest)
        except BadOption as error:
            if whole or "; got none; " not in str(error):  # part of a command lacks words
                refused.append(f"{line}: {error}")
        except TaxelError as error:
            refused.append(f"{line}: {error}")

    assert refused == []


@pytest.mark.parametrize(
    "page",
    [page for page in PAGES if "decisions" not in page.parts and page.name != "figures.md"],
    ids=lambda page: str(page.relative_to(ROOT)),
)
def test_what_a_page_has_a_user_run_live_is_the_default_warning(page: Path):
    """Of the warnings that come with taxel, only that one is not silent on gels that shear."""
    text = PICTURED.sub("", page.read_text("utf-8"))
    code = [*ANY_BLOCK.findall(text), *re.findall(r"`[^`\n]+`", ANY_BLOCK.sub("", text))]
    run = {name for part in code for name in RUNS_WARNING.findall(part)}

    assert run <= {DEFAULT_WARNING}


def test_an_example_that_watches_a_cup_uses_the_default_warning():
    texts = [path.read_text("utf-8") for path in (ROOT / "examples").glob("*.py")]

    assert any("shipped_bundle(DEFAULT_WARNING)" in text for text in texts)
    assert not any(re.search(r"CUP_POUR|shipped_bundle\(\"", text) for text in texts)


@pytest.mark.parametrize(
    ("verb", "words"),
    [
        ("live", f"{DEFAULT_WARNING}, {CUP_POUR} or slip-rule, which come with taxel"),
        ("sweep", f"{DEFAULT_WARNING}, {CUP_POUR} or slip-rule, which come with taxel"),
        ("info", f"such as {DEFAULT_WARNING}, which comes with taxel"),
    ],
)
def test_help_names_the_default_warning_first(
    verb: str, words: str, capsys: pytest.CaptureFixture[str]
):
    with pytest.raises(SystemExit):
        main([verb, "--help"])

    assert words in re.sub(r"[│\s]+", " ", capsys.readouterr().out)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_no_page_names_a_machine_path(page: Path):
    assert not re.search(r"(/work/|/home/|/tmp/|/root/)", page.read_text("utf-8"))


@pytest.mark.slow
def test_the_own_array_page_works_as_it_is_written(tmp_path, monkeypatch, capsys):
    """Its commands, in its order, on data of the kind it describes; only fewer epochs and minutes.

    The new recordings are those that were imported.
    """
    monkeypatch.chdir(tmp_path)
    _write_own_data(tmp_path / "data")
    (tmp_path / "new-recordings").symlink_to(tmp_path / "recordings")
    done = []
    for line in "".join(SHELL.findall(OWN_ARRAY.read_text("utf-8"))).splitlines():
        words = shlex.split(line)
        if words[:1] != ["taxel"] or "--allow-code" in words:
            continue
        words = ["4" if before == "--epochs" else word
                 for before, word in zip(["", *words], words, strict=False)]  # fmt: skip
        if words[1] == "live" and words[3].endswith(".mcap"):
            words[3] = f"replay://{words[3]}?speed=max"  # a test does not wait
        if words[1] == "train" and "--model" not in words:
            words += ["--minutes", "0.05"]
        main(words[1:])  # bad input would raise SystemExit
        done.append(words[1])

    assert done == ["import", "info", "view", "audit", "evaluate", "split", "train", "bundle",
                    "evaluate", "live", "train", "bundle", "live"]  # fmt: skip
    assert "accuracy against ground truth" in capsys.readouterr().out
    assert (tmp_path / "object.taxel").is_file()


def test_the_layout_function_of_the_own_array_page_reads_a_file(tmp_path, monkeypatch):
    page = OWN_ARRAY.read_text("utf-8")
    function = next(b for b in re.findall(r"```python\n(.*?)```", page, re.S) if "def read" in b)
    (tmp_path / "mylayout.py").write_text(function, "utf-8")
    (tmp_path / "one.txt").write_text("1 2\n3 4\n5 6\n")
    (tmp_path / "table.csv").write_text("file,label:object,layout\none.txt,cup,mylayout.py:read\n")
    monkeypatch.chdir(tmp_path)

    with pytest.raises(SystemExit):
        main(["import", "table.csv", "--output", "made"])
    assert not (tmp_path / "made").exists()
    main(["import", "table.csv", "--output", "made", "--allow-code"])
    assert [path.name for path in (tmp_path / "made").iterdir()] == ["one.mcap"]


def _commands(text: str) -> list[tuple[str, bool]]:
    """Return the commands of a page; False beside those in backticks, which may be a part."""
    shell = "".join(SHELL.findall(text)).replace("\\\n", " ")
    blocks = [line for line in shell.splitlines() if line.startswith("taxel ")]
    blocks += re.findall(r"^ .*?  +(taxel [a-z]+ .*)", "".join(ANY_BLOCK.findall(text)), re.M)
    ticks = re.findall(r"`(taxel [a-z]+ [^`\n]+)`", ANY_BLOCK.sub("", text))
    return [
        (re.split(r" [|>&] ?", line)[0], whole)
        for lines, whole in ((blocks, True), (ticks, False))
        for line in lines
        if "…" not in line and "..." not in line
    ]


def _headings(page: Path) -> set[str]:
    """Return the anchors that GitHub gives a page's headings."""
    lines = re.findall(r"^#+ (.+)$", ANY_BLOCK.sub("", page.read_text("utf-8")), re.M)
    return {re.sub(r"[^\w\- ]", "", line.lower()).replace(" ", "-") for line in lines}


def _write_own_data(folder: Path) -> None:
    """Write two objects that differ in frequency, three days, two trials: 12 files and a table."""
    folder.mkdir()
    rng = np.random.default_rng(0)
    rows = []
    for day in (1, 2, 3):
        gain = rng.uniform(0.8, 1.2, 4)
        for label, hertz in (("cup", 2.0), ("sponge", 5.0)):
            for trial in (1, 2):
                name = f"{label}_day{day}_{trial}.csv"
                time_s = np.arange(400) / 100.0
                wave = np.sin(2 * np.pi * hertz * time_s[:, None] + np.arange(4))
                force_n = 2.0 + gain * wave + rng.normal(0.0, 0.1, (400, 4))
                table = np.column_stack([1000.0 * time_s, force_n])
                np.savetxt(folder / name, table, "%.3f", ",", header="ms,a,b,c,d", comments="")
                rows.append([name, label, f"day{day}", "a[N] b[N] c[N] d[N]", "ms[ms]", "pad"])
    with (folder / "table.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["file", "label:object", "group:session", "channels", "time", "sensor"])
        writer.writerows(rows)
