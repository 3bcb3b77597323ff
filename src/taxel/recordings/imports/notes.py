"""What a person should know of imported files, though nothing in them is wrong: a line for each.

Knows nothing about how files are read or written.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from taxel.plain_text import number_of, visible

GAP_STEPS = 2.0
"""Median steps beyond which a step is a gap: a scan was lost even where times jitter. Source: our
choice, docs/decisions/0004."""
_SLACK = 1e-6
"""Share by which rounding may lengthen a step."""
FAST_HZ = 50_000.0
"""Scans a second above which it may be wrong: s read as ms is 1000 times too fast. Source: our
choice, docs/decisions/0004."""
SLOW_HZ = 1.0
"""Scans a second below which a time column's unit may be wrong: ms read as s is 1000 times too
slow, and touch is sampled faster. Source: our choice, docs/decisions/0004."""

NO_CHANNELS = frozenset(
    ("", "unnamed: 0", "index", "label", "labels", "target", "class", "state", "slip", "trial",
     "id", "object", "session", "subject")
)  # fmt: skip
"""Names of columns that are rarely a sensor's: pandas' index, labels. Source: our choice,
docs/decisions/0011."""
COARSE = 0.01
"""Share of a channel's range that 32 bits may lose. Source: our choice, docs/decisions/0011."""
LYING = 2
"""Channels for each scan beyond which an array may lie on its side. Source: our choice,
docs/decisions/0011."""
ZEROS, OFTEN = 3, 0.1
"""Rows of zeros at a trial's end, and the share of trials that end so, from which on these may be
padding. Source: our choice, docs/decisions/0011."""
MOST_LEFT_OUT = 10
"""Files that were left out which are named. Source: our choice, docs/decisions/0011."""
MOST_REMARKS = 5
"""Lines on how lines of the table, or files of many trials, were read. Source: our choice,
docs/decisions/0011."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FileFacts:
    """How one file was read, where a person should check it."""

    file: str
    """Its name."""
    number_header: str = ""
    """Its first line where it was taken as names though it holds only numbers; or empty."""
    decimal_comma: bool = False
    """Whether commas were taken for decimal signs."""
    one_more: bool = False
    """Whether each of its rows ends in a separator, though the line of names does not."""
    passed_over: str = ""
    """Which of its lines around the names are no rows, and why; or empty."""
    other_units: str = ""
    """Which columns have another unit in it than in the table; or empty."""
    scans: int = 0
    """How many were imported."""
    repeated: int = 0
    """Rows that were left out, as they repeat the time of the row above."""
    garbled: int = 0
    """Rows that were left out, as their time is far outside its neighbours'."""
    rate_hz: float = 0.0
    """Scans a second, hertz, by the median step; 0 for a single scan."""
    time: str = ""
    """The time column and its unit, such as "t[ms]"; empty where time is not from a column."""
    gaps: int = 0
    """Steps of more than GAP_STEPS times the median one."""
    longest_gap_s: float = 0.0
    """The longest of them, from scan to scan, seconds."""
    longest_from_s: float = 0.0
    """Where it starts, seconds from the first scan."""
    of_line: tuple[str, ...] = ()
    """How its line of the table was read, the same for all of the line's files."""
    remarks: tuple[str, ...] = ()
    """How a file of many trials, or of scans of several lines, was read."""
    doubts: tuple[str, ...] = ()
    """What may have been meant in another way, the same for all of its trials."""
    coarse: str = ""
    """Channels that lose much in 32 bits; or empty."""
    lying: str = ""
    """How it was read where its rows may be its channels; or empty."""
    marked: Mapping[str, int] = field(default_factory=dict)
    """Mark of missing values, as the table names it → values that were such."""
    values: int = 0
    """How many it holds, of all channels."""
    padding: int = 0
    """Rows of NaN at its end, which were cut."""
    zeros: int = 0
    """Rows of zeros at its end, which were kept."""
    pieces: int = 0
    """Pieces that it was cut into; 0 where it stays whole."""
    in_no_piece: int = 0
    """Its rows that are in none of them."""
    short: int = 0
    """Its stretches that are shorter than a piece, and give none."""
    left_out: str = ""
    """Why it could not be read, and was left out; or empty."""


