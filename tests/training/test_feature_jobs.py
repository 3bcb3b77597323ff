"""Claims about features side by side: what is cached is what one process computes."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from taxel.jobs.local import LocalEngine
from taxel.jobs.running import use_engine
from taxel.training.frames import jobs as feature_jobs
from taxel.training.frames.extractors import SlipExtractor, open_backbone
from taxel.training.frames.features import Progress, extract, kept_path
from taxel.training.frames.jobs import StoredBackbone, extract_one, fill_cache, portable
from taxel.windows.camera_recordings import read_camera_recordings
from taxel.windows.rest import SETTLE


def test_nothing_is_computed_ahead_without_an_engine(few_pours: Path, tmp_path: Path) -> None:
    pours = read_camera_recordings(few_pours)[:1]
    fill_cache(pours, [SlipExtractor(SETTLE)], tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_backbone_travels_as_the_path_of_a_file(few_pours: Path, tmp_path: Path) -> None:
    pours = read_camera_recordings(few_pours)[:1]
    backbone = open_backbone("edge")
    stored = portable(backbone, tmp_path)
    assert isinstance(stored, StoredBackbone)
    assert stored.model.read_bytes() == backbone.model
    extract_one(pours[0].path, stored, tmp_path / "there")
    (there,) = extract(pours, backbone, tmp_path / "there")
    (here,) = extract(pours, backbone, tmp_path / "here")
    assert np.array_equal(here.values, there.values)


def test_the_longest_recording_is_the_first(
    few_pours: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Begun last, it would keep one worker busy while the others have nothing to do."""
    pours = read_camera_recordings(few_pours)[:3]
    pours = [replace(p, time_s=p.time_s[:n]) for p, n in zip(pours, (20, 40, 30), strict=True)]
    order: list[str] = []

    def as_done(work: object, jobs: object, names: list[str]) -> list[object]:
        order.extend(names)
        return []

    monkeypatch.setattr(feature_jobs, "as_done", as_done)
    with use_engine(LocalEngine(2)):
        fill_cache(pours, [SlipExtractor(SETTLE)] * 3, tmp_path)
    assert order == [pours[1].name, pours[2].name, pours[0].name]


@pytest.mark.slow
def test_workers_fill_the_cache_with_the_same_numbers(few_pours: Path, tmp_path: Path) -> None:
    pours, own = read_camera_recordings(few_pours), SlipExtractor(SETTLE)
    done: list[Progress] = []
    with use_engine(LocalEngine(2)):
        fill_cache(pours, [own] * len(pours), tmp_path / "there", done.append)
    assert [step.recordings for step in done] == list(range(1, len(pours) + 1))
    assert all(kept_path(tmp_path / "there", own, pour).exists() for pour in pours)
    here = extract(pours, own, tmp_path / "here")
    there = extract(pours, own, tmp_path / "there")
    assert all(np.array_equal(a.values, b.values) for a, b in zip(here, there, strict=True))
