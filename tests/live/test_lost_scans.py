"""Lost scans live: short gaps are filled in, said, and answered; past a quarter it is UNKNOWN."""

import numpy as np
import pytest

from taxel.bundles.contract import Contract, contract_from_json, contract_to_json
from taxel.bundles.reader import Bundle, read_bundle
from taxel.bundles.writer import write_bundle
from taxel.decisions.recognition import UNKNOWN, RecogniseConfig
from taxel.live.recogniser import Answer, Recogniser
from taxel.models.cnn2d import Cnn2d
from taxel.signals import Samples, SensorInfo, Validity
from taxel.training.loop import new_network
from taxel.windows.config import WindowConfig
from taxel.windows.scaling import fit_scaling
from taxel.windows.windower import cut_windows

SENSOR = SensorInfo(name="skin", channels=tuple("abcdef"), units=("count",) * 6, rate_hz=100.0)
STEPS = 75


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    """A bundle of windows of 75 rows, whatever it says."""
    values = np.random.default_rng(0).random((8, STEPS, 6)).astype(np.float32)
    mask = np.ones((8, STEPS), bool)
    contract = Contract(
        target="shape", classes=("ball", "block"),
        window=WindowConfig(steps=STEPS, stride=STEPS, grid_hz=None),
        scaling=fit_scaling("standard", values, mask, None), channels=SENSOR.channels,
        units=SENSOR.units, rate_hz=100.0, model="cnn2d", parameters=1, data_digest="0" * 64,
        accuracy={}, software="taxel test", parity=None, learned=("0123456789abcdef",),
    )  # fmt: skip
    path = tmp_path_factory.mktemp("lost") / "b.taxel"
    write_bundle(path, (new_network(lambda: Cnn2d(STEPS, 6, 2), 0),), contract, values, mask)
    return read_bundle(path)


def stream(share: float, rows: int = 1500) -> Samples:
    """Return scans of which this share was lost at random."""
    rng = np.random.default_rng(1)
    lost = np.repeat((rng.random(rows) < share)[:, None], 6, axis=1)
    values = rng.random((rows, 6)).astype(np.float32)
    time_s = np.arange(rows) / 100.0
    return Samples(
        values=np.where(lost, np.float32(0), values), counter=np.arange(rows), device_s=time_s,
        arrival_s=time_s, fitted_s=time_s,
        validity=np.where(lost, Validity.MISSING, Validity.GOOD).astype(np.uint8),
    )  # fmt: skip


def answers(bundle: Bundle, samples: Samples, call: int) -> list[Answer]:
    """Return what is answered when so many scans come at once."""
    recogniser = Recogniser(bundle, SENSOR, RecogniseConfig(least_confidence=0.0))
    parts = [samples[i : i + call] for i in range(0, len(samples), call)]
    return [answer for part in parts for answer in recogniser.push(part)]


@pytest.mark.parametrize("call", [1, 10, 1500])
def test_a_tenth_of_lost_scans_is_answered_and_said(bundle: Bundle, call: int) -> None:
    """All twenty windows are, as offline, and each decision carries what was filled in."""
    found = answers(bundle, stream(0.1), call)
    offline = cut_windows(stream(0.1), bundle.contract.window, SENSOR)

    assert len(found) == len(offline) == 20
    assert not [answer for answer in found if answer.decision.label == UNKNOWN]
    np.testing.assert_allclose([answer.decision.filled for answer in found], offline.filled)
    np.testing.assert_array_equal(np.concatenate([answer.window.values for answer in found]),
                                  offline.values)  # fmt: skip


def test_forty_lost_of_a_hundred_are_unknown(bundle: Bundle) -> None:
    """Nothing is filled in then, and the reason says how much is missing."""
    found = answers(bundle, stream(0.4), 10)

    assert {answer.decision.label for answer in found} == {UNKNOWN}
    assert {answer.decision.filled for answer in found} == {0.0}
    assert all("missing" in answer.decision.reason for answer in found)


def test_a_bundle_of_before_fills_nothing_and_does_not_say_what_it_learned(bundle: Bundle) -> None:
    """Its window has no share to fill, and its contract no fingerprints."""
    text = contract_to_json(bundle.contract)
    before = text.replace('"fill": 0.25,', "").replace(
        '"learned": [\n  "0123456789abcdef"\n ],', ""
    )
    assert len(before) < len(text) - 40
    found = contract_from_json(before)

    assert (found.window.fill, found.learned) == (0.0, ())
    assert contract_from_json(text).window.fill == 0.25
    assert contract_from_json(text).learned == ("0123456789abcdef",)