def gaps_of(time_s: NDArray[np.float64]) -> tuple[int, float, float]:
    """Return how many gaps there are, how long the longest is, and where it starts.

    Args:
        time_s: Of a file's scans, shape (n,), seconds, increasing.

    Returns:
        The number, seconds from scan to scan, and seconds from the first scan; zeros without one.
    """
    steps_s = np.diff(time_s)
    if len(steps_s) < 2:
        return 0, 0.0, 0.0
    count = int(np.count_nonzero(steps_s > GAP_STEPS * (1 + _SLACK) * np.median(steps_s)))
    longest = int(np.argmax(steps_s))
    if not count:
        return 0, 0.0, 0.0
    return count, float(steps_s[longest]), float(time_s[longest] - time_s[0])


def coarse_of(values: NDArray[np.float64], names: Sequence[str]) -> str:
    """Return the channels that lose more than a hundredth of their range in 32 bits.

    Args:
        values: Shape (n, channels).
        names: Of the channels.
    """
    low, high = np.fmin.reduce(values, axis=0), np.fmax.reduce(values, axis=0)  # passes over NaN
    with np.errstate(over="ignore", invalid="ignore"):
        step = np.spacing(np.maximum(np.abs(low), np.abs(high)).astype(np.float32))
        most = COARSE * (high - low)
        may = np.flatnonzero((most > 0) & (step.astype(np.float64) > most))
    odd = [names[column] for column in may if _lost(values[:, column]) > most[column]]
    more = f" and {len(odd) - 8} more" if len(odd) > 8 else ""
    return ", ".join(map(visible, odd[:8])) + more


def _lost(channel: NDArray[np.float64]) -> float:
    """Return the most that a value of a channel loses in 32 bits."""
    return float(np.fmax.reduce(np.abs(channel - channel.astype(np.float32))))


def lying_of(rows: int, channels: int) -> str:
    """Return how an array was read, if it is far wider than long: its rows may be its channels."""
    if channels <= LYING * rows:
        return ""
    return f"{number_of(rows, 'scan')} of {number_of(channels, 'channel')}"


def notes_of(files: Sequence[FileFacts]) -> list[str]:
    """Return a line for each matter, however many files it is found in."""
    left_out = [facts for facts in files if facts.left_out]
    files = [facts for facts in files if not facts.left_out]
    slow = [facts for facts in files if facts.time and 0 < facts.rate_hz < SLOW_HZ]
    fast = [facts for facts in files if facts.time and facts.rate_hz > FAST_HZ]
    return [
        *_first(list(dict.fromkeys(remark for facts in files for remark in facts.of_line)),
                "more lines of the table were read likewise"),
        *_first(list(dict.fromkeys(remark for facts in files for remark in facts.remarks)),
                "more files or arrays were read likewise"),
        *_first(list(dict.fromkeys(doubt for facts in files for doubt in facts.doubts)),
                "more notes of this kind on other files"),
        *_pieces([facts for facts in files if facts.pieces]),
        *_marked(files),
        *_paddings([facts for facts in files if facts.padding], len(files)),
        *_zeros([facts for facts in files if facts.zeros >= ZEROS], len(files)),
        *_garbled(files),
        *_repeated(files),
        *_number_headers([facts for facts in files if facts.number_header]),
        *_decimal_commas([facts for facts in files if facts.decimal_comma]),
        *_one_more([facts for facts in files if facts.one_more]),
        *_coarse([facts for facts in files if facts.coarse]),
        *_lying([facts for facts in files if facts.lying]),
        *_passed_over([facts for facts in files if facts.passed_over]),
        *_other_units([facts for facts in files if facts.other_units]),
        *_rates(slow, "few"),
        *_rates(fast, "many"),
        *_gaps([facts for facts in files if facts.gaps], len(files)),
        *_left_out(left_out),
    ]  # fmt: skip


