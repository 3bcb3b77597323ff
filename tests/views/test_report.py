"""The page of results: whole, self-contained, honest about splits and about what is missing."""

import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from saved_results import SWEEP, transition_tables

from taxel.bundles.contract import Contract
from taxel.errors import BadInput
from taxel.evaluation.audit.finding import Audit, Finding
from taxel.evaluation.cards.data import DataCard, Nuisance
from taxel.evaluation.cards.latency import NetworkLatency
from taxel.evaluation.run_scores import judge, reliability, split_groups
from taxel.labels.trials import Trial
from taxel.training.curves import Epoch
from taxel.training.environment import Provenance
from taxel.training.loop import TrainConfig
from taxel.training.predictions import Predictions
from taxel.training.run import Run
from taxel.views.report import RunPage, write_run_report
from taxel.views.report.audit_part import read_audit
from taxel.views.report.measured_parts import read_sweep
from taxel.windows.config import TENG_WINDOW
from taxel.windows.scaling import Scaling


class Tags(HTMLParser):
    """Collects tags, and whether each that opens is closed in order."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: list[str] = []
        self.wrong: list[str] = []

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        self.seen.append(tag)
        if tag not in {"meta", "br", "img"}:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: Any) -> None:
        self.seen.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if not self.open or self.open.pop() != tag:
            self.wrong.append(tag)


def make_run(
    model: str = "cnn2d",
    accuracy: float = 0.8,
    *,
    split: str = "session held out",
    leaky: bool = False,
    sessions: int = 3,
) -> Run:
    rng = np.random.default_rng(0)
    classes = ("cylinder", "rectangle", "sphere")
    trials = tuple(
        Trial(
            recording=f"session-{s}.mcap",
            start_s=10.0 * g,
            end_s=10.0 * g + 9.0,
            labels={"shape": classes[g % 3]},
            groups={
                "session": f"session-{s}",
                "object": f"{classes[g % 3]}-<steel>",
                "grasp": f"session-{s}/{g}",
                "temperature_c": f"{20 + s}.5",
                "recording": f"session-{s}",
                "trial": f"session-{s}#{g}",
            },
        )
        for s in range(sessions)
        for g in range(6)
    )
    trial = np.repeat(np.arange(len(trials)), 5)
    y = np.array([t % 6 % 3 for t in trial])
    predicted = np.where(rng.random(len(y)) < accuracy, y, (y + 1) % 3)
    probabilities = np.full((len(y), 3), 0.1)
    probabilities[np.arange(len(y)), predicted] = 0.8
    tested = np.zeros((sessions, len(trials)), int)
    fold = trial // 6 if not leaky else np.arange(len(y)) % sessions
    np.add.at(tested, (fold, trial), 1)
    scaling = Scaling(kind="none", offset=np.zeros(12, np.float32), factor=np.ones(12, np.float32))
    return Run(
        networks=(),
        contract=Contract(
            target="shape",
            classes=classes,
            window=TENG_WINDOW,
            scaling=scaling,
            channels=tuple(f"c{i}" for i in range(12)),
            units=("V",) * 12,
            rate_hz=1000.0,
            model=model,
            parameters=5987,
            data_digest="ab" * 32,
            accuracy={},
            software="taxel",
            parity=None,
        ),
        train=TrainConfig(),
        history=(Epoch(1, 1.1, None, None), Epoch(2, 0.7, None, None)),
        data="nowhere",
        predictions=Predictions(
            split=split,
            classes=classes,
            trials=trials,
            folds=tuple(f"without session-{s}" for s in range(sessions)),
            trained=5 - tested,
            trial=trial,
            start_s=np.arange(len(y)) * 0.12,
            fold=fold,
            y=y,
            probabilities=probabilities,
        ),
        trivial={"majority": 0.34, "channel means": 0.6},
        made=Provenance(command="taxel train 'my data' --output r", environment={"torch": "2"}),
    )


CARD = DataCard(
    recordings=3,
    hours=0.5,
    megabytes=2.0,
    sensors={"teng": "12 channels in V"},
    details={"wiring": "three-boards"},
    classes={"shape": {"sphere": 4}},
    groups={"session": 3},
    nuisances=(Nuisance(name="temperature_c", values=(20.5, 21.5, 33.0)),),
    lost="0 of 10 scans lost",
    written="taxel 0.1.0",
    digest="ab" * 32,
)
AUDIT = Audit(
    data="data",
    kind="array",
    target="shape",
    classes={"sphere": 4},
    split="session held out",
    read_on="session held out",
    findings=(
        Finding(kind="length", verdict="leak", message="The length tells it.", alone=0.9, p=0.01),
        Finding(kind="order", verdict="clear", message="Nothing."),
    ),
)


def page_of(tmp_path: Path, **parts: Any) -> str:
    path = tmp_path / "report.html"
    write_run_report(path, RunPage(**parts))
    return path.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A page with every part."""
    return page_of(
        tmp_path_factory.mktemp("page"),
        runs={"first & only": make_run(), "second": make_run("cnn1d", 0.5)},
        card=CARD,
        audits=[AUDIT],
        latencies={
            "second": NetworkLatency(
                median_ms=0.02, p95_ms=0.03, p99_ms=0.04, kilobytes=80, calls=500
            )
        },
        sweeps={"s.json": read_sweep(SWEEP, "s.json")},
        tables={"t.json": transition_tables()},
        made=Provenance(command="taxel report r"),
    )


