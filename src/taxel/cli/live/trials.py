"""What `taxel live` does with a bundle of camera trials: a verdict that builds up."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from rich.text import Text

from taxel.cli.live.trained_trials import is_table, trained_on_warning
from taxel.cli.printing import console, print_json, say
from taxel.cli.recordings.recording import SUMMARY_FOLLOWS, stop_signals
from taxel.decisions.recognition import UNKNOWN
from taxel.plain_text import number_of, visible, visible_line

if TYPE_CHECKING:
    from taxel.actions.rule_table import RuleTable
    from taxel.bundles.signing import Trust
    from taxel.bundles.trials import TrialBundle, TrialContract
    from taxel.live.trial_session import TrialTally
    from taxel.live.trial_watch import TrialAnswer
    from taxel.sources.contract import Source


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

    opened = read_trial_bundle(bundle, trust, device)
    total: TrialTally | None = None
    _check_cameras(opened.contract, source)
    if opened.contract.crop == 1 and not as_json:
        say("note: trials of 1 frame: pictures alone, no motion")
    with stop_signals(SUMMARY_FOLLOWS) as stopped:
        for name, open_trial in _trials(source, opened.contract):
            if name and not as_json:
                say(f"{visible(name)}:")
            with open_trial() as found:
                tally = run_trial_session(
                    found, opened, seconds, least_confidence,
                    _nothing if as_json else _shown(opened, rules), rules, stopped=stopped,
                )  # fmt: skip
            for trial in tally.trials:
                trial["trial"] = name or None
            if total is None:
                total = tally
            else:
                total.take_in(tally)
            if stopped():
                break
    assert total is not None
    summary = total.summary()
    summary["warning"] = trained_on_warning(opened.contract, source) if summary["marked"] else None
    if as_json:
        print_json(summary)
        return
    say(
        f"{len(total.trials)} trial{'' if len(total.trials) == 1 else 's'}, {summary['unknown']} "
        f"UNKNOWN; {summary['right']}/{summary['marked']} as the source's own labels say"
    )
    if summary["warning"] is not None:
        say(f"warning: {summary['warning']}", style="yellow")
    if total.looks_s:
        step = opened.contract.layout.every
        every = "frame" if step == 1 else f"{step} frames"
        say(
            f"a look at a crop: median {summary['look_ms_median']:.0f} ms, at most "
            f"{summary['look_ms_max']:.0f} ms, each {every}"
        )


def _check_cameras(contract: TrialContract, source: str) -> None:
    """Refuse recordings of other cameras, before the first is replayed.

    Raises:
        BadBundle: There is one.
        BadTable: The source is a video or an image, which belongs in a table.
    """
    from taxel.errors import BadBundle
    from taxel.recordings.reader import read_manifest
    from taxel.sources.opening import replayed_files
    from taxel.windows.camera_trials import refuse_footage

    given = Path(source.removeprefix("replay://"))
    if given.exists() and not is_table(given):
        refuse_footage(given)
    for file in () if is_table(Path(source)) else replayed_files(source):
        manifest = read_manifest(file)
        found = len(manifest.tactile)
        if found != contract.cameras:
            array = f" and an array of {number_of(len(manifest.sensor.channels), 'channel')}"
            raise BadBundle(
                f"recordings of {number_of(contract.cameras, 'tactile camera')}",
                f"{file}, which holds {found}{array if manifest.sensor.channels else ''}",
                "name recordings of such trials, or train a bundle on trials like these",
            )
        try:
            contract.check(
                [camera.name for camera in manifest.tactile],
                [(camera.width, camera.height) for camera in manifest.tactile],
                [camera.rate_hz for camera in manifest.tactile],
            )
        except BadBundle as error:
            raise BadBundle(error.needed, f"{error.got} in {file}", error.mend) from error


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


def _trials(source: str, contract: TrialContract) -> list[tuple[str, Callable[[], Source]]]:
    """Return each trial's name and what opens it; the name is empty for another source.

    Raises:
        BadBundle: A table's trial is of other cameras than the bundle's.
    """
    from taxel.live.trial_replay import TrialReplay
    from taxel.live.whole_trials import check_trials
    from taxel.sources.opening import open_source, recordings_of, replayed_files
    from taxel.windows.camera_trials import read_camera_trials

    path = Path(source)
    if is_table(path):
        trials = read_camera_trials(path)
        check_trials(contract, trials)
        return [(trial.name, partial(TrialReplay, trial)) for trial in trials]
    addresses = recordings_of(f"replay://{path}?speed=max" if path.is_dir() else source)
    names = [""]
    if addresses != [source]:  # a folder
        names = [file.stem for file in replayed_files(source)]
    return [
        (name, partial(open_source, address))
        for name, address in zip(names, addresses, strict=True)
    ]
