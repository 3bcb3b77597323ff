"""What `taxel train` does where no recipe is named: find the recogniser, judge it, keep it."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from taxel.cli.options.arrays import check_run_folder, only_label, split_given
from taxel.cli.printing import command, console, print_json, progress, say, say_aside
from taxel.errors import BadInput
from taxel.held import only_writer
from taxel.plain_text import visible, visible_names

if TYPE_CHECKING:
    from taxel.evaluation.expert import Expert
    from taxel.evaluation.outer_split import OuterSplit

CHOICE = "expert.json"
"""Beside a run's weights: what was chosen, for --like."""


@dataclass(frozen=True, kw_only=True)
class ExpertOptions:
    """What the verb passes on."""

    data: Path
    output: Path | None
    target: str | None
    split: str | None
    folds: Path | None
    test: Path | None
    fold_count: int
    usual_folds: int
    """How many there are where nobody says it."""
    minutes: float
    max_mb: float
    max_us: float
    like: Path | None
    reject_novel: float | None
    check: bool
    seed: int = 0
    json: bool = False


def train_default(options: ExpertOptions) -> None:
    """Choose, judge, train, write the run and print all of it."""
    from taxel.evaluation.expert import Task, train_expert
    from taxel.training.choose.choice import read_choice, write_choice
    from taxel.training.choose.kept_tries import tries_folder
    from taxel.training.choose.limits import Limits
    from taxel.training.run import save_run

    for name in ("minutes", "max_mb", "max_us"):
        if not getattr(options, name) > 0:
            option = f"--{name.replace('_', '-')}"
            raise BadInput(f"{option} above 0", f"{getattr(options, name):g}", "give more")
    like = None if options.like is None else read_choice(options.like)
    target = options.target or (like.target if like is not None else only_label(options.data))
    output = options.output or Path("runs") / f"{options.data.resolve().name}-{target}"
    check_run_folder(output)
    older = output.exists()
    if older and not (output / CHOICE).exists():
        say_aside(replaced_note(output, "the run of a recipe"))
    with only_writer(output):
        with progress() as bar:
            task = bar.add_task("starting", total=None)
            expert = train_expert(
                Task(
                    data=options.data,
                    target=target,
                    split=outer_split(
                        options.split,
                        options.folds,
                        options.test,
                        options.fold_count,
                        options.seed,
                    ),
                    test=options.test,
                    check=options.check,
                ),
                Limits(minutes=options.minutes, most_mb=options.max_mb, most_us=options.max_us),
                like=like,
                reject_novel=options.reject_novel,
                seed=options.seed,
                tries=tries_folder(output),
                on_step=lambda line: bar.update(task, description=line, advance=1),
            )
        save_run(output, expert.run)
        write_choice(output / CHOICE, expert.choice)
    if options.json:
        print_json(expert_json(expert, output) | {"replaced": older})
        return
    from taxel.views.tables.expert import expert_report

    console.print(expert_report(expert))
    say(
        f"{output}{', replaced' if older else ''}: predicts {visible(target)}: "
        f"{visible_names(expert.run.contract.classes)}"
    )
    say(f"next: {command('taxel', 'bundle', output, '--output', f'{output}.taxel')}")
    say(f"same again: {command(*_same_again(options, output / CHOICE))}")


def replaced_note(output: Path, older: str) -> str:
    """Return what is said, before the work, where a run of another kind has the same place."""
    return f"note: {output}, {older}, will be replaced; to keep it, choose another --output"


def _same_again(options: ExpertOptions, choice: Path) -> list[object]:
    """Return the words that train by the choice and measure as this did."""
    words: list[object] = ["taxel", "train", options.data, "--like", choice]
    for name in ("split", "folds", "test"):
        if (given := getattr(options, name)) is not None:
            words += [f"--{name}", given]
    if options.fold_count != options.usual_folds:
        words += ["--fold-count", options.fold_count]
    if options.reject_novel is not None:
        words += ["--reject-novel", options.reject_novel]
    if options.seed:
        words += ["--seed", options.seed]
    return words if options.check else [*words, "--no-check"]


def outer_split(
    split: str | None, folds: Path | None, test: Path | None, fold_count: int, seed: int
) -> OuterSplit:
    """Return what the outer folds are made by, from the options of these names.

    Raises:
        BadInput: More than one split is given, or too few folds.
    """
    from taxel.evaluation.outer_split import OuterSplit

    if fold_count < 2:
        raise BadInput("at least two folds", str(fold_count), "choose more folds")
    given = split_given(split, folds, test)
    return OuterSplit(named=split, given=given, folds=fold_count, seed=seed)


def expert_json(expert: Expert, output: Path) -> dict[str, Any]:
    """Return what --json prints."""
    from taxel.training.choose.choice import as_record

    document: dict[str, Any] = {
        "run": str(output),
        "target": expert.choice.target,
        "classes": expert.run.contract.classes,
        "choice": as_record(expert.choice),
        "bundle": asdict(expert.measured),
        "given_up": expert.given_up,
        "notes": expert.notes,
    }
    nested = expert.nested
    if nested is not None:
        everyone = {"default": (nested.scores, nested.by_trial), **nested.bars}
        document["nested"] = {
            "split": nested.split,
            "folds": len(nested.choices),
            "windows": len(nested.predictions),
            "trials": nested.by_trial.trials,
            "fixed": nested.fixed,
            "trivial": nested.trivial,
            "warning": nested.warning,
            "scores": {
                name: {
                    "accuracy": own.scores.accuracy,
                    "loss": own.scores.loss,
                    "calibration_error": own.calibration_error,
                    "by_trial": asdict(trials),
                }
                for name, (own, trials) in everyone.items()
            },
        }
    return document
