"""Claims about pretraining the touch encoder: what it sees, what it predicts, that it can go on."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors import safe_open

from taxel.cli.main import main
from taxel.errors import BadDataset, BadInput
from taxel.models.backbones.touch import HEIGHT_PX, WIDTH_PX
from taxel.training.backbones.fine_tuning import KeptEpochs
from taxel.training.encoder.card import seen_of
from taxel.training.encoder.change import FLOW_PLACES, FLOW_PX, changes, slip_size
from taxel.training.encoder.fit import EncoderConfig, fit_encoder
from taxel.training.encoder.pretext import regularity
from taxel.training.encoder.videos import TouchVideo, chosen_frames, without
from taxel.windows.trial_layout import Layout

SHORT = EncoderConfig(epochs=2, steps=2, batch=4, seed=3)


def video(number: int, folder: str = "a", thing: str = "mug") -> TouchVideo:
    random = np.random.default_rng(number)
    coarse = random.integers(0, 256, (3, 8, 12, 16, 3), np.uint8)
    return TouchVideo(
        folder=folder, trial=f"{thing}-{number}", groups={"object": thing}, digest=str(number),
        images=coarse.repeat(10, axis=2).repeat(10, axis=3),
        slip_um=np.cumsum(random.uniform(0, 50, (3, 8)), axis=1).astype(np.float32),
    )  # fmt: skip


def dots() -> np.ndarray:
    """A gel with dots, a little blurred, shape (120, 160, 3)."""
    down, across = np.mgrid[:HEIGHT_PX, :WIDTH_PX]
    grey = 120 + 60 * np.sin(across / 3.0) * np.sin(down / 3.0)
    return np.repeat(grey[..., None], 3, axis=2).astype(np.uint8)


@pytest.mark.parametrize("frames", [48, 49, 141, 450])
def test_the_images_lie_in_the_crops_of_camera_trials(frames: int) -> None:
    """At 25 frames a second: every sixth of each crop, so that length does not show."""
    starts = Layout(48, 3).starts(range(frames))

    assert chosen_frames(frames, 25.0).tolist() == [
        [start + 6 * at for at in range(8)] for start in starts
    ]


def test_a_video_that_is_too_short_is_refused() -> None:
    with pytest.raises(BadDataset, match=r"needed videos of at least 48 frames .*got 47"):
        chosen_frames(47, 25.0)


def test_flow_is_what_the_image_moved() -> None:
    """Two pixels to the right, everywhere but at the rim."""
    first = dots()
    found = changes(first[None], np.roll(first, 2, axis=1)[None])
    flow = found.flow.reshape(*FLOW_PLACES, 2) * FLOW_PX

    assert np.median(flow[1:-1, 1:-1, 0]) == pytest.approx(2.0, abs=0.3)
    assert np.median(flow[1:-1, 1:-1, 1]) == pytest.approx(0.0, abs=0.3)


def test_of_an_image_and_itself_nothing_changes() -> None:
    found = changes(dots()[None], dots()[None])

    assert not found.flow.any()
    assert not found.grey.any()
    assert not found.size.any()


def test_slip_counts_the_way_between_two_moments_and_stays_unknown() -> None:
    found = slip_size(np.array([10, 30, np.nan]), np.array([30, 10, 5]))

    assert found[0] == found[1] == pytest.approx(np.log(2))
    assert np.isnan(found[2])


def test_features_that_are_all_alike_cost_more_than_spread_ones() -> None:
    spread = torch.randn(64, 8, generator=torch.Generator().manual_seed(0))

    assert regularity(torch.zeros(64, 8)) > 0.9
    assert regularity(2 * spread) < regularity(spread[:, :1].expand(64, 8))


def test_a_training_that_goes_on_equals_an_unbroken_one(tmp_path: Path) -> None:
    """Broken off in its second epoch, it ends with the very same numbers."""
    videos = [video(0), video(1, "b"), video(2, "b", "can")]
    checkpoint = tmp_path / "c"
    whole = fit_encoder(videos, SHORT)

    def stop(step: int, of: int, loss: float) -> None:
        if step == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fit_encoder(videos, SHORT, kept=KeptEpochs(checkpoint), on_step=stop)
    again = fit_encoder(videos, SHORT, kept=KeptEpochs(checkpoint))

    assert again.losses == whole.losses
    for name, tensor in whole.encoder.state_dict().items():
        assert torch.equal(tensor, again.encoder.state_dict()[name]), name


def test_a_checkpoint_of_other_data_is_refused(tmp_path: Path) -> None:
    once = replace(SHORT, epochs=1, steps=1)
    fit_encoder([video(0)], once, kept=KeptEpochs(tmp_path / "c"))

    with pytest.raises(BadInput, match="another configuration or other data"):
        fit_encoder([video(1)], once, kept=KeptEpochs(tmp_path / "c"))


def test_a_checkpoint_of_other_images_or_slip_of_the_same_video_is_refused(tmp_path: Path) -> None:
    """As where a table's rate was corrected, so that other frames of each video are seen."""
    once, kept, own = replace(SHORT, epochs=1, steps=1), KeptEpochs(tmp_path / "c"), video(0)
    fit_encoder([own], once, kept=kept)

    for other in (
        replace(own, images=own.images[:, ::-1].copy()),
        replace(own, slip_um=own.slip_um + np.float32(1.0)),
    ):
        with pytest.raises(BadInput, match="another configuration or other data"):
            fit_encoder([other], once, kept=kept)
    assert len(fit_encoder([own], once, kept=kept).losses) == 1


def test_without_videos_nothing_is_learned() -> None:
    with pytest.raises(BadDataset, match="at least one video"):
        fit_encoder([], SHORT)


def test_videos_of_objects_left_out_are_not_seen_nor_listed() -> None:
    videos = [video(0), video(1, "b"), video(2, "b", "can")]

    assert [kept.trial for kept in without(videos, ["can"])] == ["mug-0", "mug-1"]
    assert [seen.groups for seen in seen_of(videos)] == [
        {"object": ["mug"]}, {"object": ["can", "mug"]}
    ]  # fmt: skip


def test_the_command_writes_weights_of_16_bits_and_a_card_of_all_that_was_seen(
    pour: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "out" / "own.safetensors"
    output.parent.mkdir()
    main(["train-encoder", str(pour.parent), "--output", str(output), "--epochs", "1", "--steps",
          "1", "--json"])  # fmt: skip
    card = json.loads(capsys.readouterr().out)

    assert card == json.loads(output.with_suffix(".json").read_text())
    assert [seen["folder"] for seen in card["seen"]] == ["cups"]
    assert card["seen"][0]["simulated"]
    with safe_open(output, framework="pt") as file:
        assert {file.get_tensor(key).dtype for key in file.keys()} == {torch.float16}  # noqa: SIM118
    assert sorted(path.name for path in output.parent.iterdir()) == [
        "own.json", "own.onnx", "own.safetensors",
    ]  # fmt: skip


@pytest.mark.parametrize(
    "words",
    ["--output out.taxel", "--output o.safetensors --epochs 0",
     "--output o.safetensors --steps 0", "--output o.safetensors --seed -1"],
)  # fmt: skip
def test_options_that_make_no_sense_end_in_one_line(
    words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        main(["train-encoder", "pours", *words.split()])
    assert ended.value.code == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1
    assert not list(tmp_path.iterdir())
