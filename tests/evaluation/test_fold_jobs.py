"""Claims about folds as jobs: they give the same bits in any process, from the same recordings."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from taxel.errors import BadDataset
from taxel.evaluation.checked import Checked, check_recipe
from taxel.evaluation.fold_jobs import FoldJob, Source, fit_fold, open_source, travelling
from taxel.evaluation.kept_folds import FoldStore, content_digest
from taxel.evaluation.table_split import OWN_SPLIT
from taxel.jobs.local import LocalEngine
from taxel.jobs.running import use_engine
from taxel.recordings.imports.importing import import_table
from taxel.sources.simulated.data_sets import write_sessions
from taxel.sources.simulated.teng_options import checked_config
from taxel.training.loop import TrainConfig
from taxel.training.recipes import find_recipe

RECIPE = replace(find_recipe("teng"), train=TrainConfig(epochs=1))


@pytest.fixture(autouse=True)
def a_thread_each() -> Iterator[None]:
    """As the command line and all workers have it: sums of two threads differ in the last bit."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


@pytest.fixture(scope="module")
def sessions(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sessions") / "s"
    config = checked_config(seed=1, scans_per_class=3000, rate_hz=100.0, sessions=3)
    write_sessions(folder, config, lambda _: None)
    return folder


def job_of(source: Source, content: str, number: int) -> FoldJob:
    return FoldJob(source=source, content=content, recipe=RECIPE, model=RECIPE.model, number=number)


def same(first: Checked, second: Checked) -> bool:
    ours, theirs = first.predictions, second.predictions
    equal = np.array_equal(ours.probabilities, theirs.probabilities)
    return equal and first.bars == second.bars and first.pooled == second.pooled


def test_a_job_gives_the_bits_that_this_process_gives(
    sessions: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    source = travelling(Source(path=sessions, recipe=RECIPE, folds=2, given=OWN_SPLIT))
    content = content_digest(open_source(source).dataset, RECIPE.target)
    here = check_recipe(sessions, RECIPE, folds=2, bars=())
    monkeypatch.chdir(tmp_path)
    jobs = [
        FoldJob(source=source, content=content, recipe=RECIPE, model=RECIPE.model, number=n)
        for n in (0, 1)
    ]
    found = [fit_fold(job) for job in jobs]
    joined = np.concatenate([result.probabilities for result in found])
    assert np.array_equal(joined, here.predictions.probabilities)


def test_a_worker_with_other_recordings_refuses(sessions: Path) -> None:
    source = Source(path=sessions, recipe=RECIPE, folds=2, given=OWN_SPLIT)
    with pytest.raises(BadDataset, match="the recordings that were parted into folds"):
        fit_fold(
            FoldJob(source=source, content="another", recipe=RECIPE, model=RECIPE.model, number=0)
        )


@pytest.mark.slow
def test_folds_side_by_side_are_equal_bit_for_bit_and_kept_as_they_come(
    sessions: Path, tmp_path: Path
) -> None:
    here = check_recipe(sessions, RECIPE, folds=3, bars=("extra-trees",))
    lines: list[str] = []
    with use_engine(LocalEngine(2)):
        there = check_recipe(
            sessions, RECIPE, folds=3, bars=("extra-trees",), keep=FoldStore(tmp_path / "folds"),
            on_step=lines.append,
        )  # fmt: skip
        assert same(here, there)
        assert len(list((tmp_path / "folds").iterdir())) == 6
        (tmp_path / "folds" / f"{RECIPE.model}-1.npz").unlink()
        again = check_recipe(
            sessions, RECIPE, folds=3, bars=("extra-trees",), keep=FoldStore(tmp_path / "folds")
        )
    assert same(here, again)
    assert again.kept == 5
    assert len([line for line in lines if "extra-trees" in line]) == 3


def test_folds_kept_under_other_groups_are_fitted_anew(tmp_path: Path) -> None:
    """Sessions corrected after an interruption: a kept fold had them on both sides."""
    rng = np.random.default_rng(0)
    for n in range(12):
        np.savetxt(tmp_path / f"{n}.csv", rng.normal(n % 2, 0.1, (20, 2)), delimiter=",")
    recipe = replace(
        find_recipe("array"), target="kind", split="group:session", train=TrainConfig(epochs=1)
    )
    used = []
    for name, session in (("wrong", lambda n: n // 4), ("again", lambda n: n // 4),
                          ("mended", lambda n: n // 2 % 3)):  # fmt: skip
        lines = ["file,label:kind,group:session,channels,time"]
        lines += [f"{n}.csv,{'ab'[n % 2]},s{session(n)},1[N] 2[N],rate:50Hz" for n in range(12)]
        (tmp_path / "table.csv").write_text("\n".join(lines) + "\n")
        import_table(tmp_path / "table.csv", tmp_path / name)
        found = check_recipe(
            tmp_path / name, recipe, folds=3, bars=(), keep=FoldStore(tmp_path / "folds")
        )
        used.append(found.kept)

    assert used == [0, 3, 0]
