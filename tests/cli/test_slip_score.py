"""A slip warning's score is not printed as if it were a probability; what a bundle was called."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from taxel.bundles.grasp import read_grasp_bundle, read_grasp_contract
from taxel.bundles.shipped import BOTH_GELS, CUP_POUR, find_bundle, shipped_bundle
from taxel.cli.evaluation.grasp_bundle import trained_on_warning
from taxel.cli.live.grasps import number_words
from taxel.cli.main import main
from taxel.errors import BadBundle
from taxel.frame_codec import encode_jpeg
from taxel.recordings.manifest import NO_ARRAY, Manifest
from taxel.recordings.writer import Recorder
from taxel.signals import CameraInfo, Frame
from taxel.windows.camera_recordings import digest_of_all, read_camera_recording


@pytest.mark.parametrize("name", [CUP_POUR, BOTH_GELS, "slip-rule"])
def test_what_comes_with_taxel_gives_a_score(name: str) -> None:
    assert not read_grasp_bundle(shipped_bundle(name)).contract.gives_probability


@pytest.mark.parametrize(
    ("features", "head"), [("slip", "boosting"), ("slip", "logistic"), ("gel", "lstm")]
)
def test_a_head_that_learned_whether_it_slips_gives_a_probability(features: str, head: str) -> None:
    contract = replace(read_grasp_contract(shipped_bundle(CUP_POUR)), features=features, head=head)

    assert contract.gives_probability
    assert number_words(contract, 0.25) == "  P(gross-slip) 0.25"


@pytest.mark.slow
def test_a_forecasts_number_is_printed_as_a_score_beside_its_threshold(
    capsys: pytest.CaptureFixture[str],
) -> None:
    main(["live", CUP_POUR, "sim://cup-pour?speed=max", "--seconds", "1"])
    printed = capsys.readouterr().out

    assert "UNKNOWN   learning the settled grasp, 0.4 s left" in printed
    assert "score 0.00 (warns from 0.82)  slip 0.0" in printed
    assert "P(" not in printed
    assert "nan" not in printed


@pytest.mark.parametrize(
    "words",
    [
        "live slip-forecast sim://cup-pour --seconds 1",
        "live cup-pour sim://cup-pour --also slip-forecast --seconds 1",
        "sweep slip-forecast --data pours",
        "adapt slip-forecast --history",
    ],
)
def test_its_former_name_is_refused_in_one_line_that_says_the_new(
    words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        main(words.split())

    assert ended.value.code == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert "needed cup-pour; got the former name slip-forecast" in line
    assert list(tmp_path.iterdir()) == []


def test_a_users_own_file_of_that_name_is_theirs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(BadBundle, match="needed cup-pour"):
        shipped_bundle("slip-forecast")
    Path("slip-forecast").touch()

    assert find_bundle(Path("slip-forecast")) == Path("slip-forecast")


def test_a_score_on_the_training_recordings_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A monitor keeps one digest of all of them, so that other choices are not known again."""
    camera = CameraInfo(name="gel", width=32, height=24, rate_hz=25.0)
    for number in range(3):
        manifest = Manifest(sensor=NO_ARRAY, cameras=(camera,), labels={})
        with Recorder(tmp_path / f"{number}.mcap", manifest) as recorder:
            for i in range(3):
                image = np.full((24, 32, 3), (200, 9 * i, 50 * number), np.uint8)
                recorder.frame(Frame(camera=0, jpeg=encode_jpeg(image), counter=i, device_s=i / 25,
                                     arrival_s=i / 25, fitted_s=i / 25))  # fmt: skip
    files = sorted(tmp_path.glob("*.mcap"))
    digest = digest_of_all([read_camera_recording(file, least=1) for file in files])
    monitor = replace(
        read_grasp_contract(shipped_bundle(CUP_POUR)), features="gel", data_digest=digest
    )
    for contract, chosen, known in (
        (monitor, files, True), (monitor, files[1:], False),
        (replace(monitor, features="slip"), files, False),
    ):  # fmt: skip
        monkeypatch.setattr(
            "taxel.bundles.grasp.read_grasp_contract", lambda _, own=contract: own
        )  # fmt: skip
        warning = trained_on_warning(tmp_path / "mine.taxel", chosen)
        assert (warning is not None) == known
        assert not known or str(warning).startswith("the bundle was trained on 3 of these")

    camera = CameraInfo(name="left", width=8, height=6, rate_hz=10.0)
    silent = tmp_path / "z.mcap"
    Recorder(silent, Manifest.started_now(NO_ARRAY, {}, cameras=(camera,))).close()
    monkeypatch.setattr("taxel.bundles.grasp.read_grasp_contract", lambda _: monitor)
    assert trained_on_warning(tmp_path / "mine.taxel", [*files, silent]) is None
