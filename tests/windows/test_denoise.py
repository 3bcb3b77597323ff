"""Cleaning: exact on what can be computed by hand, and the same offline, live and in bundles."""

import json
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import pywt

from taxel.bundles.contract import Contract, contract_from_json, contract_to_json
from taxel.bundles.reader import Bundle, read_bundle
from taxel.bundles.writer import write_bundle
from taxel.decisions.recognition import RecogniseConfig
from taxel.errors import BadInput, MissingExtra
from taxel.live.recogniser import Recogniser
from taxel.models.cnn2d import Cnn2d
from taxel.signals import Samples, SensorInfo
from taxel.training.loop import new_network
from taxel.windows.config import TENG_WINDOW, WAVELET, WindowConfig
from taxel.windows.denoise import cleaner, deepest_level, denoise, segment
from taxel.windows.scaling import fit_scaling
from taxel.windows.windower import Windower, Windows, cut_windows

SENSOR = SensorInfo(
    name="t", channels=("a", "b", "c"), units=("V",) * 3, rate_hz=100.0, full_scale=3.3
)
HAAR, DB2 = pywt.Wavelet("haar"), pywt.Wavelet("db2")
CONFIGS = {
    "wavelet": WindowConfig(gate=1.55, wavelet="db2"),
    "wavelet, overlapping": WindowConfig(steps=16, stride=5, wavelet="haar"),
    "segmented": WindowConfig(gate=1.55, segment=1.55),
    "segmented, layout A": WindowConfig(gate=1.55, layout="A", segment=2.0),
    "all of it": WindowConfig(
        steps=30, stride=30, gate=1.55, max_gap_s=0.1, pad=True, tare=True, wavelet="db2",
        segment=0.5,
    ),
}  # fmt: skip


