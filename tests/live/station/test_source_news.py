"""Whether a source is live is a matter of what was measured, not of rows."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from taxel.live.station.source_news import SourceNews
from taxel.signals import Samples, SensorInfo, Validity

SENSOR = SensorInfo(name="t", channels=("a", "b"), units=("V", "V"), rate_hz=100.0)


def rows(first: int, flags: list[int]) -> Samples:
    samples = Samples.from_values(np.ones((10, 2)), (first + np.arange(10)) / 100.0)
    samples.validity[:] = flags
    samples.counter[:] = first + np.arange(10)
    return samples


@pytest.mark.parametrize(
    ("flags", "state"),
    [([0, 0], "live"), ([int(Validity.MISSING), 0], "live"), ([4, 4], "live"),
     (2 * [int(Validity.MISSING)], "stale"),
     (2 * [int(Validity.MISSING | Validity.RECONNECTING)], "stale")],
)  # fmt: skip
def test_rows_without_any_value_are_no_sign_of_life(flags: list[int], state: str) -> None:
    source = SimpleNamespace(cameras=(), info=SENSOR, ended=False)
    news = SourceNews(cast("Any", source), "serial:///dev/a")
    news.add(rows(0, [0, 0]), [], 0.1)
    for number in range(1, 11):
        news.add(rows(10 * number, flags), [], 0.1 + 0.1 * number)
    note = news.note(1.1)
    assert (note["state"], note["produced"], note["lost"]) == (state, 110, 0)


def test_a_camera_that_is_gone_is_noted_with_its_reason() -> None:
    ledgers = (SimpleNamespace(name="left", why="another camera (serial 2) is at this address"),
               SimpleNamespace(name="right", why=""))  # fmt: skip
    camera = SimpleNamespace(rate_hz=25.0, pause_s=0.0)
    source = SimpleNamespace(
        cameras=(camera, camera), info=SENSOR, ended=False, ledgers=lambda: ledgers
    )
    news = SourceNews(cast("Any", source), "camera://0,1")
    assert news.note(1.0)["note"] == "left: another camera (serial 2) is at this address"
