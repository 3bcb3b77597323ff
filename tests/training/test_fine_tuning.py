"""Claims about training end to end: it learns, keeps normalisation, and shares windows out."""

import json
import subprocess
import sys
from collections.abc import Iterator
from copy import deepcopy
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import torch
from forked import Forked, Started
from numpy.typing import NDArray

from taxel.bench.real_mosquitto import free_port
from taxel.cli.main import main
from taxel.errors import BadDataset, BadInput
from taxel.evaluation.transitions.data import load_camera_set
from taxel.frame_codec import decode_jpeg
from taxel.models.backbones.catalogue import find_backbone
from taxel.models.weights import find_weights
from taxel.training.backbones import lanes as lanes_module
from taxel.training.backbones.fine_tuning import EndToEnd, FineTuneConfig, KeptEpochs, fine_tune
from taxel.training.backbones.lanes import (
    EVERY,
    LANES,
    VARIANTS,
    WINDOWS,
    Batch,
    Lanes,
    lane_count,
    prepared,
    varied,
)
from taxel.training.frames.extractors import open_backbone
from taxel.training.frames.features import extract
from taxel.training.frames.heads import HeadConfig, TrainedHead, fit_head, tracks_of
from taxel.windows.camera_recordings import CameraRecording, frame_sets, read_camera_recordings
from taxel.windows.sequence import label_windows

EDGE = "edge"
K, CONFIG = 3, FineTuneConfig(seed=5)
if find_spec("lightning_fabric") is None:
    pytest.skip(
        "lightning-fabric is not installed: pip install 'taxel[fine-tune]'", allow_module_level=True
    )


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Features of the pours, computed once for all that begin with them."""
    return tmp_path_factory.mktemp("cache")


def learnt_head(folder: Path, cache: Path) -> TrainedHead:
    pours = load_camera_set(folder, "change", cache)
    features = extract(pours.pours, open_backbone(EDGE), cache)
    config = HeadConfig(frames=K, epochs=1, tare="size")
    return fit_head(tracks_of(features, pours.labels), config)


def network(head: TrainedHead) -> EndToEnd:
    module = find_backbone(EDGE).build("logits")
    find_weights(EDGE).load_into(module)
    return EndToEnd(module, EDGE, [head]).eval()


@pytest.mark.slow
def test_training_lowers_the_loss_and_leaves_normalisation_as_it_was(
    few_pours: Path, cache: Path
) -> None:
    pours = load_camera_set(few_pours, "change", cache)
    tuned = network(learnt_head(few_pours, cache))
    before = {name: value.clone() for name, value in tuned.state_dict().items()}
    config = FineTuneConfig(epochs=4, learning_rate=1e-3, accelerator="cpu")

    done = fine_tune(tuned, pours.pours, pours.labels, config)

    assert done.losses[-1] < done.losses[0]
    assert (done.first, done.processes) == (True, 1)
    changed = {name for name, value in tuned.state_dict().items()
               if not torch.equal(value, before[name])}  # fmt: skip
    assert any(name.startswith("features.backbone") for name in changed)
    assert any(name.startswith("heads") for name in changed)
    assert not [name for name in changed if "running" in name or name in ("offset", "factor")]


def test_each_window_of_a_stretch_gives_what_cached_features_give(
    few_pours: Path, cache: Path
) -> None:
    """But for the grasp at rest: the median of five frames' features here, of all of them there."""
    head = learnt_head(few_pours, cache)
    pour = read_camera_recordings(few_pours)[0]
    lanes = Lanes([pour], [np.zeros(len(pour), np.int8)], K, 1)
    (_, start) = lanes.places(CONFIG.seed, 0)[0]
    batch = next(lanes.batches(CONFIG, 0, [0]))
    (features,) = extract([pour], open_backbone(EDGE), cache)
    with torch.inference_mode():
        found = network(head)(batch.images, batch.frames, batch.rest)[0][0, 0].sigmoid().numpy()
    cached = head.probabilities(features.all())[start : start + WINDOWS]
    assert found.shape == (WINDOWS,)
    assert np.abs(found - cached).max() < 0.1
    assert np.corrcoef(found, cached)[0, 1] > 0.9


