"""Where no terminal shows a bar, long work says a line now and then; each pass has a clock."""

import io

import pytest
from rich.console import Console

from taxel.cli.long_work import LongWork
from taxel.views.console import LINE_S, progress_on


def test_without_a_terminal_a_line_is_said_now_and_then(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setattr("taxel.views.console.monotonic", lambda: now[0])
    output = io.StringIO()
    with progress_on(Console(file=output)) as bar:
        work = LongWork(bar)
        for done in range(1, 51):
            now[0] += 1.0
            work.at("features of trials", done, 50)
        now[0] += LINE_S
        work.step("training", "taxel, fold 1")
    assert output.getvalue().splitlines() == [
        "20 s · features of trials · 20 of 50",
        "40 s · features of trials · 40 of 50",
        "70 s · taxel, fold 1",
    ]


def test_on_a_terminal_each_pass_has_a_name_and_a_clock_and_nothing_is_printed_beside(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with progress_on(Console(file=io.StringIO(), force_terminal=True)) as bar:
        work = LongWork(bar)
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
