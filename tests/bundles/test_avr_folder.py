"""The folder of C: what is written, what its report says, and which networks are refused."""

import errno
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from avr_rig import VOLTS, Trained

from taxel.bundles.avr.emit import board_window, left_out, write_c
from taxel.bundles.avr.measure import without_board
from taxel.bundles.avr.write import reference_of, write_avr
from taxel.bundles.reader import read_bundle
from taxel.bundles.writer import write_bundle
from taxel.cli.main import main
from taxel.errors import BadBundle, BadInput, RecordingFailed
from taxel.models.cnn1d import Cnn1d
from taxel.models.cnn2d import Cnn2d
from taxel.signals import SensorInfo
from taxel.training.loop import new_network
from taxel.windows.reference import Reference


def test_the_converters_reference_is_read_or_asked_for() -> None:
    def sensor(**details: str) -> SensorInfo:
        return SensorInfo(name="x", channels=("a",), units=("V",), rate_hz=100.0, details=details)

    assert reference_of(sensor(reference_v="3.3")) == 3300
    assert reference_of(sensor(a="firmware 1.0.0, 10 bits, reference 5000 mV")) == 5000
    with pytest.raises(BadInput, match="--reference-mv"):
        reference_of(sensor())
    with pytest.raises(BadInput, match="3300 mV and 5000 mV"):
        reference_of(sensor(a="reference 5000 mV", b="reference 3300 mV"))


def test_the_report_says_what_was_measured_on_what(trained: Trained, tmp_path: Path) -> None:
    report = write_avr(trained.path, tmp_path / "new" / "c", trained.data)
    text = "\n".join(report.lines())

    assert "trained on (nothing held out)" in text
    assert (
        json.loads((tmp_path / "new" / "c" / "avr_report.json").read_text())["parameters"] == 5987
    )
    assert report.points_lost <= 1.0
    assert {"taxel_model.h", "taxel_weights.h", "taxel_cnn.c"} <= set(report.files)
    assert report.bit_exact is not False
    assert ("ms a window" in text) == (not without_board())


def test_without_an_emulator_the_report_says_what_to_install(
    trained: Trained, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("taxel.bundles.avr.measure.shutil.which", lambda _: None)
    report = write_avr(trained.path, tmp_path, trained.data)

    assert report.clocks is None
    assert "apt install gcc-avr" in report.lines()[-1]


def test_a_window_that_takes_longer_than_scans_can_wait_is_reported(
    trained: Trained, tmp_path: Path
) -> None:
    """On the emulated sketch at 100 rows/s, windows of 20 rows lost a scan each."""
    written = write_avr(trained.path, tmp_path, trained.data)
    for rate_hz, stride, ms, slow in (
        (100, 12, 42.5, False), (100, 6, 42.5, False), (100, 4, 42.5, True),
        (100, 20, 71.6, True), (100, 20, 68.5, True), (200, 12, 42.5, True),
    ):  # fmt: skip
        report = replace(
            written, row_hz=rate_hz, stride=stride, milliseconds=ms, clocks=1, ram_bytes=1,
            flash_bytes=1, bit_exact=True,
        )  # fmt: skip

        assert ("too slow" in report.lines()[-1]) == slow


def test_the_c_says_that_it_is_not_scaled_by_reference_touches(trained: Trained) -> None:
    contract = trained.bundle.contract
    reference = Reference(touches="object=cylinder-glass:3", level=np.ones(12, np.float32))

    assert left_out(contract) == ""
    assert "level of this bundle" in left_out(replace(contract, reference=reference))


def test_writing_twice_gives_the_same_c(trained: Trained, tmp_path: Path) -> None:
    window = board_window(trained.bundle.contract, VOLTS, trained.dataset.sensor.full_scale)
    write_c(tmp_path, trained.integers, window, VOLTS, trained.bundle.contract, trained.counts[0])

    for file in trained.c.iterdir():
        assert (tmp_path / file.name).read_bytes() == file.read_bytes()


def test_a_full_disk_leaves_the_earlier_c_as_it_was(
    trained: Trained, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Half of the weights over the old ones would be a network of neither."""
    window = board_window(trained.bundle.contract, VOLTS, trained.dataset.sensor.full_scale)
    earlier = tmp_path / "taxel_weights.h"
    earlier.write_text("earlier")

    def full(path: Path, content: str | bytes, *_: object) -> int:
        data = content.encode() if isinstance(content, str) else content
        weights = b"first_weights" in data
        with path.open("wb") as file:
            file.write(data[: len(data) // (1 + weights)])
        if weights:
            raise OSError(errno.ENOSPC, "no room")
        return len(data)

    monkeypatch.setattr(Path, "write_bytes", full)
    monkeypatch.setattr(Path, "write_text", full)
    with pytest.raises(RecordingFailed, match="no room"):
        write_c(tmp_path, trained.integers, window, VOLTS, trained.bundle.contract,
                trained.counts[0])  # fmt: skip

    assert earlier.read_bytes() == b"earlier"


@pytest.mark.parametrize("kind", ["several that vote", "signal-based"])
def test_another_network_is_refused(trained: Trained, tmp_path: Path, kind: str) -> None:
    several = kind == "several that vote"
    build = (lambda: Cnn2d(12, 12, 3)) if several else (lambda: Cnn1d(12, 12, 3))
    networks = tuple(new_network(build, seed) for seed in range(2 if several else 1))
    path = tmp_path / "other.taxel"
    part = trained.dataset.windows[:20]
    write_bundle(path, networks, trained.bundle.contract, part.values, part.mask)

    with pytest.raises(BadBundle, match="cnn2d") as caught:
        write_avr(path, tmp_path / "c", trained.data)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "c").exists()


def test_the_command_writes_a_folder_and_its_report(
    trained: Trained, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "board"
    order = ["bundle", str(trained.run), "--board", "mega", "--output", str(output), "--json"]

    main([*order, "--test", str(trained.data), "--reference-mv", "3300"])
    report = json.loads(capsys.readouterr().out)
    assert report["reference_mv"] == 3300
    assert report["points_lost"] <= 1.0
    written = read_bundle(output / "network.taxel").contract
    assert written.classes == trained.bundle.contract.classes
    with pytest.raises(SystemExit) as ended:
        main(["bundle", str(trained.run), "--output", str(output), "--reference-mv", "5000"])
    message = capsys.readouterr().err
    assert ended.value.code == 2
    assert "--board beside --reference-mv" in message
    assert message.count("\n") == 1
