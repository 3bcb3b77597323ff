"""A real mosquitto for each test that wants one; skipped with a reason where there is none."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from taxel.bench.real_mosquitto import MOSQUITTO, Mosquitto


@pytest.fixture
def mosquitto(tmp_path: Path) -> Iterator[Mosquitto]:
    if MOSQUITTO is None:
        pytest.skip("needs mosquitto: apt-get install mosquitto")
    broker = Mosquitto(tmp_path)
    broker.start()
    yield broker
    broker.kill()
