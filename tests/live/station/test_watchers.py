"""What the monitor's process does with packets: grasps told apart, old frames let go, drills.

The model is a dummy that says what it is asked; the rings are real.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import make_dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from taxel.bundles.envelope import checksum_of
from taxel.bundles.envelope import pack as packed_bundle
from taxel.clock import ManualClock
from taxel.decisions.joining import MEAN
from taxel.decisions.recognition import UNKNOWN, Decision, GraspVote
from taxel.decisions.stability import Stability, StabilityDecision
from taxel.errors import BadBundle
from taxel.live.station import array_watcher, grasp_watcher, inference
from taxel.live.station.packets import pack, unpack
from taxel.live.station.ring import Ring, RingReader, RingWriter
from taxel.live.station.watching import Inference
from taxel.signals import CameraInfo, Frame, Mark, Samples

CAMERAS = tuple(
    CameraInfo(name=name, width=32, height=24, rate_hz=60.0) for name in ("left", "right")
)
CAME = {"put_s": 0.0, "taken_s": 0.0}


class Monitor:
    """Says STABLE to each set of frames, and keeps what it was asked."""

    settling = False

    def __init__(self, bundle: Any, cameras: Any) -> None:
        self.bundle = bundle
        self.asked: list[str] = []
        self.begins = False
        self.state = Stability.UNKNOWN

    def see(self, frame: Frame) -> None:
        """Nothing is weighed."""

    def push(self, found: Any, began_s: float, taken_s: float) -> Any:
        self.asked.append(f"push {found.time_s:g}")
        decision = StabilityDecision(Stability.STABLE, "", found.time_s, 0.1)
        return SimpleNamespace(decision=decision, began=self.begins, probability=float("nan"))

    def over(self, time_s: float, now_s: float) -> StabilityDecision:
        self.asked.append(f"over {time_s:g}")
        return StabilityDecision(Stability.NO_GRASP, "", time_s, float("nan"))

    def at(self, now_s: float) -> StabilityDecision:
        return StabilityDecision(self.state, "", now_s, 0.1)

    def reset(self) -> None:
        self.asked.append("reset")

    def end(self) -> None:
        self.asked.append("end")

    def late(self) -> dict[str, float]:
        return {}


class Rig:
    """A grasp watcher over a dummy model; time goes on by hand."""

    def __init__(self, stack: ExitStack, patch: pytest.MonkeyPatch, number: int = 0) -> None:
        self.clock = ManualClock()
        patch.setattr(grasp_watcher, "monotonic", self.clock.now_s)
        patch.setattr("taxel.live.grasp_monitor.GraspMonitor", Monitor)
        for module in (inference, grasp_watcher):
            patch.setattr(module, "is_grasp_bundle", lambda _: True)
        contract = SimpleNamespace(
            rule="gross-slip", gives_probability=False,
            stability=SimpleNamespace(clear=0.3, warn=0.5, unstable=0.8),
        )  # fmt: skip
        made = make_dataclass("Bundle", ["contract", ("head", Any, None)])(contract)
        patch.setattr(grasp_watcher, "read_grasp_bundle", lambda *_, **__: made)
        ring = stack.enter_context(Ring(2**16)).name
        self._heard = stack.enter_context(RingReader(ring))
        bundles = Path("a.taxel"), Path("b.taxel")
        job = self.job(bundles=bundles, cameras=CAMERAS, decisions=ring)
        writer = stack.enter_context(RingWriter(ring))
        self.watcher = cast("Any", inference.watcher_of(Path("b.taxel"), job, writer, number))
        self.patience_s: list[float] = []

    @property
    def monitor(self) -> Any:
        return self.watcher._monitor

    def job(self, **changed: Any) -> Inference:
        """Return what a process is to do, of a recogniser unless changed."""
        place = cast("Any", SimpleNamespace(name="monitor"))
        given: dict[str, Any] = {"bundles": (), "cameras": (), "decisions": ""} | changed
        return Inference(place=place, sensor=cast("Any", 0), ring="", source_row=0, **given)

    def take(self, *packets: Any) -> list[dict[str, Any]]:
        """Let packets come, a millisecond later; return the notes that were told."""
        self.clock.advance(0.001)
        pulse = SimpleNamespace(beat=lambda patience_s=0.0: self.patience_s.append(patience_s))
        self.watcher.take(list(packets), CAME, pulse)
        return self.notes()

    def notes(self) -> list[Any]:
        return [unpack(content) for content in self._heard.take()]


@pytest.fixture
def rig(monkeypatch: pytest.MonkeyPatch) -> Iterator[Rig]:
    with ExitStack() as stack:
        yield Rig(stack, monkeypatch)


def pair(time_s: float) -> list[Frame]:
    return [
        Frame(camera=i, jpeg=b"", counter=0, device_s=0.0, arrival_s=time_s, fitted_s=time_s)
        for i in range(2)
    ]


def outcome(end_s: float, label: str = "held") -> Mark:
    return Mark(start_s=0.0, end_s=end_s, labels={"outcome": label})


def test_of_many_sets_that_wait_only_the_newest_three_are_watched_and_the_rest_counted(rig: Rig):
    frames = [frame for i in range(5) for frame in pair(i / 60)]
    notes = rig.take(*frames)
    assert rig.monitor.asked == [f"push {i / 60:g}" for i in (2, 3, 4)]
    assert [note["skipped"] for note in notes] == [2, 2, 2]
    assert (notes[-1]["state"], notes[-1]["p"]) == ("STABLE", None)


def test_a_number_that_is_no_probability_is_called_a_score(rig: Rig):
    assert rig.watcher.what["is_score"] is True
    assert [note["is_score"] for note in rig.take(*pair(1.0))] == [True]


def test_the_frames_before_an_outcome_belong_to_the_grasp_that_ends(rig: Rig):
    notes = rig.take(*pair(1.0), outcome(1.01, "drop"), *pair(1.5))
    assert rig.monitor.asked == ["push 1", "over 1.01", "push 1.5"]
    assert [note["kind"] for note in notes] == ["grasp", "new grasp", "grasp", "grasp"]
    assert (notes[1]["outcome"], notes[1]["who"]) == ("drop", "monitor/0")
    assert [note.get("state") for note in notes] == ["STABLE", None, "NO_GRASP", "STABLE"]


def test_a_new_grasp_that_the_supervisor_orders_forgets_the_old_one(rig: Rig):
    notes = rig.take({"do": "new grasp", "all": True}, *pair(1.0))
    assert rig.monitor.asked == ["reset", "push 1"]
    assert notes[0] == {"kind": "new grasp", "outcome": "", "who": ""}
    assert rig.take({"do": "new grasp", "report": False}) == []  # another process reports it


def test_of_two_monitors_on_one_source_the_first_reports_a_grasp(monkeypatch: pytest.MonkeyPatch):
    with ExitStack() as stack:
        rig = Rig(stack, monkeypatch, number=1)
        rig.monitor.begins = True
        notes = rig.take(*pair(1.0), outcome(1.01, "drop"), {"do": "new grasp"})
        assert rig.monitor.asked == ["push 1", "over 1.01", "reset"]
    assert [note["kind"] for note in notes] == ["grasp", "grasp"]


def test_a_mark_of_the_hand_in_the_same_file_ends_no_grasp(rig: Rig):
    rig.take(Mark(start_s=0.0, end_s=1.0, labels={"shape": "ball"}), *pair(1.0))
    assert rig.monitor.asked == ["push 1"]


@pytest.mark.parametrize("recording", [{}, {"outcome": "held"}])
def test_a_reaction_that_the_source_marked_is_reported_at_its_own_time(
    rig: Rig, recording: dict[str, str]
):
    """In a replay it holds the labels of the recording, too, whose outcome ended the grasp."""
    mark = Mark(start_s=0.7, end_s=0.7, labels=recording | {"reaction": "put down"})
    assert rig.take(*pair(1.0), mark)[0] == {
        "kind": "reaction", "who": "monitor/0", "what": "put down", "time_s": 0.7,
    }  # fmt: skip


def test_a_grasp_that_was_found_in_the_images_is_reported_before_its_decision(rig: Rig):
    rig.monitor.begins = True
    assert [note["kind"] for note in rig.take(*pair(1.0))] == ["new grasp", "grasp"]


def test_the_source_end_reaches_the_monitor(rig: Rig):
    rig.take({"ended": 3.0})
    assert rig.monitor.asked == ["end"]


def test_patience_is_asked_for_while_a_grasp_settles(rig: Rig):
    rig.take(*pair(1.0))
    rig.monitor.settling = True
    rig.take(*pair(1.1))
    assert rig.patience_s == [0.0, 1.0]


def test_a_silent_input_is_reported_when_its_state_changes_and_each_tenth_of_a_second(rig: Rig):
    rig.take(*pair(1.0))
    sent = []
    for ms in range(250):
        rig.clock.advance(0.001)
        rig.monitor.state = Stability.UNKNOWN if ms >= 20 else Stability.STABLE
        rig.watcher.silent(rig.clock.now_s())
        sent += [(ms, note["state"]) for note in rig.notes()]
    assert sent == [(20, "UNKNOWN"), (120, "UNKNOWN"), (220, "UNKNOWN")]


class Queue:
    """Orders of the supervisor, each taken once."""

    def __init__(self, *orders: dict[str, Any]) -> None:
        self._orders = orders

    def take(self) -> list[bytes]:
        return [pack(order) for order in self._orders]


def obey(rig: Rig, *orders: dict[str, Any], drill: bool = True) -> list[Any]:
    return inference._orders(cast("Any", Queue(*orders)), drill, [rig.watcher])


def test_in_a_drill_a_monitor_is_muted_and_told_to_speak_again(rig: Rig):
    obey(rig, {"do": "mute", "on": True})
    assert rig.take(*pair(1.0)) == []
    obey(rig, {"do": "mute", "on": False})
    assert len(rig.take(*pair(1.1))) == 1
    assert rig.monitor.asked == ["push 1", "push 1.1"]


@pytest.mark.parametrize(
    ("order", "value"), [({"do": "nan"}, float("nan")), ({"do": "give", "p": 0.9}, 0.9)]
)
def test_in_a_drill_the_model_gives_what_it_is_told(rig: Rig, order: dict[str, Any], value: float):
    obey(rig, order)
    given = rig.monitor.bundle.head.run(x=np.zeros(3, np.float32))
    np.testing.assert_array_equal(given, np.array([value], np.float32))


def test_in_a_drill_an_order_that_is_no_drill_is_handed_on(rig: Rig):
    before = rig.monitor.bundle
    assert obey(rig, {"do": "new grasp"}) == [{"do": "new grasp"}]
    assert rig.monitor.bundle is before
    assert len(rig.take(*pair(1.0))) == 1


def test_outside_a_drill_such_orders_change_nothing_and_others_are_handed_on(rig: Rig):
    orders = ({"do": "mute", "on": True}, {"do": "nan"}, {"do": "hang"}, {"do": "new grasp"})
    before = rig.monitor.bundle
    assert obey(rig, *orders, drill=False) == list(orders)
    assert rig.monitor.bundle is before
    assert len(rig.take(*pair(1.0))) == 1


class Recogniser:
    """Answers each run of scans once, and the stream's end once more."""

    def __init__(self, *_: Any) -> None:
        self.moved = False

    def push(self, samples: Samples) -> list[Any]:
        self.moved = len(samples) > 1
        return [answer("ball", (0.8, 0.2), float(samples.fitted_s[-1]))]

    def flush(self) -> list[Any]:
        return [answer(UNKNOWN, (np.nan, np.nan), 9.0)]

    def gate_moves(self) -> list[Any]:
        return [SimpleNamespace(words=lambda: "the gate moved")] if self.moved else []

    def still_channels(self) -> list[Any]:
        return []

    def other_scales(self) -> list[Any]:
        return []

    def untouched(self) -> str:
        return ""

    def rate_changes(self) -> list[Any]:
        return []

    def waiting(self) -> str:
        return ""

    def new_touch(self) -> None:
        pass

    touches = 0

    def new_vote(self) -> GraspVote:
        return GraspVote(("ball", "cube"), 0.5)


