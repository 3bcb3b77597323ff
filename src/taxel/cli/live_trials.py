"""What `taxel live` does with a bundle of camera trials: a verdict that builds up."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from rich.text import Text

from taxel.cli.printing import console, print_json, say
from taxel.decisions.recognition import UNKNOWN
from taxel.plain_text import visible, visible_line

if TYPE_CHECKING:
    from taxel.actions.rule_table import RuleTable
    from taxel.bundles.signing import Trust
    from taxel.bundles.trials import TrialBundle
    from taxel.live.trial_session import TrialTally
    from taxel.live.trial_watch import TrialAnswer


def live_trials(
    bundle: Path,
    source: str,
    seconds: float | None,
    least_confidence: float,
    *,
    as_json: bool,
    trust: Trust | None = None,
    rules: RuleTable,
    device: str,
) -> None:
    """Watch a source, or replay a folder or a table of trials; print verdicts, then a summary."""
    from taxel.bundles.trials import read_trial_bundle
    from taxel.live.trial_session import run_trial_session
    from taxel.sources.opening import open_source

    opened = read_trial_bundle(bundle, trust, device)
    total: TrialTally | None = None
    with _addresses(source) as addresses:
        for name, address in addresses:
            if name and not as_json:
                say(f"{visible(name)}:")
            with open_source(address) as found:
                tally = run_trial_session(
                    found, opened, seconds, least_confidence,
                    _nothing if as_json else _shown(opened, rules), rules,
                )  # fmt: skip
            for trial in tally.trials:
                trial["trial"] = name or None
            if total is None:
                total = tally
            else:
                total.trials += tally.trials
                total.looks_s += tally.looks_s
    assert total is not None
    result = total.summary()
    if as_json:
        print_json(result)
        return
    say(
        f"{len(total.trials)} trial{'' if len(total.trials) == 1 else 's'}, {result['unknown']} "
        f"UNKNOWN; {result['right']}/{result['marked']} as the source's own labels say"
    )
    if total.looks_s:
        say(
            f"a look at a crop: median {result['look_ms_median']:.0f} ms, at most "
            f"{result['look_ms_max']:.0f} ms, each {opened.contract.layout.every} frames"
        )


def _shown(bundle: TrialBundle, rules: RuleTable) -> Callable[[TrialAnswer, bool], None]:
    first_s: list[float] = []

    def show(answer: TrialAnswer, changed: bool) -> None:
        first_s[:] = first_s or [answer.time_s]
        if not changed:
            return
        verdict = answer.verdict
        words = f"  {visible_line(verdict.reason)}" if verdict.reason else ""
        sure = "" if verdict.label == UNKNOWN else f" {verdict.confidence:.2f}"
        action = rules.action(bundle.contract.target, verdict.label, verdict.confidence)
        words += f"  → {visible_line(action)}" if action else ""
        when = "whole trial" if answer.last else f"{answer.time_s - first_s[0]:8.2f} s"
        console.print(
            Text.assemble(
                f"{when:>11}  {visible(bundle.contract.target)}: ",
                (visible(verdict.label), "dim" if verdict.label == UNKNOWN else "bold"),
                f"{sure}  ({verdict.crops} crop{'' if verdict.crops == 1 else 's'}){words}",
            ),
            soft_wrap=True,
        )

    return show


def _nothing(answer: TrialAnswer, changed: bool) -> None:
    """Show nothing."""


@contextmanager
def _addresses(source: str) -> Iterator[list[tuple[str, str]]]:
    """Give each trial's name and address; a table's videos are imported to be replayed."""
    from taxel.recordings.reader import list_recordings
    from taxel.windows.camera_trials import TABLES

    path = Path(source)
    if path.is_dir():
        yield [(file.stem, f"replay://{file}?speed=max") for file in list_recordings(path)]
    elif path.suffix.lower() in TABLES and path.is_file():
        from taxel.recordings.video_rows import read_video_rows
        from taxel.recordings.videos import import_videos

        with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
            rows = read_video_rows(path, path.parent)
            made = import_videos(rows, Path(scratch) / "trials")
            yield [(file.stem, f"replay://{file}?speed=max") for file in made]
    else:
        yield [("", source)]
