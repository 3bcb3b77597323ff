"""What every page of results is made of: its style, tables, figures, and how it is written.

Knows nothing about results.
"""

from __future__ import annotations

import base64
import math
import os
from collections.abc import Sequence
from pathlib import Path

from taxel.errors import BadFile, BadInput
from taxel.evaluation.intervals import ALIKE, all_alike
from taxel.foreign.files import open_file
from taxel.plain_text import html_text
from taxel.recordings.whole import write_whole

_FIRST = b"<!doctype html>"
"""What a page begins with."""
_STYLE = """
:root{color-scheme:light dark;--page:#fff;--ink:#1b1f24;--soft:#5b6673;--line:#dde1e6;
--card:#f5f7f9;--strong:#8894a3;--warn:#fff1c9;--warn-ink:#5f4700;--good:#17693a;--bad:#a1291f;
--c0:#3768a8;--c1:#c8553d;--c2:#2f8f5b;--c3:#8a5fb0;--c4:#a77b12;--c5:#3c97ad;--grey:#98a2ad}
@media(prefers-color-scheme:dark){:root{--page:#14171b;--ink:#e6e9ed;--soft:#9aa5b1;
--line:#333a43;--card:#1d2228;--strong:#6b7785;--warn:#4a3a0c;--warn-ink:#ffe2a0;--good:#6fcf97;
--bad:#ff8f80;--c0:#7fb0ec;--c1:#f0907a;--c2:#6ecb98;--c3:#c3a0e6;--c4:#e0b95a;--c5:#7accdf;
--grey:#78838f}}
@media print{:root{--page:#fff;--ink:#000;--soft:#444;--line:#ccc;--card:#f5f7f9;--strong:#777;
--warn:#fff1c9;--warn-ink:#5f4700;--good:#17693a;--bad:#a1291f;--c0:#3768a8;--c1:#c8553d;
--c2:#2f8f5b;--c3:#8a5fb0;--c4:#a77b12;--c5:#3c97ad;--grey:#98a2ad}
body{max-width:none;margin:0;font-size:10.5pt}nav{display:none}
h2,h3,h4{break-after:avoid}figure,tr,.tile{break-inside:avoid}
.scroll{overflow:visible}table{font-size:8pt!important}
th{white-space:normal!important}th,td{padding:.12rem .32rem!important}
*{print-color-adjust:exact;-webkit-print-color-adjust:exact}}
@page{margin:14mm}
*{box-sizing:border-box}
body{font:15px/1.55 system-ui,-apple-system,"Segoe UI",sans-serif;max-width:1060px;
margin:2.2rem auto;padding:0 1.2rem 4rem;color:var(--ink);background:var(--page)}
h1{font-size:1.9rem;line-height:1.2;margin:.2rem 0 .6rem}
h2{font-size:1.35rem;margin:2.6rem 0 .5rem;padding-top:.7rem;border-top:1px solid var(--line)}
h3{font-size:1.05rem;margin:1.5rem 0 .3rem}p{max-width:75ch;margin:.5rem 0}
nav{display:flex;flex-wrap:wrap;gap:.2rem 1rem;font-size:14px;margin:.8rem 0}
a{color:var(--c0)}
.scroll{overflow-x:auto;max-width:100%}
table{border-collapse:collapse;margin:.5rem 0 1.2rem;font-size:13.5px;
font-variant-numeric:tabular-nums}
th,td{padding:.26rem .7rem;border-bottom:1px solid var(--line);text-align:right;
white-space:nowrap;vertical-align:top}
th{font-weight:600;color:var(--soft)}thead th{border-bottom:2px solid var(--strong)}
th:first-child,td:first-child{text-align:left;padding-left:0}
.words td,.words th{text-align:left}.words td:last-child{white-space:normal}
td.wrap{white-space:normal;text-align:left;min-width:16rem}
.findings :is(th,td):is(:nth-child(2),:last-child){text-align:left}
.said{display:inline-block;white-space:normal;text-align:left;min-width:20rem;max-width:34rem}
tr.quiet td,.quiet,.published,.trivial{color:var(--soft)}
.good{color:var(--good)}.bad{color:var(--bad)}
.leaks{background:var(--warn);color:var(--warn-ink);padding:.05rem .4rem;border-radius:4px}
.note{background:var(--card);border-left:4px solid var(--strong);padding:.6rem .9rem;
border-radius:0 6px 6px 0;max-width:80ch}
.note.leaks{background:var(--warn);border-color:var(--c4);color:var(--warn-ink)}
.tiles{display:flex;flex-wrap:wrap;gap:.7rem;margin:1rem 0}
.tile{background:var(--card);border-radius:8px;padding:.6rem .9rem;min-width:9rem}
.tile b{display:block;font-size:1.5rem;line-height:1.2;font-variant-numeric:tabular-nums}
.tile span{color:var(--soft);font-size:13px}
.side{display:flex;flex-wrap:wrap;gap:.5rem 1.6rem;align-items:flex-start}
.side figure{max-width:300px}.side figure.free{max-width:100%}
figure{margin:.8rem 0;overflow-x:auto}
@media print{svg{min-width:0!important}}
@media screen and (max-width:600px){th,td{padding:.24rem .4rem}table{font-size:12.5px}
thead th{white-space:normal;vertical-align:bottom}.said{min-width:14rem}}
figcaption,small{color:var(--soft);font-size:13px;max-width:70ch}
figcaption{margin-top:.2rem}
svg{max-width:100%;height:auto;display:block;font:12px system-ui,sans-serif}
svg text{fill:var(--ink)}svg .soft{fill:var(--soft)}
img{max-width:100%}@media(prefers-color-scheme:dark){img{background:#fff;border-radius:4px}}
code{background:var(--card);padding:.1rem .3rem;border-radius:3px;font-size:13px;
overflow-wrap:anywhere}pre{background:var(--card);padding:.7rem .9rem;border-radius:6px;
overflow-x:auto;font-size:13px;white-space:pre-wrap;overflow-wrap:anywhere}
.key{display:inline-block;width:.8em;height:.8em;border-radius:2px;margin:0 .3em 0 .9em;
vertical-align:-.05em}.key:first-child{margin-left:0}
table.matrix td,table.matrix th{padding:.28rem .4rem;text-align:center;border:0;
vertical-align:middle}table.matrix th:first-child,table.matrix td:first-child{text-align:right}
table.matrix thead th{border:0}table.matrix td{border-radius:3px}
table.matrix td small{font-size:11px;color:inherit;opacity:.75}
table.sides{border-collapse:separate;border-spacing:2px}
table.sides td{border:0;padding:.15rem .35rem;text-align:center;border-radius:3px;font-size:12px;
min-width:1.5rem}table.sides th{border:0;padding:.1rem .35rem;font-size:12px;text-align:center}
table.sides th:first-child{text-align:left}
.train{background:color-mix(in srgb,var(--c0) 16%,transparent);color:var(--soft)}
.test{background:var(--c1);color:var(--page);font-weight:600}
.both{background:repeating-linear-gradient(135deg,
color-mix(in srgb,var(--c1) 42%,var(--page)) 0 6px,
color-mix(in srgb,var(--c0) 22%,var(--page)) 6px 12px);font-weight:600}
th.tall{writing-mode:vertical-rl;transform:rotate(180deg);text-align:left;
vertical-align:bottom;padding:.3rem .1rem}
table.matrix th.tall{text-align:left;vertical-align:middle;padding:.4rem .1rem}
"""