def _number_headers(files: Sequence[FileFacts]) -> list[str]:
    if not files:
        return []
    return [
        f"{_some(files)}: line 1 ({files[0].number_header}) was taken as the columns' names, not "
        "as a scan; if it is a scan, put a line of names above it"
    ]


def _first(remarks: list[str], rest: str) -> list[str]:
    """Return lines on how files of many trials were read; of many files only the first ones."""
    if len(remarks) <= MOST_REMARKS:
        return remarks
    left = len(remarks) - MOST_REMARKS + 1
    return [*remarks[: MOST_REMARKS - 1], f"{left} {rest}"]


def _pieces(files: Sequence[FileFacts]) -> list[str]:
    if not files:
        return []
    pieces = sum(facts.pieces for facts in files)
    left = sum(facts.in_no_piece for facts in files)
    rest = f"; {number_of(left, 'row')} behind the last whole piece are in none" if left else ""
    if short := sum(facts.short for facts in files):
        is_ = "is" if short == 1 else "are"
        rest += f"; {number_of(short, 'stretch')} {is_} shorter than a piece"
    was = "recording was" if len(files) == 1 else "recordings were"
    return [
        f"{len(files)} {was} cut into {number_of(pieces, 'piece')}, each a trial{rest}; the group "
        "cut_from names what a piece was cut from"
    ]


def _marked(files: Sequence[FileFacts]) -> list[str]:
    """Return a line for each mark of missing values: how many were such, or that none was."""
    lines = []
    for mark in dict.fromkeys(mark for facts in files for mark in facts.marked):
        own = [facts for facts in files if mark in facts.marked]
        counts = [facts.marked[mark] for facts in own]
        count, concerned, most = sum(counts), sum(map(bool, counts)), max(counts)
        if not count:
            lines.append(
                f"no value is {mark}, which the column 'missing' names as a mark of missing "
                "values; if it is written otherwise in the data, correct it"
            )
            continue
        is_, was = ("is", "was") if count == 1 else ("are", "were")
        where = f", at most {most}" if concerned > 1 else ""
        share = 100 * count / sum(facts.values for facts in own)
        lines.append(
            f"{number_of(count, 'value')} ({share:.2g} %) in {concerned} of "
            f"{number_of(len(own), 'file')} {is_} {mark}, and {was} taken as missing{where} "
            f"({own[counts.index(most)].file})"
        )
    return lines


def _paddings(files: Sequence[FileFacts], of: int) -> list[str]:
    if not files:
        return []
    most = max(files, key=lambda facts: facts.padding)
    end = "ends before its" if len(files) == 1 else "end before their"
    return [
        f"{len(files)} of {number_of(of, 'trial')} {end} array does: rows of NaN at the end were "
        f"taken as padding and cut, at most {most.padding} ({most.file}); --missing keep keeps them"
    ]


def _zeros(files: Sequence[FileFacts], of: int) -> list[str]:
    """Return a line on zeros at the end of enough trials; length may predict classes."""
    if len(files) < max(2, OFTEN * of):
        return []
    most = max(files, key=lambda facts: facts.zeros)
    return [
        f"{len(files)} of {of} trials end in rows of zeros, at most {most.zeros} ({most.file}); if "
        "these are padding, a model may learn from it how long a trial was: name an array of "
        "lengths in the column 'length'"
    ]


def _garbled(files: Sequence[FileFacts]) -> list[str]:
    return _dropped(files, [facts.garbled for facts in files], "a garbled time")


def _repeated(files: Sequence[FileFacts]) -> list[str]:
    return _dropped(files, [facts.repeated for facts in files], "the time of the row above")


def _dropped(files: Sequence[FileFacts], counts: Sequence[int], what: str) -> list[str]:
    """Return a line on rows that were left out because of what they have, if there are any.

    Args:
        files: All files.
        counts: Of such rows in each file.
        what: They have.
    """
    count, concerned = sum(counts), sum(map(bool, counts))
    if not count:
        return []
    rows = sum(facts.scans + facts.repeated + facts.garbled for facts in files)
    most = max(counts)
    has, was = ("has", "was") if count == 1 else ("have", "were")
    where = f", at most {most}" if concerned > 1 else ""
    return [
        f"{number_of(count, 'row')} ({100 * count / rows:.2g} %) in {concerned} of "
        f"{number_of(len(files), 'file')} {has} {what} and {was} left out{where} "
        f"({files[counts.index(most)].file})"
    ]


