"""What befalls the input is on the screen while it lasts."""

import io
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from rich.console import Console

from taxel.decisions.recognition import GraspVote, Quality, RecogniseConfig, decide
from taxel.decisions.value_scale import OtherScale
from taxel.live.outages import Outage
from taxel.live.rate_watch import RateChange
from taxel.live.session import Tally
from taxel.signals import SensorInfo
from taxel.views.live_screen import LiveView

CLASSES = ("hard", "soft")
OUTAGE = Outage(1.0, "10% of the values are missing, stale or NaN")
SLOW = RateChange(3.0, 50.0, 100.0, fits=False)


WHY = "no value came above the gate of 1.55 V, the largest is 0.003"


def screen(
    tally: Tally,
    gate: float | None = None,
    *,
    touched: bool = True,
    probabilities: tuple[float, float] = (0.9, 0.1),
) -> str:
    """What is drawn of a tally whose newest window was hard."""
    contract = SimpleNamespace(target="object", classes=CLASSES, window=SimpleNamespace(gate=gate))
    recogniser = SimpleNamespace(bundle=SimpleNamespace(contract=contract), waiting=lambda: WHY)
    info = SensorInfo(name="t", channels=("a",), units=("V",), rate_hz=100.0)
    decision = decide(np.array(probabilities, np.float32), Quality(), CLASSES, RecogniseConfig())
    if touched:
        tally.grasp_answer = tally.vote.add(decision)
        tally.latest = cast("Any", SimpleNamespace(decision=decision, latency_s=1e-4))
    console = Console(file=io.StringIO(), width=120)
    view = LiveView(console, info, [cast("Any", recogniser)])
    console.print(view._answer(0, tally))
    return cast("io.StringIO", console.file).getvalue()


@pytest.mark.parametrize(
    ("outages", "rates", "words"),
    [
        ([OUTAGE], [], "no usable values: 10% of the values are missing"),
        ([], [SLOW], "rows come at 50 Hz, in training at 100 Hz: do not trust the answers"),
    ],
)
def test_an_outage_and_another_rate_are_shown_while_they_last(
    outages: list[Outage], rates: list[RateChange], words: str
) -> None:
    tally = Tally("object", GraspVote(CLASSES, 0.8), outages=outages, rate_changes=rates)
    assert words in screen(tally)
    over = Tally(
        "object", GraspVote(CLASSES, 0.8), outages=[replace(each, end_s=2.0) for each in outages],
        rate_changes=[replace(each, fits=True) for each in rates],
    )  # fmt: skip
    assert words not in screen(over)


@pytest.mark.parametrize(
    ("gate", "words"), [(None, "window joined"), (1.0, "window of this contact")]
)
def test_without_a_gate_nothing_is_said_of_a_contact(gate: float | None, words: str) -> None:
    assert f"90% over 1 {words}" in screen(Tally("object", GraspVote(CLASSES, 0.8)), gate)


def test_before_the_first_window_it_is_shown_what_it_waits_for() -> None:
    tally = Tally("object", GraspVote(CLASSES, 0.8))
    assert f"object: waiting for contact: {WHY}" in screen(tally, touched=False)


def test_values_in_another_unit_are_shown() -> None:
    scale = OtherScale(time_s=1.0, share=1000.0, unit="V")
    tally = Tally("object", GraspVote(CLASSES, 0.8), other_scales=[scale])
    assert "values change about 1,000 times as much" in screen(tally)


def test_a_probability_that_is_not_finite_is_no_number() -> None:
    """Such a window's classes stood there with nan%."""
    tally = Tally("object", GraspVote(CLASSES, 0.8))
    drawn = screen(tally, probabilities=(np.nan, np.nan))
    assert "nan" not in drawn
    assert "·  –" not in drawn  # as wide as a number
    assert "·    –" in drawn
