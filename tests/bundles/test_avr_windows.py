"""The board cuts the windows that Python cuts, and says which of them allow no answer."""

import ctypes
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from avr_rig import VOLTS, Trained, small_contract
from c_on_host import host_library, needs_gcc

from taxel.bundles.avr.emit import board_window, write_c
from taxel.bundles.avr.integers import quantise_counts
from taxel.bundles.avr.quantise import Converter
from taxel.errors import BadBundle
from taxel.recordings.reader import list_recordings, read_recording
from taxel.windows.config import TENG_WINDOW, WindowConfig
from taxel.windows.windower import cut_windows


@pytest.mark.parametrize("reference_mv", [3300, 5000])
def test_the_gate_in_counts_is_the_gate_in_volts(reference_mv: int) -> None:
    converter = Converter(reference_mv=reference_mv)
    counts = np.arange(1024, dtype=np.uint16)
    last = converter.last_below(1.55)

    np.testing.assert_array_equal(counts > last, converter.volts(counts) > np.float32(1.55))
    np.testing.assert_array_equal(converter.counts(converter.volts(counts)), counts)
    assert converter.last_below(9.0) == 1023
    assert converter.last_below(-1.0) == -1


@needs_gcc
@pytest.mark.parametrize(
    "window",
    [
        TENG_WINDOW,
        replace(TENG_WINDOW, stride=5),
        replace(TENG_WINDOW, stride=17, max_gap_s=0.3),
        replace(TENG_WINDOW, gate=None),
    ],
    ids=["the thesis's", "overlapping", "with pauses", "without a gate"],
)
def test_the_board_cuts_the_windows_that_python_cuts(
    trained: Trained, tmp_path: Path, window: WindowConfig
) -> None:
    """Scan by scan through the C, window by window as the windower has them."""
    recording = read_recording(list_recordings(trained.data)[0])
    samples = recording.samples[:6000]
    contract = small_contract(trained, window, 12)
    write_c(
        tmp_path,
        trained.integers,
        board_window(contract, VOLTS, recording.manifest.sensor.full_scale),
        VOLTS,
        contract,
        trained.counts[0],
    )
    c = host_library(tmp_path)
    image = (ctypes.c_uint8 * (14 * 14)).in_dll(c, "taxel_image")
    state = ctypes.create_string_buffer(64)
    found = []
    for tick, counts in enumerate(VOLTS.counts(samples.values)):
        if c.taxel_window_push(state, ctypes.c_uint32(tick), ctypes.c_void_p(counts.ctypes.data)):
            found.append(np.array(image).reshape(14, 14)[1:13, 1:13])
            c.taxel_window_next(state)
    wanted = cut_windows(samples, window, recording.manifest.sensor)

    assert len(wanted) > 20
    inputs = quantise_counts(trained.integers, VOLTS.counts(wanted.values))
    np.testing.assert_array_equal(np.array(found), inputs)


@needs_gcc
def test_a_channel_at_its_end_for_a_whole_window_gives_no_answer(trained: Trained) -> None:
    c = host_library(trained.c)
    state = ctypes.create_string_buffer(64)
    sure, unsure = (ctypes.c_uint8 * 2)(0, 255), (ctypes.c_uint8 * 2)(0, 127)
    counts = np.full(12, 600, np.uint16)
    counts[3] = 1023

    def after(scans: list[int]) -> int:
        for tick in scans:
            c.taxel_window_push(state, ctypes.c_uint32(tick), ctypes.c_void_p(counts.ctypes.data))
        return int(c.taxel_doubt(state, sure))

    assert after(list(range(12))) == 1
    c.taxel_window_next(state)
    assert after(list(range(12, 23))) == 0
    counts[3] = 1022
    assert after([23]) == 0
    assert c.taxel_doubt(state, unsure) == 2


@pytest.mark.parametrize(
    ("window", "got"),
    [
        (replace(TENG_WINDOW, layout="A"), "layout A"),
        (replace(TENG_WINDOW, pad=True), "padded"),
        (replace(TENG_WINDOW, tare=True), "tared"),
        (replace(TENG_WINDOW, segment=0.3), "denoised"),
        (replace(TENG_WINDOW, grid_hz=1000.0), "1000"),
        (replace(TENG_WINDOW, grid_hz=33.3), "33.3"),
    ],
)
def test_a_window_that_the_board_cannot_cut_is_refused(
    trained: Trained, window: WindowConfig, got: str
) -> None:
    with pytest.raises(BadBundle, match=got):
        board_window(small_contract(trained, window, 12), VOLTS, 3.3)
