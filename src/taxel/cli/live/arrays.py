"""What `taxel live` does with bundles of an array in one process: answers, then a summary.

Knows nothing about cameras, pages, recordings or grippers: see `trials`, `grasps` and `station`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from taxel.cli.live.summaries import answers_lines
from taxel.cli.printing import console, print_json, say, say_aside
from taxel.cli.recordings.recording import SUMMARY_FOLLOWS, stop_signals
from taxel.errors import TaxelError
from taxel.plain_text import number_of, visible

if TYPE_CHECKING:
    from taxel.actions.rule_table import RuleTable
    from taxel.bundles.reader import Bundle
    from taxel.bundles.signing import Trust
    from taxel.calibration.live import LiveNewtons
    from taxel.live.outages import Outage
    from taxel.live.rate_watch import RateChange
    from taxel.live.recogniser import Recogniser
    from taxel.live.session import Tally
    from taxel.signals import Samples
    from taxel.sources.contract import Source


@dataclass(frozen=True, kw_only=True)
class ArrayOptions:
    """What `taxel live` was asked for, where bundles of an array run in the terminal."""

    files: tuple[Path, ...]
    """The bundles; each is given the same samples."""
    source: str
    """Address of a source, or a folder of recordings that are replayed one after another."""
    seconds: float | None
    """Longest time of each recording or source, by its own clock; None for no limit."""
    least_confidence: float
    """Probability below which an answer is UNKNOWN, 0…1."""
    trust: Trust | None
    """Keys of which one must have signed each bundle; None where no signature is needed."""
    rules: RuleTable
    """What is to be done about each answer."""
    device: str
    """Where the models run, such as "cpu"."""
    calibration: Path | None
    """Calibration of the array, by which the screen shows newtons; None for volts."""
    json: bool
    """Print the summaries as JSON."""


def live_arrays(options: ArrayOptions) -> None:
    """Predict from a source until it ends or is stopped; print a summary for each bundle."""
    from taxel.bundles.reader import read_bundle

    bundles = [
        read_bundle(file, trust=options.trust, device=options.device) for file in options.files
    ]
    results = [
        {"bundle": str(file)} | tally.summary()
        for file, tally in zip(options.files, _run(options, bundles), strict=True)
    ]
    for result, bundle in zip(results, bundles, strict=True):
        result["warning"] = (
            _trained_on_warning(bundle, options.source) if result["marked"] else None
        )
    if options.json:
        print_json(results)
        return
    for line, result in zip(answers_lines(results), results, strict=True):
        say(line)
        for text, style in _summary_lines(result):
            say(f"  {text}", style=style)


def _run(options: ArrayOptions, bundles: Sequence[Bundle]) -> list[Tally]:
    """Run every recording of the source; return each bundle's counts over all of them."""
    from taxel.decisions.recognition import RecogniseConfig
    from taxel.live.recogniser import Recogniser, SessionLevels, scale_watch_of, still_watch_of
    from taxel.recordings.reader import read_manifest
    from taxel.sources.opening import open_source, recordings_of, replayed_files

    config = RecogniseConfig(least_confidence=options.least_confidence)
    totals: list[Tally] = []
    levels = [SessionLevels(bundle.contract) for bundle in bundles]
    # What has stopped, or is in another unit, may show over several short recordings only.
    scales = [scale_watch_of(bundle.contract) for bundle in bundles]
    stills = [still_watch_of(bundle.contract) for bundle in bundles]
    notices = _InputNotices()
    with stop_signals(SUMMARY_FOLLOWS) as stopped:
        addresses = recordings_of(options.source)
        for address in addresses:
            files = replayed_files(address)
            groups = {}
            if files:  # as `trials_of` has them
                groups = {**read_manifest(files[0]).groups, "recording": files[0].stem}
            with open_source(address) as source:
                recognisers = [
                    Recogniser(bundle, source.info, config, level.of(groups), scale, still)
                    for bundle, level, scale, still in zip(
                        bundles, levels, scales, stills, strict=True
                    )
                ]
                tallies = _run_source(options, source, recognisers, notices, stopped)
            for tally in tallies if len(addresses) > 1 else ():
                tally.recording = files[0].stem
            for total, tally in zip(totals, tallies, strict=bool(totals)):
                total.take_in(tally)
            totals = totals or tallies
            if stopped():
                break
    return totals


def _run_source(
    options: ArrayOptions,
    source: Source,
    recognisers: list[Recogniser],
    notices: _InputNotices,
    stopped: Callable[[], bool],
) -> list[Tally]:
    """Run one source until it ends or is stopped, on the screen where there is one."""
    from taxel.live.session import run_session

    newtons = _newtons(options.calibration, source)
    if options.json or not console.is_terminal:
        tallies = run_session(
            source, recognisers, options.seconds, notices.show, options.rules, stopped
        )
        notices.print_new(tallies)
        return tallies
    from taxel.views.live_screen import LiveView

    with LiveView(console, source.info, recognisers, newtons) as view:
        return run_session(source, recognisers, options.seconds, view.show, options.rules, stopped)


