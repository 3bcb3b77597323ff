"""Rows on how far labels of simulated trials carry to gelsight-slip, and what changes them.

Knows nothing about how rows are printed.

Background of our choices: docs/decisions/0059.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from time import process_time
from typing import TYPE_CHECKING

import numpy as np

from taxel.bench.rows import Row, missing

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from torch import nn

    from taxel.evaluation.camera_trials.encoder_study import ProbeSet
    from taxel.evaluation.camera_trials.probe import Rows
    from taxel.evaluation.camera_trials.sim_to_real import Found, Ranking
    from taxel.evaluation.camera_trials.simulated_trials import SimulatedTrial
    from taxel.training.camera_trials.learning import Learning
    from taxel.windows.camera_trials import CameraTrial

NAME = "gelsight-slip by object, sim to real"
FIRST_CUP, CUPS, MOST = 300, 16, 4
"""Cups, and trials of each outcome that a cup may give. Source: our choice, decision 59."""
FEW, DRAWS = (1, 5), 3
"""Labelled objects, and how often they are drawn a fold."""
MIDDLE_CROP, PAINTED_CUPS = 1, 6
"""Painted by the generator: one of a trial's three crops, of the first cups."""
NO_DATA = "no recordings: name their folder with --data"


@dataclass(frozen=True, slots=True)
class _Domains:
    """Trials of both worlds, seen by one kind of features."""

    real: Learning
    simulated: Learning
    changed: Learning
    """The same trials, and a plainly changed copy of each."""


@dataclass(frozen=True, slots=True)
class _Study:
    """Who is tested, and what is learned from."""

    probed: ProbeSet
    found: Sequence[CameraTrial]
    trials: Sequence[SimulatedTrial]
    simulated: Mapping[str, _Both]
    """By kind of features."""
    encoder: nn.Module
    cache: Path

    def domains(self, features: str) -> _Domains:
        """Return both worlds seen by some features; real images are looked at once and kept."""
        from taxel.evaluation.camera_trials.simulated_trials import real_rows

        own = self.simulated[features]
        real = real_rows(self.found, features, self.encoder, self.cache)
        return _Domains(
            _learning(real, self.probed.y, self.probed.objects),
            _of_simulated(self.trials, own.plain),
            _of_simulated(self.trials, own.plain, own.changed),
        )


@dataclass(frozen=True, slots=True)
class _Both:
    """Rows of simulated trials, as they are and changed."""

    plain: Rows
    changed: Rows


def sim_to_real_rows(features: str, data: Path | None) -> list[Row]:
    """Learn from simulated trials, alone and beside few or all real objects; test by object.

    Args:
        features: "touch encoder", "gel features" or "grey differences".
        data: Folder that holds gelsight-slip; None says that it is missing.
    """
    from taxel.evaluation.camera_trials.probe import Labelled, commonest
    from taxel.evaluation.camera_trials.simulated_trials import GREY

    study = _study(data)
    if study is None:
        return [missing(f"{NAME}: {features}, simulation alone", "accuracy", "", NO_DATA)]
    probed = study.probed
    rows = _feature_rows(probed, features, study.domains(features))
    if features != GREY:
        return rows
    labelled = Labelled(np.arange(len(probed.y)), probed.y, probed.objects)
    bar = commonest(labelled, probed.split).probabilities
    return [_row(probed, "commonest class", bar[None], ""), *rows]  # once, beside the first


def painted_study_rows(data: Path | None) -> list[Row]:
    """The same from images that the generator of tactile-mnist paints, where its wheel is there."""
    from taxel.evaluation.camera_trials.cycle_gan import WHEEL
    from taxel.training.frames.features import default_cache

    name, wheel = f"{NAME}: CycleGAN images alone", default_cache() / "wheels" / WHEEL
    if not wheel.is_file():
        why = f"no wheels/{WHEEL} in the cache: pip download --no-deps tactile-mnist==0.13"
        return [missing(name, "accuracy", "", why)]
    study = _study(data)
    if study is None:
        return [missing(name, "accuracy", "", NO_DATA)]
    return _painted(study, wheel)