def answer(label: str, p: tuple[float, float], end_s: float) -> Any:
    decision = Decision(
        label=label, confidence=p[0], probabilities=np.array(p, np.float32),
        reason="no contact" if label == UNKNOWN else "", start_s=end_s, end_s=end_s,
    )  # fmt: skip
    return SimpleNamespace(decision=decision)


def scans(*times_s: float) -> Samples:
    return Samples.from_values(np.ones((len(times_s), 1)), np.array(times_s), full_scale=3.3)


@pytest.fixture
def recogniser(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> Rig:
    """The same rig with a recogniser of ball and cube in place of the grasp watcher."""
    monkeypatch.setattr(inference, "is_grasp_bundle", lambda _: False)
    monkeypatch.setattr(array_watcher, "Recogniser", Recogniser)
    contract = SimpleNamespace(
        target="shape", classes=("ball", "cube"), joining=MEAN,
        window=SimpleNamespace(max_gap_s=0.5, pad=False),
    )  # fmt: skip
    made = SimpleNamespace(contract=contract, novelty_test=None)
    monkeypatch.setattr(array_watcher, "read_bundle", lambda *_, **__: made)
    rig.watcher = cast(
        "Any", inference.watcher_of(Path("b.taxel"), rig.job(), rig.watcher._writer, 1)
    )
    return rig


def test_a_recogniser_answers_scans_only_and_says_who_it_is(recogniser: Rig):
    assert recogniser.watcher.what == {
        "kind": "answer", "who": "monitor/1", "bundle": "b.taxel", "target": "shape",
        "classes": ["ball", "cube"],
    }  # fmt: skip
    (note,) = recogniser.take(*pair(0.1), scans(0.2), {"ended": 1.0})
    assert (note["who"], note["label"], note["grasp"]) == ("monitor/1", "ball", "ball")
    assert (note["arrival_s"], note["time_s"]) == (0.2, 0.2)
    assert note["grasp_confidence"] == pytest.approx(0.8)


def test_an_answer_is_as_old_as_its_scans_where_a_recogniser_lags_behind(recogniser: Rig):
    notes = recogniser.take(scans(1.0), scans(41.0))
    assert [note["as_of_s"] for note in notes if "as_of_s" in note] == [-40.0, 0.0]


def test_a_recogniser_reports_a_gate_that_moved_after_its_answer(recogniser: Rig):
    notes = recogniser.take(scans(0.1, 0.2))
    assert [note["kind"] for note in notes] == ["answer", "news"]
    assert notes[1]["text"] == "shape: the gate moved"


def test_the_last_padded_window_is_answered_at_the_end_without_times_of_arrival(recogniser: Rig):
    recogniser.watcher.end()
    (note,) = recogniser.notes()
    assert (note["label"], note["confidence"], note["grasp_confidence"]) == (UNKNOWN, None, None)
    assert "arrival_s" not in note


@pytest.mark.parametrize(
    "message", [{"do": "new grasp"}, Mark(start_s=0.2, end_s=0.3, labels={"outcome": "held"})]
)
def test_a_new_grasp_has_a_vote_of_its_own(recogniser: Rig, message: Any):
    recogniser.take(scans(0.1))
    assert recogniser.watcher._vote.windows == 1
    recogniser.take(message)
    assert recogniser.watcher._vote.windows == 0


def test_input_that_cannot_be_used_is_news_and_ends_the_answer(recogniser: Rig):
    """A board that is gone is not answered for by what it sent before."""
    recogniser.take(scans(0.1))
    fault = Decision(UNKNOWN, np.nan, np.full(2, np.nan, np.float32), "all missing", 0.2, 0.9,
                     usable=False, empty=True)  # fmt: skip
    recogniser.watcher._send(SimpleNamespace(decision=fault), {})
    news, note = recogniser.notes()
    assert news["text"] == "shape: no usable values: all missing; the answer is UNKNOWN"
    assert (note["grasp"], note["grasp_confidence"]) == (UNKNOWN, None)


def test_drills_and_silence_leave_a_recogniser_as_it_is(recogniser: Rig):
    """It opens no gripper, and a hand that touches nothing says nothing."""
    obey(recogniser, {"do": "nan"}, {"do": "mute", "on": True})
    recogniser.watcher.silent(9.0)
    assert recogniser.notes() == []
    assert [note["label"] for note in recogniser.take(scans(0.2))] == ["ball"]


def test_a_bundle_that_was_replaced_since_the_station_began_is_not_run(
    recogniser: Rig, tmp_path: Path
):
    """The page and the summary would show its classes under the target of the one before."""
    path = tmp_path / "b.taxel"
    path.write_bytes(packed_bundle({"bundle.json": b"{}"}))
    job = recogniser.job(checksums=(checksum_of(path),))
    assert inference.watcher_of(path, job, cast("Any", None), 0).what["target"] == "shape"
    for other in (packed_bundle({"bundle.json": b"[]"}), b"", None):
        path.unlink() if other is None else path.write_bytes(other)
        with pytest.raises(BadBundle, match=f"needed {path} as it was when this station began"):
            inference.watcher_of(path, job, cast("Any", None), 0)