def test_an_interval_over_few_sessions_is_said_to_be_narrow(tmp_path: Path):
    narrow = "sessions: the interval is about their lowest and highest; record more."
    assert f"3 {narrow}" in page_of(tmp_path, runs={"few": make_run()})
    assert narrow not in page_of(tmp_path, runs={"many": make_run(sessions=6)})


def test_the_page_needs_no_script_and_no_other_file(whole: str):
    assert "<script" not in whole
    assert not re.findall(r"""(?:src|href)=["'](?!#|data:)""", whole)
    assert "@import" not in whole
    assert "url(" not in whole


def test_every_tag_of_the_page_is_closed(whole: str):
    tags = Tags()
    tags.feed(whole)

    assert tags.wrong == []
    assert tags.open == []
    assert {"table", "svg", "figure", "nav"} <= set(tags.seen)


def test_every_link_at_the_head_leads_to_a_part(whole: str):
    links = re.findall(r'href="#([^"]+)"', whole)

    assert len(links) >= 9
    assert all(f'<h2 id="{link}"' in whole for link in links)


def test_the_page_says_what_must_stand_beside_an_accuracy(whole: str):
    for part in (
        "session held out",
        "best baseline: ",
        "95 % CI over sessions, %",
        "Expected calibration error",
        "thesis",
        "temperature_c",
        "Looked for and not found: order",
        "The length tells it.",
        "smallest possible",
        "40,460",
        "taxel train &#x27;my data&#x27; --output r",
        "taxel report r",
    ):
        assert part in whole, part


def test_names_are_escaped(whole: str):
    assert "first &amp; only" in whole
    assert "<steel>" not in whole


def test_published_values_stand_beside_the_thesis_recipe_only(tmp_path: Path):
    from dataclasses import replace

    run = make_run()
    other = replace(run, contract=replace(run.contract, window=replace(TENG_WINDOW, stride=6)))

    assert "Beside the thesis" in page_of(tmp_path, runs={"r": run})
    assert "Beside the thesis" not in page_of(tmp_path, runs={"r": other})


def test_a_run_below_a_trivial_baseline_is_said_to_be(tmp_path: Path):
    assert "is no better than the baseline “channel means”" in page_of(
        tmp_path, runs={"weak": make_run(accuracy=0.4)}
    )
    few = page_of(tmp_path, runs={"good": make_run(accuracy=0.99)})
    assert "with 3 sessions no difference can be claimed" in few
    assert "stands clear of every baseline" in page_of(
        tmp_path, runs={"good": make_run(accuracy=0.99, sessions=6)}
    )


