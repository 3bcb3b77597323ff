"""Where no terminal shows a bar, long work says a line now and then; each pass has a clock."""

import io

import pytest
from rich.console import Console

from taxel.cli.long_work import EVERY_S, LongWork
from taxel.views.console import progress_on


def test_without_a_terminal_a_line_is_said_now_and_then(capsys: pytest.CaptureFixture[str]) -> None:
    now = [0.0]
    with progress_on(Console(file=io.StringIO())) as bar:
        work = LongWork(bar, clock=lambda: now[0])
        for done in range(1, 41):
            now[0] += 1.0
            work.at("features of trials", done, 40)
    out, said = capsys.readouterr()
    assert out == ""
    assert said.splitlines() == [
        f"taxel: features of trials: {done} of 40" for done in (int(EVERY_S), int(2 * EVERY_S))
    ]


def test_on_a_terminal_each_pass_has_a_name_and_a_clock_and_nothing_is_printed_beside(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with progress_on(Console(file=io.StringIO(), force_terminal=True)) as bar:
        work = LongWork(bar, clock=iter(range(0, 10_000, 100)).__next__)
        work.at("features of trials", 1, 2)
        work.at("features of trials", 2, 2)
        first = bar.tasks[0]
        work.at("features of further crops", 1, 2)
        (second,) = bar.tasks
        assert (first.description, second.description) == (
            "features of trials", "features of further crops",
        )  # fmt: skip
        assert (second.completed, second.total) == (1, 2)
        assert second.start_time is not None
        assert first.start_time is not None
        assert second.start_time > first.start_time
        work.step("training", "taxel, fold 1")
        assert [task.description for task in bar.tasks] == ["taxel, fold 1"]
    assert capsys.readouterr() == ("", "")