def _newtons(calibration: Path | None, source: Source) -> LiveNewtons | None:
    """Return what turns the array's volts into newtons, where a calibration was named."""
    if calibration is None:
        return None
    from taxel.calibration.live import LiveNewtons
    from taxel.calibration.stored import read_calibration

    return LiveNewtons(read_calibration(calibration), source.info)


def _trained_on_warning(bundle: Bundle, source: str) -> str | None:
    """Return a warning where the accuracy is of recordings that the bundle was trained on.

    The run is over by then: what became of its files meanwhile is no reason to lose the summary.
    """
    from taxel.evaluation.learned_recordings import recordings_trained_on
    from taxel.sources.opening import replayed_files
    from taxel.views.tables.trained_on import trained_on_line, unchecked_line

    try:
        files = replayed_files(source)
        if not files:
            return None
        found = recordings_trained_on(bundle.contract, files)
    except (TaxelError, OSError) as error:
        return unchecked_line("recordings", error)
    return trained_on_line(found, "recordings", known=bool(bundle.contract.learned))


def _summary_lines(result: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield what stands below a bundle's counts of answers: each line and its style."""
    yield from _accuracy_lines(result)
    if result["filled"]:
        yield f"{number_of(result['filled'], 'window')} had short gaps filled in", ""
    for move in result["gate_moves"]:
        yield f"{_when(move)}: {move['text']}", ""
    for still in result["still_channels"]:
        yield f"warning: {_when(still)}: {still['text']}", "yellow"
    for scale in result["other_scales"]:
        yield f"warning: {_when(scale)}: {scale['text']}", "yellow"
    if result["untouched"]:
        yield f"note: {result['untouched']}", ""
    for change in result["rate_changes"]:
        warning = "" if change["fits"] else "warning: "
        yield f"{warning}{_when(change)}: {change['text']}", "yellow"
    for outage in result["outages"]:
        yield f"warning: {_outage_words(outage)}", "yellow"
    if result["level"] is not None:
        yield result["level"]["text"], ""
        if result["level"]["warning"]:
            yield f"warning: {result['level']['warning']}", "yellow"
    if result["windows"]:
        times = (
            f"median {result['latency_us_median']:.0f} µs, p99 {result['latency_us_p99']:.0f} µs"
        )
        yield f"latency from window to decision: {times}", ""


def _accuracy_lines(result: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield how many answers were correct, where the source knows, and what limits that figure."""
    if result["marked"]:
        windows = f"{result['right']}/{number_of(result['marked'], 'window')}"
        grasps = f"{result['grasps_right']}/{number_of(result['grasps'], 'whole grasp')}"
        rule = "UNKNOWN is correct only for touch that was never trained on"
        yield f"accuracy against ground truth: {windows}, {grasps} ({rule})", ""
    if result["grasps_without"]:
        marked = result["grasps"] + result["grasps_without"]
        yield (
            f"warning: {result['grasps_without']} of {number_of(marked, 'marked grasp')} held "
            "no whole window: nothing was decided of them",
            "yellow",
        )
    if result["warning"] is not None:
        yield f"warning: {result['warning']}", "yellow"


def _when(news: dict[str, Any], key: str = "time_s") -> str:
    """Return when something happened: seconds from the first scan, and of which recording."""
    where = f"{visible(news['recording'])}, " if news["recording"] else ""
    return f"{where}{news[key]:.1f} s"


def _outage_words(outage: dict[str, Any]) -> str:
    """Return from when to when no values were usable, and why."""
    until = "the end" if outage["end_s"] is None else f"{outage['end_s']:.1f} s"
    return f"{_when(outage, 'start_s')} to {until}: no usable values ({outage['reason']})"


class _InputNotices:
    """Prints faults of the input as they happen, each once, where no screen shows them.

    They are channels that have stopped changing, times without usable values, and another rate or
    unit than in training.
    """

    def __init__(self) -> None:
        self._still: set[tuple[int, str]] = set()
        self._scales: set[int] = set()
        self._outages: dict[int, Outage] = {}
        self._rates: dict[int, RateChange] = {}

    def show(self, samples: Samples, tallies: list[Tally]) -> None:
        """Print what is new while a session runs."""
        self.print_new(tallies)

    def print_new(self, tallies: Sequence[Tally]) -> None:
        """Print on the error stream what is new in the tallies, one for each bundle."""
        for number, tally in enumerate(tallies):
            for still in tally.still_channels:
                if (number, still.channel) not in self._still:
                    self._still.add((number, still.channel))
                    say_aside(f"{tally.target}: {still.words()}")
            for scale in tally.other_scales:
                if number not in self._scales:
                    self._scales.add(number)
                    say_aside(f"{tally.target}: {scale.words()}")
            if tally.outages and tally.outages[-1] != self._outages.get(number):
                self._outages[number] = tally.outages[-1]
                say_aside(f"{tally.target}: {tally.outages[-1].words()}")
            if tally.rate_changes and tally.rate_changes[-1] != self._rates.get(number):
                self._rates[number] = tally.rate_changes[-1]
                say_aside(f"{tally.target}: {tally.rate_changes[-1].words()}")