def test_baselines_of_one_split_are_not_held_against_a_run_of_another(tmp_path: Path):
    from dataclasses import replace

    honest = make_run(accuracy=0.7)
    leaky = make_run(accuracy=0.9, split="random windows (leaks)", leaky=True)
    leaky = replace(leaky, trivial={"session": 0.95})

    page = page_of(tmp_path, runs={"honest": honest, "leaky": leaky})

    assert "honest is no better" not in page
    assert "leaky is no better than the baseline “session” (95.0 %)" in page


def test_a_split_with_trials_on_both_sides_is_marked(tmp_path: Path):
    leaky = make_run(split="random windows (leaks)", leaky=True)

    page = page_of(tmp_path, runs={"r": leaky})

    assert '<span class="leaks">random windows (leaks)</span>' in page
    assert 'class="both"' in page
    assert "trial (18 of 18)" in page


def test_a_session_split_has_no_session_on_both_sides(tmp_path: Path):
    page = page_of(tmp_path, runs={"r": make_run()})

    assert "On both sides of a fold: object (3 of 3)." in page


def test_a_group_may_be_named_with_a_raised_number(tmp_path: Path):
    """A ² is a digit to some, and no number."""
    from dataclasses import replace

    run = make_run()
    assert run.predictions is not None
    trials = tuple(
        replace(trial, groups={**trial.groups, "session": f"{trial.groups['session']}²"})
        for trial in run.predictions.trials
    )

    run = replace(run, predictions=replace(run.predictions, trials=trials))

    assert "²</th>" in page_of(tmp_path, runs={"r": run})


def test_recordings_of_another_digest_are_warned_of(tmp_path: Path):
    from dataclasses import replace

    page = page_of(tmp_path, runs={"r": make_run()}, card=replace(CARD, digest="cd" * 32))

    assert "not those of the run" in page


def test_a_run_without_predictions_still_gives_a_page(tmp_path: Path):
    from dataclasses import replace

    page = page_of(tmp_path, runs={"old": replace(make_run(), predictions=None, trivial={})})

    assert "not at hand" in page
    assert '<h2 id="results"' not in page


def test_runs_that_cannot_be_compared_say_why_on_the_page(tmp_path: Path):
    from dataclasses import replace

    run = make_run()
    assert run.predictions is not None
    moved = replace(
        run, predictions=replace(run.predictions, fold=run.predictions.fold[::-1].copy())
    )

    assert "same folds" in page_of(tmp_path, runs={"a": run, "b": moved})


def test_an_audit_comes_back_from_its_json():
    from dataclasses import asdict

    assert read_audit(asdict(AUDIT) | {"verdict": AUDIT.verdict}, "a.json") == AUDIT
    with pytest.raises(BadInput, match=r"a\.json"):
        read_audit([1], "a.json")
    with pytest.raises(BadInput, match=r"a\.json"):
        read_audit(asdict(AUDIT) | {"classes": ["sphere"]}, "a.json")


def test_reliability_of_honest_probabilities_lies_on_the_diagonal():
    rng = np.random.default_rng(0)
    sure = rng.uniform(0.5, 1.0, 20_000)
    found = reliability(np.stack([sure, 1 - sure], axis=1), rng.random(20_000) < sure)

    assert [bin_.windows for bin_ in found] == pytest.approx([4000] * 5, rel=0.1)
    assert all(abs(bin_.confidence - bin_.accuracy) < 0.03 for bin_ in found)


def test_groups_to_draw_are_few_and_no_measured_figures():
    predictions = make_run().predictions
    assert predictions is not None

    assert split_groups(predictions) == ["session", "object"]


def test_scores_of_a_run_know_every_session_once():
    predictions = make_run().predictions
    assert predictions is not None
    own = judge(predictions)

    assert sum(group.windows for group in own.by_group) == len(predictions)
    assert own.scores.accuracy == pytest.approx(
        sum(group.accuracy * group.windows for group in own.by_group) / len(predictions)
    )
    assert own.intervals["session"].groups == 3