@cache
def _study(data: Path | None) -> _Study | None:
    """Return the study's trials; None without the recordings."""
    if data is None or not (data / "gelsight-slip").exists():
        return None
    from taxel.evaluation.camera_trials.encoder_study import slip_probe_set
    from taxel.evaluation.camera_trials.simulated_trials import choose_trials, simulated_rows
    from taxel.training.encoder.stored import shipped_encoder
    from taxel.windows.camera_trials import read_camera_trials

    found, encoder = read_camera_trials(data / "gelsight-slip"), shipped_encoder()
    folder = _cache(encoder)
    trials = choose_trials(FIRST_CUP, CUPS, MOST, folder)
    plain, copies = simulated_rows(trials, encoder, folder)
    both = {features: _Both(rows, copies[features]) for features, rows in plain.items()}
    return _Study(slip_probe_set(found), found, trials, both, encoder, folder)


def _feature_rows(probed: ProbeSet, feature: str, domains: _Domains) -> list[Row]:
    """Return the rows of one kind of features."""
    from taxel.evaluation.camera_trials.sim_to_real import transfer

    def learnt(
        simulated: Learning | None, objects: int | None, ranking: Ranking = "by domain"
    ) -> Found:
        return transfer(
            simulated, domains.real, probed.split, objects, ranking=ranking,
            draws=DRAWS if objects else 1,
        )  # fmt: skip

    trained = _on_training_objects(probed, domains)
    alone = learnt(domains.simulated, 0)
    rows = [
        _row(probed, f"{feature}, simulation alone", alone, trained["by domain"]),
        _row(probed, f"{feature}, simulation alone, ranks of simulation",
             learnt(domains.simulated, 0, "together"), trained["together"]),
        _row(probed, f"{feature}, simulation alone, with changed copies",
             learnt(domains.changed, 0), "", ("without", alone)),
    ]  # fmt: skip
    for objects in (*FEW, None):
        count = "all" if objects is None else str(objects)
        many = "" if objects == 1 else "s"
        real = learnt(None, objects)
        both = learnt(domains.simulated, objects)
        rows += [
            _row(probed, f"{feature}, {count} real training object{many}", real, ""),
            _row(probed, f"{feature}, simulation and {count} real training object{many}", both,
                 "", ("real alone", real)),
        ]  # fmt: skip
    ends = f"{feature}, simulation and all real training objects"
    return [
        *rows,
        _row(probed, f"{ends}, ranks together", learnt(domains.simulated, None, "together"), "",
             ("real alone", real)),
        _row(probed, f"{ends}, with changed copies", learnt(domains.changed, None), "",
             ("real alone", real)),
    ]  # fmt: skip


def _on_training_objects(probed: ProbeSet, domains: _Domains) -> dict[Ranking, str]:
    """Return what either ranking gives on the training objects, which nothing is chosen by."""
    from taxel.evaluation.camera_trials.sim_to_real import transfer_once
    from taxel.evaluation.rank_area import area

    rankings: tuple[Ranking, ...] = ("by domain", "together")
    found: dict[Ranking, str] = {}
    for ranking in rankings:
        each = []
        for fold in probed.split.folds:
            known = domains.real.part(fold.train_rows)
            probabilities = transfer_once(domains.simulated, None, known.rows, known, ranking)
            each.append(area(known.y, probabilities))
        found[ranking] = f"AUC on the training objects, mean of folds, {np.mean(each):.3f}"
    return found


def _painted(study: _Study, wheel: Path) -> list[Row]:
    """Return what the generator's images are worth, beside our own images of the same crops."""
    from taxel.evaluation.camera_trials.cycle_gan import paint, painted_rows, read_generator
    from taxel.evaluation.camera_trials.sim_to_real import transfer

    probed, trials = study.probed, study.trials
    generator = read_generator(wheel)
    started = process_time()
    paint(generator, np.zeros((2, 120, 160), np.float32))
    spent_s = (process_time() - started) / 2
    chosen_trials = _one_of_each(trials)
    images = painted_rows(
        generator, [trials[at] for at in chosen_trials], MIDDLE_CROP, study.encoder, study.cache,
    )  # fmt: skip
    y = np.array([trials[at].slipped for at in chosen_trials]).astype(np.intp)
    cups = np.array([trials[at].cup for at in chosen_trials])
    rows = []
    for feature, painted in images.items():
        own = study.domains(feature)
        ours = own.simulated.rows.reshape(len(trials), -1, painted.shape[1])[
            chosen_trials, MIDDLE_CROP
        ]
        sets = {"our images": _learning(ours, y, cups), "CycleGAN": _learning(painted, y, cups)}
        for objects, beside in ((0, "alone"), (None, "and all real training objects")):
            probabilities = {
                name: transfer(learning, own.real, probed.split, objects)
                for name, learning in sets.items()
            }
            what = f"{feature}, {len(chosen_trials)} simulated crops {beside}"
            note = f"{2 * 8 * len(chosen_trials)} images, {spent_s:.2f} s of the processor each"
            rows += [
                _row(probed, f"{what}, our images", probabilities["our images"], ""),
                _row(probed, f"{what}, CycleGAN", probabilities["CycleGAN"], note,
                     ("our images", probabilities["our images"])),
            ]  # fmt: skip
    return rows


