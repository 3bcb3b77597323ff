"""Claims about `train`'s last line: what it prints measures as it did."""

from dataclasses import replace
from pathlib import Path

from taxel.cli.training.train_expert import ExpertOptions, _same_again

USUAL = ExpertOptions(
    data=Path("d"), output=None, target=None, split=None, folds=None, test=None, fold_count=5,
    usual_folds=5, minutes=5.0, max_mb=20.0, max_us=2000.0, like=None, reject_novel=None,
    check=True,
)  # fmt: skip


def command(**changes: object) -> str:
    return " ".join(map(str, _same_again(replace(USUAL, **changes), Path("r/expert.json"))))  # type: ignore[arg-type]


def test_the_split_the_folds_and_the_seed_are_named_again():
    """Without them `--like` held out sessions, whatever had been held out before."""
    assert command() == "taxel train d --like r/expert.json"
    assert command(split="group:object", fold_count=4, seed=3).endswith(
        "--like r/expert.json --split group:object --fold-count 4 --seed 3"
    )
    assert command(folds=Path("f.csv")).endswith("--folds f.csv")
    assert command(test=Path("t"), target="shape", max_us=9.0).endswith("expert.json --test t")
    assert command(reject_novel=0.05).endswith("expert.json --reject-novel 0.05")
    assert command(check=False).endswith("expert.json --no-check")
