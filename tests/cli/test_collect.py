"""`taxel collect` and `taxel hand` on the simulated hand, as a user runs them."""

import json
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any, Self, cast

import pytest
import tyro

from taxel.actions import collecting, grasping
from taxel.actions.guided_trials import record_trial
from taxel.actions.sim_hand import SimHand
from taxel.cli.recordings import collect as collect_verb
from taxel.cli.recordings.collect import Collect
from taxel.cli.recordings.hand import Hand
from taxel.errors import BadInput, RecordingFailed, TaxelError
from taxel.recordings.reader import read_recording
from taxel.recordings.trial_plan import read_plan

HAND = "sim://hand?stroke_s=0.6&speed=max"
PLAN = """group:session,group:object,label:shape,label:material,times
a,ball,sphere,aluminium,1
a,jar,cylinder,glass,1
b,box,rectangle,plastic,1
"""
QUICK = ["--stroke-s", "0.6", "--presses", "1", "--hold-s", "0.1", "--pause-s", "0.05", "--json"]


def collect(plan: Path, output: Path, *words: str) -> None:
    args = [str(plan), "--source", "sim://teng?seed=3", "--hand", HAND, "--output", str(output)]
    tyro.cli(Collect, args=[*args, *QUICK, *words]).run()


@pytest.fixture
def plan(tmp_path: Path) -> Path:
    path = tmp_path / "plan.csv"
    path.write_text(PLAN, encoding="utf-8")
    return path


def test_a_plan_is_collected_and_goes_on_where_it_was_broken_off(
    plan: Path,
    tmp_path: Path,
    unplugged: Callable[..., None],
    capsys: pytest.CaptureFixture[str],
):
    """The disk ends the second grasp; the same command makes what is missing and nothing else."""
    output = tmp_path / "grasps"
    unplugged(collecting, "collect_grasp")
    with pytest.raises(OSError, match="unplugged"):
        collect(plan, output)
    first = (output / "trial-001.mcap").stat().st_mtime_ns
    capsys.readouterr()
    collect(plan, output)
    printed = json.loads(capsys.readouterr().out)

    assert (printed["trials"], printed["recorded"], len(printed["now"])) == (3, 3, 2)
    assert [grasp["touched"] for grasp in printed["now"]] == [[1, 2, 3, 4]] * 2
    assert (output / "trial-001.mcap").stat().st_mtime_ns == first
    last = read_recording(output / "trial-003.mcap")
    assert last.manifest.labels == {"shape": "rectangle", "material": "plastic"}
    assert last.manifest.groups["session"] == "b"
    assert len(last.marks) == 1