def _one_of_each(trials: Sequence[SimulatedTrial]) -> NDArray[np.intp]:
    """Return the first trial of each outcome of the first cups."""
    first: dict[tuple[str, bool], int] = {}
    for at, trial in enumerate(trials):
        if trial.run.cup.index - FIRST_CUP < PAINTED_CUPS:
            first.setdefault((trial.cup, trial.slipped), at)
    return np.array(sorted(first.values()), np.intp)


def _row(
    probed: ProbeSet, what: str, found: Found, note: str, than: tuple[str, Found] | None = None
) -> Row:
    from taxel.evaluation.camera_trials.sim_to_real import gain, score_draws

    scores = score_draws(probed.y, found, probed.objects)
    low, high = scores.accuracy_interval
    least, most = scores.auc_interval
    text = (
        f"95 % CI over objects [{low:.3f}, {high:.3f}]; AUC {scores.auc:.3f} "
        f"[{least:.3f}, {most:.3f}]"
    )
    if than is not None:
        more = gain(probed.y, found, than[1], probed.objects)
        text += (
            f"; less {than[0]}: accuracy {more.accuracy:+.3f} [{more.accuracy_interval[0]:+.3f}, "
            f"{more.accuracy_interval[1]:+.3f}], AUC {more.auc:+.3f} "
            f"[{more.auc_interval[0]:+.3f}, {more.auc_interval[1]:+.3f}]"
        )
    text += f"; {note}" if note else ""
    return Row(name=f"{NAME}: {what}", value=scores.accuracy, unit="accuracy",
               note=text)  # fmt: skip


def _learning(rows: Rows, y: NDArray[np.intp], groups: NDArray[np.str_]) -> Learning:
    from taxel.training.camera_trials.learning import Learning

    trial = np.repeat(np.arange(len(y)), len(rows) // len(y))
    return Learning(rows, trial, y, groups, 2)


def _of_simulated(trials: Sequence[SimulatedTrial], *copies: Rows) -> Learning:
    """Return simulated trials, each with the crops of all its copies."""
    y = np.array([trial.slipped for trial in trials]).astype(np.intp)
    each = [rows.reshape(len(trials), -1, rows.shape[1]) for rows in copies]
    together = np.concatenate(each, axis=1)
    cups = np.array([trial.cup for trial in trials])
    return _learning(together.reshape(-1, together.shape[2]), y, cups)


def _cache(encoder: nn.Module) -> Path:
    """Return the folder for what simulated trials show under these versions."""
    from taxel.evaluation.camera_trials import simulated_trials as trials
    from taxel.evaluation.camera_trials.probe_features import gel_features
    from taxel.models.backbones.weight_files import backbone_tensors, tensor_digest
    from taxel.sim.pour.cup_pour import SIM_VERSION
    from taxel.sim.pour.gel_shear_constants import GEL_VERSION
    from taxel.training.frames.features import default_cache
    from taxel.windows.trial_crops import FAMILIES

    what = (
        SIM_VERSION, GEL_VERSION, tensor_digest(backbone_tensors(encoder)), gel_features().key,
        FAMILIES["pixels"].key, trials.SEED, trials.SLIPPED_UM, trials.POSITIONS, trials.FORCES_N,
        trials.KINDS,
    )  # fmt: skip
    return default_cache() / "sim-to-real" / hashlib.sha256(repr(what).encode()).hexdigest()[:16]
