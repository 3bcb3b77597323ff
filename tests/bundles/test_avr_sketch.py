"""The sketch that classifies on the board says what Python says of the same converter counts."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from taxel.bench.boards.emulator import INSTALL, build_firmware, missing_parts
from taxel.bench.boards.sketch import OnChip, on_chip, run_sketch
from taxel.bundles.avr.decisions import Doubt, unpack_decision
from taxel.evaluation.splits import by_group
from taxel.recordings.reader import list_recordings, read_recording
from taxel.sources.simulated.data_sets import simulate_presets
from taxel.windows.config import TENG_WINDOW
from taxel.windows.dataset import load_dataset
from taxel.wire.messages import Heartbeat, Hello, State, unpack

needs_boards = pytest.mark.skipif(
    bool(missing_parts()), reason=f"no {', '.join(missing_parts())}: {INSTALL}"
)


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sketch")
    simulate_presets(folder, ("honest",), 40_000, 0)
    return folder / "honest"


@pytest.fixture(scope="module")
def chip(recordings: Path, tmp_path_factory: pytest.TempPathFactory) -> OnChip:
    dataset = load_dataset(recordings, TENG_WINDOW, target="shape")
    fold = by_group(dataset, "shape", "session", 5, 0, final=True).final
    assert fold is not None
    return on_chip(dataset, *fold.windows(dataset), tmp_path_factory.mktemp("chip"))


@needs_boards
def test_the_sketch_classifies_every_window_as_python_does(
    chip: OnChip, recordings: Path, tmp_path: Path
) -> None:
    """Scans, gate, windows, network and frames on the chip; a stuck channel gives no class."""
    recording = read_recording(list_recordings(recordings)[0])
    volts = recording.samples.values[:1000].copy()
    volts[:30, 2] = 3.3
    found = run_sketch(build_firmware(), chip, volts, recording.manifest.sensor, tmp_path)

    assert len(found.sent) >= 8
    assert found.wrong == 0
    assert found.sent[0].reason == Doubt.SATURATED
    assert found.sent[0].best is None
    assert any(answer.best is not None for answer in found.sent)
    assert max(answer.took_us for answer in found.sent) <= 110_000
    ticks = np.array([answer.seq for answer in found.sent])
    times = np.array([answer.t_us for answer in found.sent])
    np.testing.assert_array_equal(np.diff(times), np.diff(ticks) * 10_000)

    others = [message for payload in found.payloads if (message := unpack(payload)) is not None]
    assert len(others) + len(found.sent) == len(found.payloads)
    hello, beats = others[0], [other for other in others if isinstance(other, Heartbeat)]
    assert isinstance(hello, Hello)
    assert (hello.rate_hz, hello.channels, hello.abilities) == (100, 0, 8)
    assert max(np.diff([beat.t_us for beat in beats])) <= 100_000
    assert {(beat.state, beat.dropped, beat.bad) for beat in beats} == {(State.IDLE, 0, 0)}


@needs_boards
def test_a_sketch_that_computes_otherwise_says_fault_and_no_class(
    chip: OnChip, recordings: Path, tmp_path: Path
) -> None:
    """One number of the network changed: the window stored with it no longer gives its sums."""
    for file in chip.folder.iterdir():
        (tmp_path / file.name).write_text(file.read_text())
    weights = tmp_path / "taxel_weights.h"
    start = "last_biases[] PROGMEM = {\n  "
    weights.write_text(weights.read_text().replace(start, start + "1 + "))
    recording = read_recording(list_recordings(recordings)[0])
    found = run_sketch(
        build_firmware(),
        replace(chip, folder=tmp_path),
        recording.samples.values[:400],
        recording.manifest.sensor,
        tmp_path,
    )

    assert found.wanted
    assert found.sent == []
    beats = [message for message in map(unpack, found.payloads) if isinstance(message, Heartbeat)]
    assert {beat.state for beat in beats} == {State.FAULT}


def test_a_decision_is_read_as_the_c_packs_it() -> None:
    payload = bytes([7, 3, 1, 2, 0, 0, 0x10, 0x27, 0, 0, 255, 120, 2, 0x39, 0x30, 0, 0])
    decision = unpack_decision(payload)

    assert decision is not None
    assert (decision.board, decision.seq, decision.t_us) == (3, 0x0201, 10_000)
    assert (decision.best, decision.confidence, decision.reason) == (None, 120, Doubt.NOT_SURE)
    assert decision.took_us == 12_345
    assert unpack_decision(payload[:-1]) is None
    assert unpack_decision(b"\x02" + payload[1:]) is None
