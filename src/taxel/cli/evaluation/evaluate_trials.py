"""`taxel evaluate-trials`: how well camera trials are recognised, beside bars and controls."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import tyro

from taxel.cli.evaluation.trial_alarm import AlarmStudy
from taxel.cli.long_work import LongWork
from taxel.cli.options.rules import Only
from taxel.cli.options.trials import FOLDS_IN_TURN, TrialOptions
from taxel.cli.printing import command, console, print_json, progress, say
from taxel.errors import BadInput
from taxel.plain_text import noun_of, visible_line

if TYPE_CHECKING:
    from taxel.bundles.trials import TrialContract
    from taxel.decisions.trial_verdict import Verdict
    from taxel.evaluation.camera_trials.sides import Groups
    from taxel.evaluation.fold_table import FoldTable
    from taxel.windows.camera_trials import CameraTrial


@dataclass(frozen=True, kw_only=True)
class EvaluateTrials:
    """Measure a recogniser of camera trials on trials it has not seen, beside baselines.

    The first PATH is a table (CSV) with one row for each trial, or a folder of recordings of
    tactile cameras. The table's columns: left and right, or camera:NAME for each camera (a video,
    an image or a folder of images); label:NAME; group:NAME; and, where wanted, split.
    """

    trials: tyro.conf.Positional[Path]
    """A table of camera trials or a folder of recordings; or a bundle, to be scored on the
    second PATH."""
    data: tyro.conf.Positional[Path | None] = None
    """With a bundle: the trials that it is scored on; with --folds TABLE only those that the table
    tests, which has one test part."""
    alarm: str | None = None
    """With a bundle: also report, for this class and several least confidences, in how many trials
    a station would raise an alarm while they run, and when. Takes about as long as replaying
    them does."""
    json: bool = False
    """Print JSON."""
    options: Annotated[TrialOptions, tyro.conf.arg(name="")] = field(default_factory=TrialOptions)

    RULES: ClassVar = (
        Only(
            (
                "target",
                "split",
                "test",
                "fold-count",
                "crop",
                "part",
                "touch",
                "network",
                "cache",
                "seed",
            ),
            "trials without a bundle (it is scored as it is)",
            lambda verb: verb.data is None,
        ),
        Only(
            ("alarm",),
            "a bundle and trials to score it on",
            lambda verb: verb.data is not None,
        ),
        FOLDS_IN_TURN,
    )

    def run(self) -> None:
        """Measure and print."""
        from taxel.bundles.envelope import is_trial_bundle, kind_of

        if self.trials.is_file() and is_trial_bundle(self.trials):
            self._score_bundle()
            return
        if self.data is not None and kind_of(self.trials) == "grasp":
            watch = command("taxel", "live", self.trials, "replay://RECORDING.mcap")
            raise BadInput("a bundle of camera trials", f"{self.trials}, which watches a grasp",
                           f"replay a recording: {watch}; or see taxel sweep")  # fmt: skip
        if self.data is not None and kind_of(self.trials):
            other = command("taxel", "evaluate", self.trials, self.data)
            raise BadInput("a bundle of camera trials", f"{self.trials}, a bundle of another kind",
                           f"run: {other}")  # fmt: skip
        if self.data is not None:
            raise self._no_bundle(self.data)
        from taxel.evaluation.camera_trials.contenders import contenders_for
        from taxel.evaluation.camera_trials.crossval import difference, judge_trials, rivals
        from taxel.views.tables.trial_notes import control_warnings
        from taxel.views.tables.trials import trial_json, trial_tables

        with self.options.work.open(), progress() as bar:
            work = LongWork(bar)
            cut, split, _ = self.options.load(self.trials, work)
            trials = cut.usual
            results = judge_trials(
                trials, split, self.options.seed, contenders_for(trials),
                partial(work.step, "training"), cut.sides,
            )  # fmt: skip
            differences = [
                difference(trials, split, results[0], other) for other in rivals(results)
            ]
        if self.json:
            print_json(trial_json(trials, split, results, differences, cut))
            return
        console.print(trial_tables(trials, split, results, differences, cut))
        for warning in control_warnings(results):
            say(f"warning: {warning}", style="yellow")

    def _no_bundle(self, data: Path) -> BadInput:
        """Return what is said of a first word that is no bundle, where a second one is given."""
        from taxel.bundles.envelope import need_bundle
        from taxel.bundles.shipped import shipped_like

        if (self.trials / "recogniser.taxel").is_file():
            need_bundle(self.trials)
        if not self.trials.exists():
            name = shipped_like(self.trials) or "recogniser.taxel in a run of taxel train-trials"
            return BadInput("a bundle's file", f"{self.trials}, which is not there", f"name {name}")
        got = f"{self.trials}, which is no bundle, and {data}"
        return BadInput("one data set, or a bundle and a data set", got, "leave one out")

    def _score_bundle(self) -> None:
        from taxel.bundles.trials import read_trial_bundle
        from taxel.bundles.versions import digest_of
        from taxel.evaluation.camera_trials.learned_trials import trained_on
        from taxel.live.whole_trials import predict_side_by_side
        from taxel.views.tables.trained_on import trained_on_line
        from taxel.views.tables.trial_notes import frames_note
        from taxel.views.tables.trials import not_scored_line, unknown_line

        if self.data is None:
            raise BadInput("trials to score the bundle on", "none", "name them behind the bundle")
        digest = digest_of(self.trials)
        bundle = read_trial_bundle(self.trials)
        trials, table = _scored_trials(self.data, self.options.folds)
        study = None
        if self.alarm is not None:
            study = AlarmStudy(
                label=self.alarm, contract=bundle.contract, trials=trials,
                group_of=partial(_resampled, table=table),
            )  # fmt: skip
        with self.options.work.open(), progress() as bar:
            work = LongWork(bar)
            at = partial(work.at, "trials")
            verdicts = predict_side_by_side(bundle, (self.trials, digest), trials, at)
            at = partial(work.at, "trials watched as live")
            alarms = None if study is None else study.watched((self.trials, digest), at)
        warning = trained_on_line(
            trained_on(bundle.contract, trials), "trials", known=bool(bundle.contract.learned)
        )
        crop = bundle.contract.crop
        note = frames_note([max(crop, t.frames) for t in trials], crop)
        target, classes = bundle.contract.target, bundle.contract.classes
        truth = [trial.labels.get(target, "") for trial in trials]
        left_out = not_scored_line(target, truth, classes)
        line, scores = _scores(bundle.contract, trials, verdicts, table)
        if self.json:
            beside: dict[str, Any] = {"warning": warning, "not_scored": left_out, "note": note}
            beside["alarms"] = None if alarms is None else alarms.record()
            print_json({"bundle": str(self.trials), **scores, **beside})
            return
        say(line)
        if alarms is not None:
            console.print(alarms.table())
        if note is not None:
            say(f"note: {note}")
        if left_out:
            say(f"warning: {left_out}", style="yellow")
        if scores["few_groups"]:
            say(f"warning: {visible_line(scores['few_groups'])}", style="yellow")
        if reasons := unknown_line(verdicts):
            say(reasons, style="yellow")
        if warning is not None:
            say(f"warning: {warning}", style="yellow")


def _scores(
    contract: TrialContract,
    trials: Sequence[CameraTrial],
    verdicts: Sequence[Verdict],
    table: FoldTable | None,
) -> tuple[str, dict[str, Any]]:
    """Return a bundle's score as a line, and as plain values with each trial's verdict.

    Args:
        contract: What the bundle predicts.
        trials: Those that were scored.
        verdicts: What the bundle says of each.
        table: The table of folds whose test part they are; None where all are scored.
    """
    import numpy as np

    from taxel.decisions.recognition import UNKNOWN
    from taxel.evaluation.camera_trials.crossval import score_trials
    from taxel.evaluation.camera_trials.sides import values_of
    from taxel.evaluation.intervals import all_alike
    from taxel.evaluation.run_scores import few_groups
    from taxel.views.tables.trials import score_line, trial_count

    target, classes = contract.target, contract.classes
    truth = [trial.labels.get(target, "") for trial in trials]
    known = [i for i, own in enumerate(truth) if own in classes]
    labelled = [i for i in known if np.isfinite(verdicts[i].confidence)]
    document: dict[str, Any] = {
        "target": target,
        "split": None if table is None else table.split,
        "trials": len(trials),
        "unknown": sum(verdict.label == UNKNOWN for verdict in verdicts),
        "majority": None,
        "scores": None,
        "answered_accuracy": None,
        "few_groups": None,
        "verdicts": [
            {"trial": t.name, "truth": own, "verdict": v.label, "confidence": v.confidence,
             "reason": v.reason}
            for t, own, v in zip(trials, truth, verdicts, strict=True)
        ],
    }  # fmt: skip
    where = "" if table is None else f" · test part of {table.split}"
    if not labelled:
        count = trial_count(len(trials))
        why = f"none has a {target} that the bundle knows"
        if known:
            why = f"none of those whose {target} the bundle knows has a probability"
        return f"{count}{where}; {why}", document
    groups = [trials[i].groups for i in labelled]
    key = _resampled(groups, table)
    names = values_of(groups, key) if key else np.array([trials[i].name for i in labelled])
    y = np.array([classes.index(truth[i]) for i in labelled])
    majority = float(np.bincount(y).max() / len(y))
    scores = score_trials(y, np.stack([verdicts[i].probabilities for i in labelled]), names)
    answered = float(np.mean([verdicts[i].label == truth[i] for i in known]))
    document |= {"majority": majority, "scores": asdict(scores), "answered_accuracy": answered}
    tested = len(set(names.tolist()))
    if tested > 1 and not all_alike(scores.accuracy_interval):
        document["few_groups"] = few_groups(noun_of(key or "trial"), tested)
    return (
        f"{score_line(target, where, scores, majority, key)}; UNKNOWN {document['unknown']} of "
        f"{len(trials)}; accuracy with UNKNOWN counted as wrong {answered:.3f}"
    ), document


def _scored_trials(data: Path, folds: Path | None) -> tuple[list[CameraTrial], FoldTable | None]:
    """Return the trials that a bundle is scored on: all, or those that a table tests."""
    from taxel.evaluation.camera_trials.sides import trials_to_score
    from taxel.evaluation.fold_table import read_fold_table
    from taxel.windows.camera_trials import read_camera_trials

    table = None if folds is None else read_fold_table(folds, to_score=True)
    trials = read_camera_trials(data)
    if table is None:
        return trials, None
    tested = trials_to_score([own.name for own in trials], [own.groups for own in trials], table)
    return [trials[at] for at in tested], table


def _resampled(groups: Groups, table: FoldTable | None) -> str | None:
    """Return the group to resample for intervals: what the table holds out, else the usual one."""
    from taxel.evaluation.camera_trials.sides import interval_group

    if table is not None and table.rows[0].key != "recording":
        return table.rows[0].key
    return interval_group(groups)