def marked(few_pours: Path) -> tuple[list[CameraRecording], list[NDArray[np.int8]]]:
    """Return pours whose label changes once, half way."""
    pours = read_camera_recordings(few_pours)[:3]
    return pours, [(np.arange(len(pour)) >= len(pour) // 2).astype(np.int8) for pour in pours]


def test_a_batch_holds_each_stretch_as_it_was_recorded(few_pours: Path) -> None:
    pours, labels = marked(few_pours)
    lanes = Lanes(pours[:1], labels[:1], K, 1)
    (_, start) = lanes.places(CONFIG.seed, 0)[0]
    batch = next(lanes.batches(CONFIG, 0, [0]))
    decoded = np.array([[decode_jpeg(f.jpeg, None) for f in frame_set.frames]
                        for frame_set in frame_sets(pours[0].path, 2)])  # fmt: skip
    own = slice(start, start + K + WINDOWS - 1)
    assert np.array_equal(batch.images[batch.frames[0]].numpy(), decoded[own])
    settled = decoded[[9, 12, 16, 19, 23]]
    assert np.array_equal(batch.images[batch.rest[0]].numpy(), settled)
    wanted = label_windows(labels[0], K)[start : start + WINDOWS]
    assert np.array_equal(batch.labels[0].numpy(), wanted)
    first = batch.images[batch.stretch == 0]
    assert len(first) < 2 * (K + WINDOWS - 1), "equal images stand in it once"
    padded = next(Lanes(pours[:1], labels[:1], K, 1, multiple=64).batches(CONFIG, 0, [0]))
    assert len(padded.images) % 64 == 0
    assert torch.equal(padded.images[padded.frames], batch.images[batch.frames])


def test_half_of_all_stretches_hold_a_change_of_label(few_pours: Path) -> None:
    pours, labels = marked(few_pours)
    lanes = Lanes(pours, labels, K, 1)
    both = [0 < labels[i][start : start + K + WINDOWS - 1].mean() < 1
            for epoch in range(8) for i, start in lanes.places(0, epoch)]  # fmt: skip
    assert np.mean(both) >= 0.5
    assert len({place for epoch in range(8) for place in lanes.places(0, epoch)}) > len(both) // 2


def test_no_stretch_spans_an_outage(few_pours: Path) -> None:
    pours, labels = marked(few_pours)
    lost = len(pours[0]) // 2
    late_s = [np.where(np.arange(len(own)) >= lost, 3.0, 0.0) for own in pours]
    broken = [replace(own, time_s=own.time_s + by) for own, by in zip(pours, late_s, strict=True)]
    lanes = Lanes(broken, labels, K, 1)
    starts = np.array([start for epoch in range(8) for _, start in lanes.places(0, epoch)])
    assert ((starts + K + WINDOWS - 1 <= lost) | (starts >= lost)).all()
    assert starts.min() < lost <= starts.max()


def test_a_variant_changes_all_images_of_a_stretch_alike(few_pours: Path) -> None:
    pours, labels = marked(few_pours)
    lanes = Lanes(pours, labels, K, 1)
    batch = next(lanes.batches(CONFIG, 0, [0]))
    other = varied(replace(batch, variant=torch.tensor([0, 23, 9, 14])))
    images = batch.images.numpy()
    for number, (overhead, mirrored, colours) in enumerate(VARIANTS[v] for v in (0, 23, 9, 14)):
        own = (batch.stretch == number).numpy()
        wanted = images[own][:, ::-1] if overhead else images[own]
        wanted = wanted[:, :, ::-1] if mirrored else wanted
        assert np.array_equal(other.images.numpy()[own], wanted[..., list(colours)])
    assert len(set(VARIANTS)) == 24


def contents(batch: Batch) -> list[bytes]:
    """Return what each stretch of a batch holds."""
    return [
        batch.images[torch.cat([frames.flatten(), rest.flatten()])].numpy().tobytes()
        + bytes([int(variant)]) + label.numpy().tobytes()
        for frames, rest, variant, label
        in zip(batch.frames, batch.rest, batch.variant, batch.labels, strict=True)
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("batch", "processes", "most", "count"),
    [(4, 1, 2, 2), (5, 1, 2, 1), (1, 1, 2, 1), (8, 1, 16, 8), (24, 1, 16, 12), (8, 4, 16, 8),
     (8, 8, 2, 8), (12, 3, 16, 12), (40, 1, 16, 10)],
)  # fmt: skip
def test_a_step_is_shared_out_equally_over_lanes_and_processes(
    batch: int, processes: int, most: int, count: int
) -> None:
    assert lane_count(batch, processes, most) == count
    assert batch % count == count % processes == 0


def test_a_step_that_cannot_be_shared_out_is_refused() -> None:
    with pytest.raises(BadInput, match="choose a multiple of 3"):
        lane_count(4, 3, 16)


def test_fewer_stretches_than_lanes_are_refused(few_pours: Path) -> None:
    pours, labels = marked(few_pours)
    each = -(-len(pours[0]) // EVERY)
    Lanes(pours[:1], labels[:1], K, each)
    with pytest.raises(BadDataset, match=f"at least {each + 1} stretches"):
        Lanes(pours[:1], labels[:1], K, each + 1)


@pytest.mark.parametrize("frames", [12, 18, 23, 24])
def test_a_recording_shorter_than_the_settled_grasp_gives_stretches(
    few_pours: Path, frames: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    pours, labels = marked(few_pours)
    monkeypatch.setattr(lanes_module, "_files", lambda pour: range(pour.images))
    monkeypatch.setattr(lanes_module, "_decode", lambda _: np.zeros((8, 8, 3), np.uint8))
    short = replace(pours[0], time_s=pours[0].time_s[:frames], image=pours[0].image[:frames])
    batch = next(Lanes([short], [labels[0][:frames]], K, 1).batches(CONFIG, 0, [0]))
    assert batch.frames.shape[1] == min(frames, K + WINDOWS - 1)
    assert int(batch.rest.max()) < len(batch.images)


def test_a_short_recording_does_not_shorten_the_stretches_of_others(few_pours: Path) -> None:
    pours, labels = marked(few_pours)
    short = replace(pours[0], time_s=pours[0].time_s[:12], image=pours[0].image[:12])
    lanes = Lanes([short, pours[1]], [labels[0][:12], labels[1]], K, 1)
    assert {recording for recording, _ in lanes.places(0, 0)} == {1}
    assert next(lanes.batches(CONFIG, 0, [0])).frames.shape[1] == K + WINDOWS - 1


@pytest.mark.parametrize("ranks", [1, 2, 3])
def test_processes_share_the_stretches_out_evenly(few_pours: Path, ranks: int) -> None:
    pours, labels = marked(few_pours)
    lanes = Lanes(pours, labels, K, max(LANES, ranks))
    parts = [range(rank, lanes.count, ranks) for rank in range(ranks)]
    each = [sum(len(batch.labels) for batch in lanes.batches(CONFIG, 0, part)) for part in parts]
    assert each == [lanes.share * lanes.count // ranks] * ranks
    assert 0 <= sum(-(-len(pour) // EVERY) for pour in pours) - sum(each) < lanes.count


def test_a_step_holds_the_same_stretches_from_one_process_and_from_two(few_pours: Path) -> None:
    pours, labels = marked(few_pours)
    lanes = Lanes(pours, labels, K, LANES)
    alone = [contents(batch) for batch in lanes.batches(CONFIG, 1, range(2))]
    first, second = ([contents(b) for b in lanes.batches(CONFIG, 1, [r])] for r in (0, 1))
    assert alone == [left + right for left, right in zip(first, second, strict=True)]


def test_what_is_prepared_ahead_comes_in_order_and_what_fails_there_fails_here() -> None:
    def items() -> Iterator[int]:
        yield from range(3)
        raise Broken

    seen: list[int] = []
    with pytest.raises(Broken):
        seen.extend(prepared(items()))
    assert seen == [0, 1, 2]


def test_a_process_decodes_its_own_part_of_the_recordings(
    few_pours: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pours = read_camera_recordings(few_pours)
    labels = [np.zeros(len(pour), np.int8) for pour in pours]
    decoded: list[str] = []
    files = lanes_module._files
    monkeypatch.setattr(
        lanes_module, "_files", lambda pour: decoded.append(pour.name) or files(pour)
    )
    for _ in Lanes(pours, labels, K, LANES).batches(CONFIG, 0, [0]):
        pass
    assert len(decoded) <= len(pours) // 2 + 1


@pytest.mark.slow
def test_a_training_that_was_broken_off_goes_on_with_the_same_losses(
    few_pours: Path, cache: Path, tmp_path: Path
) -> None:
    pours = load_camera_set(few_pours, "change", cache)
    head = learnt_head(few_pours, cache)
    kept = tmp_path / "edge.checkpoint"
    config = FineTuneConfig(epochs=3, learning_rate=1e-3, accelerator="cpu", kept=KeptEpochs(kept))

    def train(*, broken: bool = False) -> tuple[float, ...]:
        def look(step: int, of: int, _: float) -> None:
            if broken and step == of // 2 + 1:
                raise Broken

        done = fine_tune(network(deepcopy(head)), pours.pours, pours.labels, config, on_step=look)
        return done.losses

    whole = train()
    kept.unlink()
    with pytest.raises(Broken):
        train(broken=True)
    assert kept.exists()
    assert train() == pytest.approx(whole, abs=1e-6)


def test_a_loss_that_is_no_number_ends_the_training_and_writes_nothing(
    few_pours: Path, cache: Path, tmp_path: Path
) -> None:
    pours = load_camera_set(few_pours, "change", cache)
    lost = network(learnt_head(few_pours, cache))
    with torch.no_grad():
        next(lost.heads.parameters()).fill_(float("nan"))
    kept = KeptEpochs(tmp_path / "edge.checkpoint")
    with pytest.raises(
        BadInput, match="nan in step 1; try a smaller --learning-rate, without --resume"
    ):
        fine_tune(lost, pours.pours, pours.labels, FineTuneConfig(accelerator="cpu", kept=kept))
    assert not kept.path.exists()


class Broken(Exception):
    """The training was broken off."""


def words(folder: Path, cache: Path, output: Path) -> list[str]:
    return ["train-backbone", str(folder), "--backbone", EDGE, "--epochs", "2", "--frames", "2",
            "--cache", str(cache), "--output", str(output), "--json"]  # fmt: skip


def under_torchrun(words: list[str]) -> list[str]:
    run = [sys.executable, "-m", "torch.distributed.run", "--standalone",
           "--nproc-per-node", "2", "-m", "taxel.cli.main"]  # fmt: skip
    return [*run, *words]


def two(forked: Forked, words: list[str], out: Path) -> list[Started]:
    """Start two processes with the variables by which torchrun tells each its place."""
    both = {"WORLD_SIZE": "2", "LOCAL_WORLD_SIZE": "2", "GROUP_RANK": "0", "GROUP_WORLD_SIZE": "1",
            "TORCHELASTIC_RUN_ID": "two", "MASTER_ADDR": "127.0.0.1",
            "MASTER_PORT": str(free_port())}  # fmt: skip
    return [
        forked.start(words, out.parent, out.with_name(f"{out.name}-{rank}"), out.parent / "err",
                     variables=both | {"RANK": str(rank), "LOCAL_RANK": str(rank)})
        for rank in range(2)
    ]  # fmt: skip


@pytest.mark.slow
def test_two_processes_killed_and_started_again_learn_as_one_does(
    few_pours: Path, cache: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str],
    forked: Forked,
) -> None:  # fmt: skip
    """The same loss curve from one process, from two under torchrun, and from two that were
    killed and started again.
    """
    main(words(few_pours, cache, tmp_path / "1.safetensors"))
    alone = json.loads(capsys.readouterr().out)
    done = subprocess.run(under_torchrun(words(few_pours, cache, tmp_path / "2.safetensors")),
                          capture_output=True, text=True, timeout=600, check=False)  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    both = json.loads(done.stdout)
    assert (alone["processes"], both["processes"]) == (1, 2)
    output = tmp_path / "killed.safetensors"
    checkpoint = tmp_path / "killed.safetensors.checkpoint"
    killed = words(few_pours, cache, output)
    processes = two(forked, killed, tmp_path / "killed")
    while not checkpoint.exists():
        assert [process.poll() for process in processes] == [None, None]
        with pytest.raises(subprocess.TimeoutExpired):
            processes[0].wait(0.02)
    for process in processes:
        process.kill()
    for process in processes:
        process.wait(30)
    assert not output.exists()
    codes = [
        process.wait(600) for process in two(forked, [*killed, "--resume"], tmp_path / "again")
    ]
    assert codes == [0, 0], (tmp_path / "err").read_text()[-2000:]
    again = json.loads((tmp_path / "again-0").read_text())

    assert both["losses"] == pytest.approx(alone["losses"], rel=0.01)
    assert again["losses"] == pytest.approx(both["losses"], abs=1e-6)
    assert sorted(path.name for path in tmp_path.glob("*.safe*")) == [
        "1.safetensors", "2.safetensors", "killed.safetensors",
    ]  # fmt: skip
    module = find_backbone(EDGE).build("logits")
    find_weights(EDGE, output).load_into(module)


@pytest.mark.parametrize(
    "words",
    [
        "--epochs 1 --output out.safetensors",
        "--backbone gel --epochs 1 --output out.safetensors",
        "--backbone edge --epochs -1 --output out.safetensors",
        "--backbone edge --epochs 1 --output out.taxel",
        "--backbone edge --epochs 1 --output out.safetensors --head",
        "--backbone edge --batch 0 --output out.safetensors",
        "--backbone edge --learning-rate 0 --output out.safetensors",
        "--backbone edge --learning-rate nan --output out.safetensors",
    ],
)
def test_options_that_make_no_sense_end_in_one_line(
    words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        main(["train-backbone", "pours", *words.split()])
    assert ended.value.code == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1
    assert not list(tmp_path.iterdir())
