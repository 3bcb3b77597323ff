"""Keras as the oracle: its weights in our modules give its outputs.

Runs where keras and h5py are installed; neither is a dependency.
"""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch

from taxel.errors import BadInput, MissingExtra
from taxel.models.backbones.catalogue import BACKBONES
from taxel.models.backbones.efficientnet_b0 import EfficientNetB0
from taxel.models.backbones.weight_files import load_backbone_weights

NETWORKS = {
    "densenet121": ("densenet", "DenseNet121"),
    "efficientnet-b0": ("efficientnet", "EfficientNetB0"),
    "resnet50": ("resnet", "ResNet50"),
    "resnet101": ("resnet", "ResNet101"),
}
"""Keras' module and function."""

MAKE_IN_KERAS = """
import importlib, sys
import h5py, keras, numpy as np
from keras.src.legacy.saving import legacy_h5_format
room, network, folder = sys.argv[1:]
keras.utils.set_random_seed(1)
room = importlib.import_module("keras.applications." + room)
model = getattr(room, network)(weights=None, classifier_activation="softmax")
rng = np.random.default_rng(2)
for layer in model.layers:
    arrays = layer.get_weights()
    if isinstance(layer, keras.layers.BatchNormalization):
        shape = arrays[0].shape
        layer.set_weights([rng.uniform(0.6, 0.9, shape), rng.normal(0, 0.05, shape),
                           rng.normal(0, 0.05, shape), rng.uniform(0.8, 1.2, shape)])
    elif isinstance(layer, keras.layers.Normalization):
        layer.set_weights([np.array([0.4, 0.45, 0.5]), np.array([0.05, 0.06, 0.04]), np.array(7)])
    elif len(arrays) == 2 and arrays[1].ndim == 1:
        layer.set_weights([arrays[0], rng.normal(0, 0.05, arrays[1].shape)])
images = rng.integers(0, 256, (1, 224, 224, 3)).astype("float32")
outputs = model(room.preprocess_input(images.copy()), training=False)
np.savez(folder + "/oracle.npz", images=images,
         outputs=keras.ops.convert_to_numpy(outputs), count=model.count_params())
model.save_weights(folder + "/new.weights.h5")
with h5py.File(folder + "/old.h5", "w") as file:
    legacy_h5_format.save_weights_to_hdf5_group(file, model)
"""


@pytest.mark.slow
@pytest.mark.parametrize("name", NETWORKS)
def test_kerass_weights_give_kerass_outputs(name: str, tmp_path: Path) -> None:
    """Both of Keras' file formats; outputs within 1e-5 of the largest, counts exact."""
    for package in ("keras", "h5py"):
        if importlib.util.find_spec(package) is None:
            pytest.skip(f"{package} is not installed: pip install keras h5py")
    environment = {**os.environ, "KERAS_BACKEND": "torch"}
    command = [sys.executable, "-c", MAKE_IN_KERAS, *NETWORKS[name], str(tmp_path)]
    subprocess.run(command, env=environment, check=True, timeout=300)
    oracle = np.load(tmp_path / "oracle.npz")
    images = torch.from_numpy(oracle["images"]).permute(0, 3, 1, 2)
    for file in ("new.weights.h5", "old.h5"):
        module = (
            EfficientNetB0("softmax", published=False)
            if name == "efficientnet-b0"
            else BACKBONES[name].build("softmax")
        )
        load_backbone_weights(module, name, tmp_path / file)
        with torch.no_grad():
            found = module.eval()(images).numpy()

        assert np.abs(found - oracle["outputs"]).max() < 1e-5 * oracle["outputs"].max()


def test_a_keras_file_without_h5py_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "h5py", None)
    path = tmp_path / "densenet121.h5"
    path.write_bytes(b"\x89HDF\r\n\x1a\n")
    module = BACKBONES["edge"].build("logits")

    with pytest.raises(MissingExtra, match=r"run: pip install 'taxel\[hdf5\]'"):
        load_backbone_weights(module, "edge", path)


def test_a_keras_file_that_is_damaged_or_another_networks_is_refused(tmp_path: Path) -> None:
    """One plain line that names the layer; nothing is loaded."""
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "edge.h5"
    module = BACKBONES["edge"].build("logits")
    before = module.halving[0].weight.clone()

    path.write_bytes(b"\x89HDF\r\n\x1a\n")
    with pytest.raises(BadInput, match=r"edge\.h5"):
        load_backbone_weights(module, "edge", path)

    for layer, shape, wanted in (
        ("halving_0", (3, 3, 3), "an array of 4 axes in the layer halving_0"),
        ("other/conv", (3, 3, 3, 16), r"unknown \(first other_conv\)"),
    ):
        with h5py.File(path, "w") as file:
            file.attrs["layer_names"] = [layer.encode()]
            group = file.create_group(layer)
            group.attrs["weight_names"] = [b"kernel:0"]
            group["kernel:0"] = np.ones(shape, np.float32)
        with pytest.raises(BadInput, match=wanted):
            load_backbone_weights(module, "edge", path)
    assert torch.equal(module.halving[0].weight, before)