def _decimal_commas(files: Sequence[FileFacts]) -> list[str]:
    return [f"{_some(files)}: commas were taken as decimal signs: 0,5 is a half"] if files else []


def _one_more(files: Sequence[FileFacts]) -> list[str]:
    if not files:
        return []
    return [
        f"{_some(files)}: each row ends in a separator, the line of names does not; the empty cell "
        "behind it was left out"
    ]


def _passed_over(files: Sequence[FileFacts]) -> list[str]:
    return [f"{_some(files)}: passed over {files[0].passed_over}"] if files else []


def _other_units(files: Sequence[FileFacts]) -> list[str]:
    more = "; values stay as they are: if the file is right, correct the import table's unit"
    return [f"{_some(files)}: states {files[0].other_units}{more}"] if files else []


def _coarse(files: Sequence[FileFacts]) -> list[str]:
    if not files:
        return []
    return [
        f"{_some(files)}: values are kept in 32 bits, in which more than a hundredth of the range "
        f"is lost in channels {files[0].coarse}; subtract an offset before, or leave counters and "
        "clocks out"
    ]


def _lying(files: Sequence[FileFacts]) -> list[str]:
    if not files:
        return []
    return [
        f"{_some(files)}: read as {files[0].lying}; if its rows are the channels, write "
        "channels rows in the column 'axes'"
    ]


def _rates(files: Sequence[FileFacts], how: str) -> list[str]:
    """Return a line on files of few or very many scans a second: the first, and all rates."""
    if not files:
        return []
    rates = sorted(facts.rate_hz for facts in files)
    ends = dict.fromkeys(f"{rate:.3g}" for rate in (rates[0], rates[-1]))
    return [
        f"{_some(files)}: {' to '.join(ends)} scans a second by the time column {files[0].time}; "
        f"if that is too {how}, its unit is wrong: s, ms, us or ns"
    ]


def doubtful_names(file: str, names: Sequence[str]) -> list[str]:
    """Return a line on columns that * made channels of, but whose names speak against it.

    Args:
        file: The file's name.
        names: Of its channels.
    """
    odd = [name for name in names if name.strip().lower() in NO_CHANNELS]
    if not odd:
        return []
    shown = ", ".join(visible(name) if name.strip() else "a column without a name" for name in odd)
    return [
        f"{file}: * took {shown} as a channel; if that is a label or a counter, a model would "
        "learn from it: name the channels in the column 'channels'"
    ]


def _gaps(files: Sequence[FileFacts], of: int) -> list[str]:
    if not files:
        return []
    count = sum(facts.gaps for facts in files)
    longest = max(files, key=lambda facts: facts.longest_gap_s)
    return [
        f"{count} {'gap' if count == 1 else 'gaps'} in {len(files)} of {of} files, a step of more "
        f"than {GAP_STEPS:g} times the median; the longest lasts {longest.longest_gap_s:.3g} s "
        f"({longest.file}, {longest.longest_from_s:.3f} s after its first scan); scans missing "
        "there are not counted as lost"
    ]


def _left_out(files: Sequence[FileFacts]) -> list[str]:
    """Return how many files were left out, and of the first ones why."""
    if not files:
        return []
    were, they = ("was", "it") if len(files) == 1 else ("were", "they")
    more = len(files) - MOST_LEFT_OUT
    return [
        f"{number_of(len(files), 'file')} {were} left out, since {they} cannot be read as the "
        "table says",
        *(f"left out {visible(facts.file)}: {facts.left_out}" for facts in files[:MOST_LEFT_OUT]),
        *([f"left out {number_of(more, 'more file')}"] if more > 0 else []),
    ]


def _some(files: Sequence[FileFacts]) -> str:
    return files[0].file + (f" and {len(files) - 1} more" if len(files) > 1 else "")