def test_a_grasp_that_another_program_has_made_meanwhile_is_not_replaced(
    plan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Two stations with one folder: the later one wrote over the other's finished grasps."""
    output = tmp_path / "grasps"
    collect(plan, output)
    first = (output / "trial-001.mcap").stat().st_mtime_ns
    monkeypatch.setattr("taxel.recordings.trial_plan.done_of", lambda *_: [])  # as at its start
    with pytest.raises(BadInput, match=r"trial-001.mcap, which another one has made meanwhile"):
        collect(plan, output)
    with pytest.raises(BadInput, match=r"trial-001.mcap, which another one has made meanwhile"):
        record_trial(cast("Any", None), read_plan(plan)[0], output / "trial-001.mcap", 1.0)

    assert (output / "trial-001.mcap").stat().st_mtime_ns == first


def test_an_object_that_the_simulated_hand_does_not_have_is_refused(plan: Path, tmp_path: Path):
    plan.write_text("label:shape,label:material\nstar,glass\n", encoding="utf-8")

    with pytest.raises(BadInput, match="label:shape of sphere"):
        collect(plan, tmp_path / "grasps")
    assert not (tmp_path / "grasps").exists()


@pytest.mark.parametrize(
    ("source", "hand", "words"),
    [
        ("serial:///dev/null", HAND, "both real"),
        ("sim://cup-pour", HAND, "both real"),
        ("sim://teng", "sim://gripper", "a hand with motors"),
        ("sim://teng", "sim://hand?stroke_s=0", "stroke_s"),
        ("sim://teng", "sim://hand?raise_ma=100", "name both"),
    ],
)
def test_pads_and_motors_that_do_not_belong_together_are_refused(
    source: str, hand: str, words: str, plan: Path, tmp_path: Path
):
    args = [str(plan), "--source", source, "--hand", hand, "--output", str(tmp_path / "grasps")]
    with pytest.raises(BadInput, match=words):
        tyro.cli(Collect, args=args).run()


class Typed:
    """Keys typed at the questions, one a question, and what was typed before the first."""

    def __init__(self, keys: str, early: str = "") -> None:
        self._keys, self._early = list(keys), early

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing to give back."""

    def forget(self) -> bool:
        early, self._early = self._early, ""
        return "q" in early

    def typed(self) -> str:
        early, self._early = self._early, ""
        return early or (self._keys.pop(0) if self._keys else "q")


def test_a_person_is_asked_where_the_object_changes_and_may_end(
    plan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    """Nobody puts anything in by itself here; the second question is answered by q."""
    rig = grasping.open_grasping("sim://teng?seed=3", HAND)
    assert isinstance(rig.actuator.hand, SimHand)
    rig.actuator.hand.plant.present("sphere", "aluminium", 1)
    monkeypatch.setattr(grasping, "open_grasping", lambda *_: replace(rig, place=None))
    monkeypatch.setattr(collect_verb, "Keys", lambda: Typed("\nq"))
    monkeypatch.setattr(type(collect_verb.console), "is_terminal", property(lambda _: True))
    collect(plan, tmp_path / "grasps")
    message = capsys.readouterr().err

    assert message.count("put into the open hand: session a, object") == 2
    assert sorted(path.name for path in (tmp_path / "grasps").glob("*.mcap")) == ["trial-001.mcap"]


@pytest.mark.parametrize("early", ["\n", "\n\n", "q"])
def test_a_key_typed_before_the_question_closes_nothing(
    early: str, plan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
):  # fmt: skip
    rig = grasping.open_grasping("sim://teng?seed=3", HAND)
    assert isinstance(rig.actuator.hand, SimHand)
    monkeypatch.setattr(grasping, "open_grasping", lambda *_: replace(rig, place=None))
    monkeypatch.setattr(collect_verb, "Keys", lambda: Typed("q", early))
    monkeypatch.setattr(type(collect_verb.console), "is_terminal", property(lambda _: True))
    collect(plan, tmp_path / "grasps")

    assert capsys.readouterr().err.count("put into the open hand") == 1
    assert rig.actuator.hand.plant.position.max() == 0.0
    assert list((tmp_path / "grasps").glob("*")) == []


def test_with_no_ask_a_key_is_waited_for_once_where_motion_was_not_allowed_at_once(
    plan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
):  # fmt: skip
    """It waited before each object all the same, as if --no-ask had not been given."""
    rig = grasping.open_grasping("sim://teng?seed=3", HAND)
    assert rig.place is not None
    place = rig.place

    trials, made = read_plan(plan), list[object]()
    whole = collecting.collect_grasp

    def grasp(*words: object) -> object:
        made.append(whole(*words))  # type: ignore[arg-type]
        if len(made) < len(trials):
            place(trials[len(made)])
        return made[-1]

    place(trials[0])
    monkeypatch.setattr(collecting, "collect_grasp", grasp)
    monkeypatch.setattr(grasping, "open_grasping", lambda *_: replace(rig, place=None))
    monkeypatch.setattr(collect_verb, "Keys", lambda: Typed("\nq"))
    monkeypatch.setattr(type(collect_verb.console), "is_terminal", property(lambda _: True))
    collect(plan, tmp_path / "grasps", "--no-ask")
    assert capsys.readouterr().err.count("put into the open hand") == 1
    assert len(list((tmp_path / "grasps").glob("*.mcap"))) == 3


def test_an_empty_hand_is_tried_three_times_and_then_said(
    plan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    rig = grasping.open_grasping("sim://teng?seed=3", HAND)
    monkeypatch.setattr(grasping, "open_grasping", lambda *_: replace(rig, place=None))

    with pytest.raises(BadInput, match=r"nothing, 3 times; .*--stroke-s"):
        collect(plan, tmp_path / "grasps", "--arm", "--no-ask")
    assert list((tmp_path / "grasps").glob("*")) == []


def hand(*words: str | Path) -> None:
    tyro.cli(Hand, args=[*map(str, words), "--json"]).run()


def test_fingers_close_are_drawn_and_open_again(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    hand("grip", HAND, "--arm", "--record", tmp_path / "c.mcap", "--plot", tmp_path / "c.png")
    printed = json.loads(capsys.readouterr().out)

    assert (printed["ended"], printed["state"], printed["fault"]) == ("there", "armed", "")
    assert printed["seconds"] == pytest.approx(0.6, abs=0.05)
    currents = read_recording(tmp_path / "c.mcap")
    assert len(currents.samples) == printed["readings"] > 50
    manifest, last_s = currents.manifest, currents.samples.fitted_s[-1]
    written_s = datetime.fromisoformat(manifest.created).timestamp() + 0.001  # milliseconds, cut
    assert manifest.wall_anchor_ns * 1e-9 + last_s <= written_s, "it was over before"
    assert (tmp_path / "c.png").read_bytes().startswith(b"\x89PNG")


def test_a_movement_that_is_stopped_keeps_its_currents(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    """They may show why the board stopped; they are written once the hand is closed."""
    take, calls = SimHand.take_currents, []

    def stopped(self: SimHand) -> list[tuple[float, tuple[int, ...]]]:
        calls.append(1)
        if len(calls) == 30:
            self.stop()
        return take(self)

    monkeypatch.setattr(SimHand, "take_currents", stopped)
    with pytest.raises(BadInput, match="a hand that may move; got a stop"):
        hand("grip", HAND, "--arm", "--record", tmp_path / "c.mcap", "--plot", tmp_path / "c.png")

    assert len(read_recording(tmp_path / "c.mcap").samples) > 20
    assert (tmp_path / "c.png").read_bytes().startswith(b"\x89PNG")
    assert "the currents until the stop" in capsys.readouterr().err


@pytest.mark.parametrize("stops", [True, False], ids=["stopped", "moved"])
def test_a_disk_that_refuses_hides_not_what_became_of_the_hand(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], stops: bool
):
    """Of a stop, its reason is the error; of a movement, where the fingers are is printed."""
    take, calls = SimHand.take_currents, []

    def take_currents(self: SimHand) -> list[tuple[float, tuple[int, ...]]]:
        calls.append(1)
        if stops and len(calls) == 30:
            self.stop()
        return take(self)

    def refuse(*_: object) -> None:
        raise RecordingFailed("the disk is full")

    monkeypatch.setattr(SimHand, "take_currents", take_currents)
    monkeypatch.setattr(collecting, "write_currents", refuse)
    reason = "a hand that may move; got a stop" if stops else "the disk is full"
    with pytest.raises(TaxelError, match=reason):
        hand("grip", HAND, "--arm", "--record", tmp_path / "c.mcap")

    aside = "until the stop are lost: the disk is full" if stops else "grip: fingers rest after"
    assert aside in capsys.readouterr().err


def test_a_hand_that_rests_says_so(capsys: pytest.CaptureFixture[str]):
    hand("status", HAND)

    assert json.loads(capsys.readouterr().out)["largest_ma"] == [0, 0, 0, 0]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["grip", HAND], "--arm for grip"),
        (["status", "sim://arm"], "a hand with motors"),
        (["move", HAND, "--arm", "--fingers", "5"], "--fingers among 1 to 4"),
        (["move", HAND, "--arm", "--seconds", "0"], "--seconds above 0"),
        (["status", HAND, "--plot", "currents.txt"], "ends in .png"),
    ],
)
def test_what_the_hand_cannot_do_is_refused_in_one_line(words: list[str], message: str):
    with pytest.raises(BadInput, match=message):
        hand(*words)