class Html(str):
    """Text that is HTML already; every other text is escaped."""

    __slots__ = ()


def text(value: object) -> Html:
    """Return a value as HTML: escaped, unless it is `Html`."""
    return value if isinstance(value, Html) else Html(html_text(value))


def join(parts: Sequence[object], between: str = "") -> Html:
    """Return parts as one piece of HTML."""
    return Html(between.join(map(text, parts)))


def tag(name: str, inside: object, kind: str = "") -> Html:
    """Return one element, with a class where `kind` is given."""
    return Html(f"<{name}{_kind(kind)}>{text(inside)}</{name}>")


def _kind(name: str) -> str:
    return f' class="{name}"' if name else ""


def number(value: float | None, digits: int = 4) -> str:
    """Return a figure; a dash where there is none."""
    return "–" if value is None or math.isnan(value) else f"{value:.{digits}f}"


def percent(value: float | None, digits: int = 1) -> str:
    """Return a share of 0…1 in per cent; a dash where there is none."""
    return "–" if value is None or math.isnan(value) else f"{100 * value:.{digits}f} %"


def band(low: float | None, high: float | None, digits: int = 1) -> str:
    """Return an interval of shares in per cent; nothing where there is none; where it has no width,
    that all are alike.
    """
    if low is None or high is None or math.isnan(low):
        return ""
    if all_alike((low, high)):
        return f"[{ALIKE}]"
    return f"[{100 * low:.{digits}f}, {100 * high:.{digits}f}]"


