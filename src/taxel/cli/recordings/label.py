"""`taxel label`: intervals of long recordings, and when a grasp turned unstable."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import tyro
from rich.table import Table

from taxel.cli.figure_files import need_figures
from taxel.cli.options.rules import Only
from taxel.cli.printing import command, console, counted, print_json, progress, say
from taxel.errors import BadInput
from taxel.plain_text import number_of, visible, visible_line
from taxel.recordings.whole import write_whole

if TYPE_CHECKING:
    from taxel.labels.agreement import Agreement
    from taxel.training.frames.label_sheet import PourLabels
    from taxel.windows.camera_recordings import CameraRecording


@dataclass(frozen=True, kw_only=True)
class Label:
    """Label intervals of an array's recordings, or show when each grasp turned unstable.

    With --intervals and --output it writes labelled copies of an array's recordings: each
    interval becomes a mark, and so a trial. Without, it shows when each grasp before cameras
    turned unstable, by rule, and how far the rules agree; with --onset, --frame or --stable it
    writes a person's correction of one rule on one recording, with --onsets those of many, beside
    each recording as NAME.labels.json, which overrides the rule from then on.
    """

    path: tyro.conf.Positional[Path]
    """A recording (.mcap), or a folder of them."""
    intervals: Path | None = None
    """Label: a table (CSV) with the columns file, start_s, end_s or duration_s (seconds from the
    recording's first scan), label:NAME and group:NAME; for a single recording also an Audacity
    label track or MNE's annotations (.txt)."""
    output: Path | None = None
    """Label: folder to create for the labelled copies."""
    overwrite: bool = False
    """Label: replace an existing output folder."""
    rule: str = "change"
    """Rule that is shown and corrected: change (the paper's, from images), micro-slip, slip,
    gross-slip or drop (from the simulator's ground truth)."""
    onsets: Path | None = None
    """Correct: a table (CSV) with the columns file and onset_s (or frame), and author and note
    where wanted; an empty onset says that the grasp was stable throughout."""
    onset: float | None = None
    """Correct: first unstable moment, seconds after the recording's first frame."""
    frame: int | None = None
    """Correct: first unstable frame, counted from 0, instead of --onset."""
    stable: bool = False
    """Correct: stable throughout."""
    clear: bool = False
    """Remove the correction."""
    author: str = ""
    """Correct: name of the person."""
    note: str = ""
    """Correct: the reason."""
    plot: Path | None = None
    """Write a figure of one recording's change signal, with threshold and every onset, to this
    file (.png); needs taxel[train]."""
    cache: Path | None = None
    """Folder for change signals; $TAXEL_CACHE or ~/.cache/taxel unless given."""
    json: bool = False
    """Print everything as JSON."""

    RULES: ClassVar = (
        Only(("cache",), "no --intervals", lambda o: o.intervals is None),
        Only(
            ("onset", "onsets", "frame", "stable", "clear"),
            "no --intervals",
            lambda o: not o.intervals,
        ),
    )

    def run(self) -> None:
        """Label intervals; or correct where that is asked for, then show."""
        from taxel.labels.rules import rule_named

        rule_named(self.rule)
        self._check_options()
        if self.intervals is not None and self.output is not None:
            self._mark(self.intervals, self.output)
        else:
            self._show()

    def _show(self) -> None:
        """Correct where that is asked for, then show when grasps before cameras turned unstable."""
        from taxel.recordings.reader import list_recordings
        from taxel.training.frames.features import default_cache
        from taxel.training.frames.label_sheet import label_sheet
        from taxel.training.frames.labels import corrections_of
        from taxel.windows.camera_recordings import read_camera_recording, read_camera_recordings

        with progress() as bar:
            paths = list_recordings(self.path)
            task = bar.add_task("reading", total=None)
            pours = (
                read_camera_recordings(self.path)
                if len(paths) > 1
                else [read_camera_recording(paths[0])]
            )
            bar.update(task, description="labelling", completed=0, total=len(pours))
            sheet = label_sheet(
                pours, self.cache or default_cache(), lambda _: bar.update(task, advance=1)
            )
        done = ""
        if self.onsets is not None:
            done = self._correct_many(self.onsets, pours)
        elif self._asked():
            done = self._correct(pours[0])
        if done:
            sheet = [replace(own, corrections=corrections_of(own.pour)) for own in sheet]
        if self.plot is not None:
            self._draw(self.plot, sheet[0])
        if self.json:
            print_json(_plain(sheet, self.rule))
            return
        if done:
            say(done)
        _print(sheet, self.rule)
        if self.plot is not None:
            say(f"figure: {self.plot}")

    def _mark(self, intervals: Path, output: Path) -> None:
        """Write labelled copies, and say what was made."""
        from taxel.labels.marking import mark_recordings
        from taxel.recordings.imports.spelling import look_alikes, unknown_words

        with counted("labelling") as show:
            marked = mark_recordings(
                self.path, intervals, output, overwrite=self.overwrite, progress=show
            )
        labels = [mark.labels for mark in marked.marks]
        groups = [mark.groups for mark in marked.marks]
        notes = [
            *look_alikes("label", labels), *unknown_words("label", labels),
            *look_alikes("group", groups), *unknown_words("group", groups),
        ]  # fmt: skip
        if marked.replaced:
            notes.append(f"{number_of(marked.replaced, 'earlier mark')} left out of the copies")
        if marked.left_out:
            names = ", ".join(path.name for path in marked.left_out)
            notes.append(f"left out, without an interval: {names}")
        if self.json:
            print_json(
                {
                    "recordings": [str(path) for path in marked.recordings],
                    "marks": len(marked.marks),
                    "replaced": marked.replaced,
                    "left_out": [str(path) for path in marked.left_out],
                    "notes": notes,
                }
            )
            return
        for note in notes:
            say(note)
        say(f"{output}: {number_of(len(marked.recordings), 'recording')}, "
            f"{number_of(len(marked.marks), 'mark')}; next:",
            command("taxel", "info", output))  # fmt: skip

    def _asked(self) -> list[str]:
        given = {"--onset": self.onset is not None, "--frame": self.frame is not None,
                 "--stable": self.stable, "--clear": self.clear,
                 "--onsets": self.onsets is not None}  # fmt: skip
        return [name for name, asked in given.items() if asked]

    def _check_options(self) -> None:
        """Refuse, before anything is read or written, what cannot be meant."""
        asked = self._asked()
        if (self.intervals is None) != (self.output is None):
            raise BadInput("--intervals and --output together", "one of them", "give both")
        if self.overwrite and self.output is None:
            raise BadInput("--output beside --overwrite", "none", "leave --overwrite out")
        if self.intervals is not None and (
            asked or self.author or self.note or self.plot or self.rule != "change"
        ):
            raise BadInput("--intervals without options of grasps before cameras", "both kinds",
                           "label first, or correct first")  # fmt: skip
        if len(asked) > 1:
            raise BadInput("one of --onset, --frame, --stable, --clear and --onsets",
                           " and ".join(asked),
                           "choose one")  # fmt: skip
        if (self.author or self.note) and (not asked or self.clear or self.onsets):
            raise BadInput(
                "--author and --note beside --onset, --frame or --stable",
                asked[0] if asked else "none of these",
                "say what is corrected",
            )
        single = [name for name in asked if name != "--onsets"]
        if (single or self.plot is not None) and self.path.is_dir():
            raise BadInput(f"one recording for {single[0] if single else '--plot'}",
                           f"the folder {self.path}", "name one of its files")  # fmt: skip
        if self.plot is not None:
            need_figures(self.plot)

    def _correct(self, pour: CameraRecording) -> str:
        """Write or remove a correction; return a line that says so."""
        from taxel.labels.corrections import Correction, remove_correction, write_correction
        from taxel.training.frames.labels import duration_of

        duration_s = duration_of(pour)
        if self.clear:
            found = remove_correction(pour.path, self.rule, duration_s)
            return f"{pour.path}: {'correction' if found else 'no correction'} of {self.rule} " + (
                "taken back" if found else "to take back"
            )
        correction = Correction(
            rule=self.rule, onset_s=self.onset, author=self.author, note=self.note
        )
        if self.frame is not None:
            correction = Correction.at_frame(
                self.rule, self.frame, pour.time_s, self.author, self.note
            )
        path = write_correction(pour.path, correction, duration_s)
        verdict = (
            "stable throughout" if self.stable else f"unstable from {correction.onset_s:.3f} s"
        )
        return f"{path}: {verdict} by {self.rule}"

    def _correct_many(self, table: Path, pours: Sequence[CameraRecording]) -> str:
        """Write a table's corrections, all of which are checked before; return a line on it."""
        from taxel.labels.corrections import read_corrections, write_correction
        from taxel.labels.onset_table import read_onsets
        from taxel.training.frames.labels import duration_of

        found = read_onsets(table, self.rule, {pour.name: pour.time_s for pour in pours})
        own = [pour for pour in pours if pour.name in found]
        for pour in own:  # what is there already must be readable, too
            read_corrections(pour.path, duration_of(pour))
        for pour in own:
            write_correction(pour.path, found[pour.name], duration_of(pour))
        stable = sum(correction.onset_s is None for correction in found.values())
        return (
            f"{number_of(len(found), 'recording')} corrected for {self.rule}: "
            f"{len(found) - stable} unstable from an onset on, {stable} stable throughout"
        )

    def _draw(self, path: Path, labels: PourLabels) -> None:
        from taxel.views.figures.labels import label_figure

        write_whole(path, label_figure(labels, self.rule))


def _plain(sheet: list[PourLabels], rule: str) -> dict[str, Any]:
    from taxel.training.frames.label_sheet import person_agreement, rule_agreement

    person = person_agreement(sheet, rule)
    return {
        "rule": rule,
        "recordings": [
            {
                "recording": str(labels.pour.path),
                "frames": len(labels.pour),
                "duration_s": float(labels.time_s[-1]),
                "onset_s": labels.onset(rule),
                "unstable_share": labels.unstable_share(rule),
                "onsets_s": {name: labels.onset(name) for name in labels.by_rule},
                "corrections": {
                    name: asdict(correction) for name, correction in labels.corrections.items()
                },
            }
            for labels in sheet
        ],
        "agreement": [row.as_dict() for row in rule_agreement(sheet)],
        "person": None if person is None else person.as_dict(),
    }


def _print(sheet: list[PourLabels], rule: str) -> None:
    from taxel.labels.rules import rule_named
    from taxel.training.frames.label_sheet import person_agreement, rule_agreement

    say(f"{rule}: {rule_named(rule).summary}")
    table = Table()
    table.add_column("recording")
    for column in ("frames", "onset s", "unstable"):
        table.add_column(column, justify="right")
    table.add_column("correction")
    for labels in sheet:
        share = labels.unstable_share(rule)
        table.add_row(
            visible(labels.pour.name),
            str(len(labels.pour)),
            _seconds(labels.onset(rule)),
            "–" if share != share else f"{share:.1%}",
            visible_line(_correction_text(labels, rule)),
        )
    console.print(table)
    unlabelled = sum(labels.labels(rule) is None for labels in sheet)
    if unlabelled:
        say(
            f"no physics truth for {rule} in {unlabelled} of "
            f"{number_of(len(sheet), 'recording')}: label them with --onset, --frame or --stable"
        )
    rows = rule_agreement(sheet)
    person = person_agreement(sheet, rule)
    if person is not None:
        rows.append(person)
    if rows:
        console.print(_agreement_table(rows))
    if not any(row.first in ("micro-slip", "slip") for row in rows):
        say("no physics truth beside all of these images: only change can be worked out")


def _correction_text(pour_labels: PourLabels, rule: str) -> str:
    correction = pour_labels.corrections.get(rule)
    if correction is None:
        return "–"
    onset = correction.onset_s
    word = "stable" if onset is None else f"{onset:.3f} s"
    return ", ".join(filter(None, (word, correction.author, correction.note)))


def _agreement_table(rows: list[Agreement]) -> Table:
    table = Table(
        title="agreement of the rules (their labels without corrections)", title_justify="left",
        caption="lead: median time by which the first's onset comes before the second's; "
        "runs: with an onset by both / the first only / the second only",
        caption_justify="left",
    )  # fmt: skip
    for column in ("first", "second"):
        table.add_column(column)
    for column in ("frames", "equal", "kappa", "runs", "first earlier", "lead s"):
        table.add_column(column, justify="right")
    for row in rows:
        table.add_row(
            row.first,
            row.second,
            f"{row.frames:,}",
            f"{row.equal:.1%}",
            _number(row.kappa, ".2f"),
            f"{row.runs_both} / {row.runs_first_only} / {row.runs_second_only}",
            _number(row.first_earlier, ".0%"),
            _number(row.lead_s, "+.3f"),
        )
    return table


def _number(value: float, form: str) -> str:
    return "–" if value != value else format(value, form)


def _seconds(value: float | None) -> str:
    return "–" if value is None else f"{value:.3f}"
