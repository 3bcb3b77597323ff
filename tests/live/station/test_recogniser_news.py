"""What a station's recogniser reports beside its answers, with no process and no model."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from taxel.live.station import inference
from taxel.live.station.packets import unpack


class Writer:
    """Keeps what is put."""

    def __init__(self) -> None:
        self.notes: list[Any] = []

    def put(self, content: bytes) -> None:
        self.notes.append(unpack(content))


@pytest.fixture
def recogniser(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """A recogniser that answers nothing and has no news; tests give it some."""
    found = SimpleNamespace(new_vote=lambda: None, flush=list, push=lambda _: [])
    for news in ("gate_moves", "still_channels", "other_scales", "rate_changes"):
        setattr(found, news, list)
    found.untouched = found.waiting = str
    monkeypatch.setattr(inference, "Recogniser", lambda *_: found)
    window = SimpleNamespace(max_gap_s=0.5, pad=False)
    contract = SimpleNamespace(target="shape", classes=("ball", "cube"), window=window)
    bundle = SimpleNamespace(contract=contract)
    monkeypatch.setattr(inference, "read_bundle", lambda *_, **__: bundle)
    return found


@pytest.fixture
def watcher(recogniser: SimpleNamespace) -> Any:
    job = SimpleNamespace(
        trust=None, device="cpu", place=SimpleNamespace(name="monitor"), least_confidence=0.5,
        sensor=None,
    )  # fmt: skip
    return inference._RecogniseWatcher(Path("b.taxel"), cast("Any", job), cast("Any", Writer()), 0)


def test_another_unit_is_news_and_at_the_end_that_nothing_was_touched(
    watcher: Any, recogniser: SimpleNamespace
) -> None:
    recogniser.other_scales = lambda: [SimpleNamespace(words=lambda: "about 1,000 times as much")]
    recogniser.untouched = lambda: "nothing was touched"
    watcher.end()
    assert [(note["kind"], note["text"]) for note in watcher._writer.notes] == [
        ("news", "shape: about 1,000 times as much"), ("news", "shape: nothing was touched")
    ]  # fmt: skip


def test_what_the_first_window_waits_for_is_said_once_a_second_and_only_if_it_is_new(
    watcher: Any, recogniser: SimpleNamespace
) -> None:
    words = ["nothing above the gate yet, 0.1 at most"]
    recogniser.waiting = lambda: words[0]
    watcher.silent(1.0)
    watcher.silent(2.5)
    words[0] = ""
    watcher.silent(3.0)
    watcher.silent(3.6)
    notes = watcher._writer.notes
    assert [note["kind"] for note in notes] == ["waiting", "waiting"]
    assert [note["text"] for note in notes] == ["nothing above the gate yet, 0.1 at most", ""]