def split_name(name: str) -> Html:
    """Return a split's name, marked where it says that it leaks."""
    return tag("span", name, "leaks") if "leaks" in name else text(name)


def table(
    head: Sequence[object],
    rows: Sequence[Sequence[object]],
    *,
    kind: str = "",
    quiet: Sequence[int] = (),
) -> Html:
    """Return a table in a box of its own that scrolls where it is too wide.

    Args:
        head: Headings; none leaves the head out.
        rows: Cells, row by row.
        kind: Class of the table, such as "words".
        quiet: Rows that are printed grey, such as trivial baselines.
    """
    top = join([tag("th", cell) for cell in head])
    top = Html(f"<thead><tr>{top}</tr></thead>") if head else Html("")
    body = join(
        [
            tag("tr", join([tag("td", cell) for cell in row]), "quiet" if i in quiet else "")
            for i, row in enumerate(rows)
        ]
    )
    return Html(f'<div class="scroll"><table{_kind(kind)}>{top}<tbody>{body}</tbody></table></div>')


def figure(drawing: str, caption: object = "", kind: str = "") -> Html:
    """Return a drawing (SVG or HTML) with what it shows; its class is `kind`."""
    words = tag("figcaption", caption) if caption else ""
    return Html(f"<figure{_kind(kind)}>{drawing}{words}</figure>")


def png_figure(png: bytes, caption: str) -> Html:
    """Return a PNG as part of the page, with what it shows."""
    data = base64.b64encode(png).decode()
    return figure(f'<img alt="{text(caption)}" src="data:image/png;base64,{data}">', caption)


def section(name: str, title: object, parts: Sequence[object]) -> Html:
    """Return a part of the page that the list at its head leads to."""
    return Html(f'<h2 id="{text(name)}">{text(title)}</h2>{join(parts)}')


def tiles(figures: Sequence[tuple[str, str]]) -> Html:
    """Return figures to be seen at once: (figure, what it is)."""
    each = [
        tag("div", join([tag("b", value), tag("span", what)]), "tile") for value, what in figures
    ]
    return tag("div", join(each), "tiles")


def colour(index: int) -> str:
    """Return the page's colour of the n-th run, in both light and dark."""
    return f"var(--c{index % 6})"


def key(entries: Sequence[tuple[str, object]]) -> Html:
    """Return a legend: (colour, what it stands for)."""
    return tag(
        "small",
        join(
            [
                join([Html(f'<span class="key" style="background:{entry}"></span>'), what])
                for entry, what in entries
            ]
        ),
    )


def check_page(path: Path) -> bool:
    """Return whether an older page stands at a place for a page, and will be replaced.

    Raises:
        BadInput: A folder or something else stands there: a page is made again, that is not. Or its
            name is not that of a page.
    """
    if not os.path.lexists(path):
        _check_name(path)
        return False
    try:
        with open_file(path) as file:
            older = file.read(len(_FIRST)) == _FIRST
    except (OSError, BadFile):
        older = False
    if not older:
        raise BadInput(
            "a free name, or an older page, for the page to write",
            f"the folder {path}" if path.is_dir() else f"{path}, which holds something else",
            "name another, such as report.html",
        )
    _check_name(path)
    return True


def _check_name(path: Path) -> None:
    """Refuse a page that no program would open as one, such as report.pdf."""
    if path.suffix.lower() not in (".html", ".htm"):
        raise BadInput("a page that ends in .html", str(path), "rename it; a browser can print it")


def write_page(path: Path, title: str, parts: Sequence[object]) -> None:
    """Write a page, whole or not at all.

    Raises:
        RecordingFailed: The disk refused.
    """
    page = (
        f'{_FIRST.decode()}<html lang="en"><meta charset="utf-8"><title>{text(title)}</title>'
        '<meta name="viewport" content="width=device-width,initial-scale=1">'
        f"<style>{_STYLE}</style><body>{join(parts)}</body></html>\n"
    )
    write_whole(path, page)