def touch(n: int = 900, seed: int = 0) -> Samples:
    """Bursts of contact between stretches of rest, with noise."""
    rng = np.random.default_rng(seed)
    level = np.repeat(rng.random(n // 40 + 1) < 0.4, 40)[:n] * 2.0
    values = np.clip(level[:, None] + rng.normal(0.0, 0.3, (n, 3)), 0.0, 3.3)
    return Samples.from_values(values, np.arange(n) / 100.0, full_scale=3.3)


def column(*values: float) -> np.ndarray:
    """One window of one channel."""
    return np.array(values, np.float32)[None, :, None]


def test_a_lone_pulse_in_silence_is_kept_exactly() -> None:
    """The finest coefficients' median is 0, so nothing counts as noise."""
    pulse = column(0, 0, 0, 0, 0, 0, 0, 3)

    np.testing.assert_allclose(denoise(pulse, HAAR), pulse, atol=1e-6)


def test_coefficients_below_the_universal_threshold_vanish() -> None:
    """By hand: |d| = √2 and √2, 2 below; threshold √2 / 0.6745 · √(2 ln 4) = 3.49."""
    np.testing.assert_allclose(denoise(column(0, 2, 0, -2), HAAR), column(0, 0, 0, 0), atol=1e-6)


def test_coefficients_above_it_are_shrunk_by_it() -> None:
    """Haar by hand: fine details all 0.1, so σ = 0.1 / 0.6745 and t = σ √(2 ln 8)."""
    e = 0.1 / np.sqrt(2.0)
    window = column(2 + e, 2 - e, 2 + e, 2 - e, e, -e, e, -e)
    threshold = 0.1 / 0.6745 * np.sqrt(2.0 * np.log(8.0))
    coarse = 2.0 * np.sqrt(2.0)  # of the step from 2 to 0 over 8 rows
    half = (coarse - threshold) / coarse

    expected = column(*[1 + half] * 4, *[1 - half] * 4)

    np.testing.assert_allclose(denoise(window, HAAR), expected, atol=1e-5)


def test_a_slope_is_signal_to_the_chosen_wavelet_and_noise_to_haar() -> None:
    """Why db2: a charge that leaks away must not set the noise level."""
    slope = column(*np.linspace(3.0, 0.5, 12))

    inner = slice(2, 10)
    by_db2 = np.abs(denoise(slope, DB2) - slope)[0, inner].max()
    by_haar = np.abs(denoise(slope, HAAR) - slope)[0, inner].max()

    assert by_db2 < 0.25 * by_haar


def test_noise_on_a_press_is_lowered_by_a_third() -> None:
    rng = np.random.default_rng(0)
    pulse = 2.5 * np.sin(np.linspace(0.0, np.pi, 64))
    clean = np.broadcast_to(pulse[None, :, None], (50, 64, 3)).astype(np.float32)
    noisy = clean + rng.normal(0.0, 0.2, clean.shape).astype(np.float32)

    def error(values: np.ndarray) -> float:
        return float(np.sqrt(((values - clean) ** 2).mean()))

    assert error(denoise(noisy, DB2)) < 0.7 * error(noisy)


def test_segmentation_keeps_what_the_gate_calls_contact() -> None:
    found = segment(column(0.2, 1.55, 1.5501, 3.3), 1.55)

    np.testing.assert_array_equal(found, column(0, 0, 1.5501, 3.3))


@pytest.mark.parametrize("name", CONFIGS)
def test_cleaned_windows_are_the_same_however_a_stream_is_cut(name: str) -> None:
    config, samples = CONFIGS[name], touch()
    whole = cut_windows(samples, config, SENSOR)
    raw = cut_windows(samples, replace(config, wavelet=None, segment=None), SENSOR)
    for cuts in ([0, 7, 300, 301, 555, 900], list(range(901))):
        windower = Windower(config, SENSOR)
        parts = [windower.push(samples[a:b]) for a, b in pairwise(cuts)]
        pieces = Windows.join([*parts, windower.flush()])
        np.testing.assert_array_equal(pieces.values, whole.values)
        np.testing.assert_array_equal(pieces.mask, whole.mask)

    assert len(whole) > 3
    assert not np.array_equal(whole.values, raw.values) or config.layout == "B"
    for field in ("mask", "usable", "saturated", "start_s", "end_s"):
        np.testing.assert_array_equal(getattr(whole, field), getattr(raw, field))
    assert not whole.values[~whole.mask].any()


def test_measured_rows_are_denoised_without_their_padding() -> None:
    rows = np.random.default_rng(0).random((1, 9, 3)).astype(np.float32)
    values = np.concatenate([rows, np.zeros((1, 7, 3), np.float32)], axis=1)
    mask = (np.arange(16) < 9)[None]
    clean = cleaner(WindowConfig(steps=16, wavelet="db2"))
    assert clean is not None

    found = clean(values, mask)

    np.testing.assert_array_equal(found[:, :9], denoise(rows, DB2))
    assert not found[:, 9:].any()


def test_a_bundle_cleans_live_as_it_was_trained(tmp_path: Path) -> None:
    """Scan by scan through a written bundle: the offline windows' probabilities."""
    samples = touch()
    window = WindowConfig(gate=1.55, wavelet="db2", segment=0.3)
    offline = cut_windows(samples, window, SENSOR)
    bundle = _bundle(tmp_path, window, offline)
    recogniser = Recogniser(bundle, SENSOR, RecogniseConfig(least_confidence=0.0))

    answers = [a for i in range(len(samples)) for a in recogniser.push(samples[i : i + 1])]

    assert bundle.contract.window == window
    assert len(answers) == len(offline) > 3
    for index, answer in enumerate(answers):
        np.testing.assert_array_equal(answer.window.values[0], offline.values[index])


def test_a_contract_from_before_cleaning_still_loads(tmp_path: Path) -> None:
    contract = _bundle(tmp_path, TENG_WINDOW, cut_windows(touch(), TENG_WINDOW, SENSOR)).contract
    old = json.loads(contract_to_json(contract))
    del old["window"]["wavelet"], old["window"]["segment"]

    again = contract_from_json(json.dumps(old))

    assert again.window == TENG_WINDOW
    assert contract_to_json(again) == contract_to_json(contract)


def test_the_wavelet_library_is_loaded_only_where_it_is_used() -> None:
    code = (
        "import sys; import numpy as np; from taxel.windows.windower import cut_windows;"
        "from taxel.windows.config import WindowConfig; from taxel.signals import *;"
        "s=SensorInfo(name='t',channels=('a',),units=('V',),rate_hz=100.0);"
        "x=Samples.from_values(np.ones((60,1)),np.arange(60)/100);"
        "assert len(cut_windows(x,WindowConfig(segment=0.5),s))==5;"
        "assert 'pywt' not in sys.modules;"
        "cut_windows(x,WindowConfig(wavelet='db2'),s); assert 'pywt' in sys.modules"
    )

    subprocess.run([sys.executable, "-c", code], check=True)


def test_a_missing_library_names_its_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pywt", None)

    with pytest.raises(MissingExtra, match=r"taxel\[denoise\]"):
        Windower(WindowConfig(wavelet=WAVELET), SENSOR)


def test_a_wavelet_that_does_not_exist_or_does_not_fit_is_refused() -> None:
    with pytest.raises(BadInput, match="such as db2"):
        Windower(WindowConfig(wavelet="gaussian-ish"), SENSOR)
    with pytest.raises(BadInput, match="at least 14 rows"):
        Windower(WindowConfig(steps=12, wavelet="sym4"), SENSOR)
    with pytest.raises(ValueError, match="layout B"):
        WindowConfig(gate=1.0, layout="A", wavelet="haar")
    with pytest.raises(ValueError, match="finite"):
        WindowConfig(segment=float("nan"))


def test_levels_are_the_librarys() -> None:
    for rows in range(2, 100):
        for length in (2, 4, 8):
            assert deepest_level(rows, length) == pywt.dwt_max_level(rows, length)


def _bundle(folder: Path, window: WindowConfig, windows: Windows) -> Bundle:
    scaling = fit_scaling("full-scale", windows.values, windows.mask, 3.3)
    contract = Contract(
        target="shape",
        classes=("cube", "sphere"),
        window=window,
        scaling=scaling,
        channels=SENSOR.channels,
        units=SENSOR.units,
        rate_hz=100.0,
        model="cnn2d",
        parameters=1,
        data_digest="0" * 64,
        accuracy={},
        software="taxel test",
        parity=None,
    )
    network = new_network(lambda: Cnn2d(window.steps, 3, 2), 0)
    write_bundle(folder / "b.taxel", (network,), contract, windows.values, windows.mask)
    return read_bundle(folder / "b.taxel")
