"""What counts as a refusal, and how the rows of hostile files are counted."""

import math
from pathlib import Path

import pytest

from taxel.bench.faults.files import Refusal, obeys, refusals, refused_rows, shown_classes, sound
from taxel.bench.faults.hostile_cases import ALONE, KINDS, RESIDENT, kind_of_case
from taxel.bench.faults.hostile_labels import CLASSES
from taxel.bench.faults.watched_commands import Ended, Resident, run_alone
from taxel.errors import TaxelError
from taxel.plain_text import visible

FAKE = """
import sys
def main(words):
    what = words[1].partition('/')[2]
    line = 'taxel: needed a bundle; got none; name one.'
    if what == 'traceback': raise ValueError(line)
    if what == 'two-lines': line += chr(10) + 'and more'
    if what == 'another-line': line = 'error: needed a bundle'
    if what == 'printed-traceback': print('Traceback (most recent call last):')
    if what == 'left-behind': open('out', 'w').close()
    if what == 'hang':
        while True: pass
    if what == 'memory': sys.modules['kept'] = bytearray(b'x' * 50_000_000)
    sys.stderr.write(line + chr(10))
    sys.exit({'exit-0': 0, 'exit-1': 1}.get(what, 2))
"""
NOT_REFUSED = [
    "traceback", "two-lines", "another-line", "printed-traceback", "left-behind", "exit-0",
    "exit-1",
]  # fmt: skip
CASES = {name: f"live bundles/{name}" for name in ["refused", *NOT_REFUSED]}


@pytest.fixture(scope="module", params=["alone", "resident"])
def found(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> list[Refusal]:
    """What a fake command did with each case, in both ways of running it."""
    where = tmp_path_factory.mktemp("fake")
    if request.param == "alone":
        done = refusals(CASES, where, lambda words: run_alone(words, where, main=FAKE))
    else:
        with Resident(where, main=FAKE) as resident:
            done = refusals(CASES, where, resident.run)
    assert not list(where.iterdir()), "what was left behind is removed before the next case"
    return done


def test_only_one_plain_line_with_exit_code_2_and_nothing_written_is_a_refusal(
    found: list[Refusal],
) -> None:
    assert [refusal.name for refusal in found if refusal.refused] == ["refused"]


def test_the_row_counts_refusals_and_names_the_others(found: list[Refusal]) -> None:
    bundles = next(row for row in refused_rows(found) if row.name.startswith("hostile bundles"))

    assert (bundles.value, bundles.unit, bundles.ok) == (1, f"of {len(CASES)}", False)
    assert bundles.note == f"not refused: {', '.join(NOT_REFUSED)}"


@pytest.mark.parametrize("way", ["alone", "resident"])
def test_a_hang_is_broken_off_and_not_tried_again(way: str, tmp_path: Path) -> None:
    case = {"hang": "live bundles/hang"}
    if way == "alone":
        (hang,) = refusals(case, tmp_path, lambda words: run_alone(words, tmp_path, 1.0, FAKE))
    else:
        with Resident(tmp_path, 1.0, FAKE) as resident:
            (hang,) = refusals(case, tmp_path, resident.run)

    assert (hang.refused, hang.tries) == (False, 1)
    assert hang.seconds >= 1.0


@pytest.mark.parametrize(
    ("took_s", "tries", "kept_s"),
    [([2.0], 1, 2.0), ([4.0, 2.0], 2, 2.0), ([5.0, 3.5, 4.0], 3, 3.5)],
)
def test_a_slow_command_is_tried_up_to_three_times_and_its_quietest_counts(
    took_s: list[float], tries: int, kept_s: float, tmp_path: Path
) -> None:
    left = iter(took_s)

    def run(_: list[str]) -> Ended:
        return Ended(code=2, out="", err="taxel: needed x", seconds=next(left), memory_mb=1.0)

    (slow,) = refusals({"slow": "live bundles/slow"}, tmp_path, run)

    assert (slow.tries, slow.seconds, slow.refused) == (tries, kept_s, True)


def test_memory_of_a_resident_process_is_what_it_took_beside_what_it_held(tmp_path: Path) -> None:
    alone = run_alone(["live", "bundles/memory"], tmp_path, main=FAKE)
    if math.isnan(alone.memory_mb):
        pytest.skip("only Linux says a process's largest memory")
    with Resident(tmp_path, main=FAKE) as resident:
        first = resident.run(["live", "bundles/memory"])
        second = resident.run(["live", "bundles/refused"])

    assert alone.memory_mb > 50
    assert 40 < first.memory_mb < alone.memory_mb
    assert second.memory_mb < 5


def test_a_resident_process_that_died_is_reported(tmp_path: Path) -> None:
    with Resident(tmp_path, main="import os\ndef main(words): os._exit(0)") as resident:
        for _ in range(2):
            with pytest.raises(ChildProcessError, match="died"):
                resident.run(["live"])


def test_an_honest_command_that_fails_ends_the_bench() -> None:
    failed = Ended(code=2, out="", err="taxel: needed x.\n", seconds=0.0, memory_mb=0.0)

    with pytest.raises(TaxelError, match="needed x"):
        sound(failed)


def test_every_case_belongs_to_a_kind_and_every_kind_has_cases() -> None:
    assert {kind_of_case(line) for line in (ALONE | RESIDENT).values()} == set(KINDS)
    assert not set(ALONE) & set(RESIDENT)


def test_only_a_class_that_is_shown_literally_counts() -> None:
    assert shown_classes(" ".join(map(visible, CLASSES))) == set(CLASSES)
    assert shown_classes("cup a\x1b[2Jb cup[blue]") == {"cup[blue]"}


def test_a_line_break_is_obeyed_by_nobody() -> None:
    assert [c for c in "a\x1b[0m\n\u202e\x9b" if obeys(c)] == ["\x1b", "\u202e", "\x9b"]
