"""Small charts as SVG that take the page's colours, so that they suit light, dark and paper.

Knows nothing about runs or recordings.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from taxel.plain_text import short_names
from taxel.views.report.page import Html, colour, text

_LABELS = 200
"""Width left of a dot chart for names, pixels."""
_ROW = 22
_FEW = 4
"""Classes beyond which a matrix's headings stand upright."""
_WIDTH = 760
_LEAST = 600
"""Width below which a wide chart scrolls rather than shrinks, pixels."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """One line of a chart."""

    name: str
    x: Sequence[float]
    y: Sequence[float]
    low: Sequence[float] = ()
    """Lower ends of intervals, one a point, or none."""
    high: Sequence[float] = ()
    colour: str = ""
    """CSS colour; the page's next one unless given."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """One axis of a chart."""

    label: str
    low: float
    high: float
    ticks: Sequence[float] = field(default_factory=tuple)
    """Where figures stand; round ones unless given."""


@dataclass(frozen=True, slots=True)
class Dot:
    """One row of a dot chart."""

    name: str
    value: float
    low: float = math.nan
    high: float = math.nan
    colour: str = "var(--c0)"
    note: str = ""
    """Printed at the right, instead of the value."""


def dot_chart(dots: Sequence[Dot]) -> Html:
    """Return values of 0…1 as dots on one scale, with their intervals, a row each."""
    left, right = _LABELS, 110
    wide, high = _WIDTH - left - right, _ROW * len(dots)

    def at(value: float) -> float:
        return left + wide * min(max(value, 0.0), 1.0)

    parts = []
    for tick in _ticks(0.0, 1.0):
        x = at(tick)
        parts.append(_line(x, 4, x, high + 4, "var(--line)"))
        parts.append(_text(x, high + 18, f"{tick:g}", "middle", "soft"))
    for row, (dot, name) in enumerate(
        zip(dots, short_names([d.name for d in dots], 30), strict=True)
    ):
        y = _ROW * row + _ROW / 2 + 4
        parts.append(_text(left - 10, y + 4, name, "end"))
        if math.isfinite(dot.low):
            parts.append(
                f'<line x1="{at(dot.low):.1f}" y1="{y:.1f}" x2="{at(dot.high):.1f}" y2="{y:.1f}" '
                f'stroke="{dot.colour}" stroke-width="3" stroke-opacity=".45" '
                'stroke-linecap="round"/>'
            )
        if math.isfinite(dot.value):
            parts.append(
                f'<circle cx="{at(dot.value):.1f}" cy="{y:.1f}" r="4.5" fill="{dot.colour}"/>'
            )
        label = dot.note or (f"{dot.value:.3f}" if math.isfinite(dot.value) else "–")
        parts.append(_text(left + wide + 12, y + 4, label, "start", "soft"))
    return _svg(_WIDTH, high + 26, parts)


def line_chart(
    lines: Sequence[Line],
    x: Axis,
    y: Axis,
    *,
    diagonal: bool = False,
    size: tuple[int, int] = (480, 280),
    dots: bool = True,
) -> Html:
    """Return lines over one scale.

    Args:
        lines: What is drawn.
        x: The axis below.
        y: The axis at the left.
        diagonal: True draws where y equals x.
        size: Width and height, pixels.
        dots: False draws lines alone.
    """
    width, height = size
    left, right, top, bottom = 56, 14, 12, 44
    wide, high = width - left - right, height - top - bottom

    def place(a: float, b: float) -> tuple[float, float]:
        a, b = min(max(a, x.low), x.high), min(max(b, y.low), y.high)
        return (
            left + wide * (a - x.low) / ((x.high - x.low) or 1),
            top + high * (1 - (b - y.low) / ((y.high - y.low) or 1)),
        )

    parts = []
    for tick in y.ticks or _ticks(y.low, y.high):
        _, b = place(x.low, tick)
        parts += [
            _line(left, b, left + wide, b, "var(--line)"),
            _text(left - 8, b + 4, f"{tick:g}", "end", "soft"),
        ]
    for tick in x.ticks or _ticks(x.low, x.high):
        a, _ = place(tick, y.low)
        parts += [
            _line(a, top + high, a, top + high + 4, "var(--strong)"),
            _text(a, top + high + 17, f"{tick:g}", "middle", "soft"),
        ]
    parts.append(_line(left, top + high, left + wide, top + high, "var(--strong)"))
    if diagonal:
        (a, b), (c, d) = place(x.low, x.low), place(x.high, x.high)
        parts.append(_line(a, b, c, d, "var(--grey)", "4 4"))
    for index, line in enumerate(lines):
        parts += _drawn(line, line.colour or colour(index), place, dots)
    parts += [
        _text(left + wide / 2, height - 6, x.label, "middle", "soft"),
        f'<text transform="translate(13 {top + high / 2:.1f}) rotate(-90)" text-anchor="middle" '
        f'class="soft">{text(y.label)}</text>',
    ]
    return _svg(width, height, parts)


def strip(values: Sequence[float], width: int = 260) -> Html:
    """Return values as marks on a line from the least to the most."""
    low, high = min(values), max(values)
    span = (high - low) or 1.0
    marks = [
        f'<circle cx="{6 + (width - 12) * (value - low) / span:.1f}" cy="8" r="3.6" '
        'fill="var(--c0)" fill-opacity=".55"/>'
        for value in values
    ]
    return _svg(width, 16, [_line(6, 8, width - 6, 8, "var(--line)"), *marks])


def matrix(classes: Sequence[str], counts: Sequence[Sequence[int]]) -> Html:
    """Return a confusion matrix: rows true, columns predicted, shares of the true class."""
    many = len(classes) > _FEW
    kind = ' class="tall"' if many else ""
    heads = short_names(classes, 20 if many else 12)
    head = "".join(f"<th{kind}>{text(name)}</th>" for name in heads)
    rows = []
    for name, own in zip(short_names(classes, 20), counts, strict=True):
        total = sum(own) or 1
        cells = "".join(_cell(count, count / total) for count in own)
        rows.append(f"<tr><th>{text(name)}</th>{cells}</tr>")
    return Html(
        '<div class="scroll"><table class="matrix"><thead><tr>'
        "<th><small>true ↓ predicted →</small></th>"
        f"{head}</tr></thead><tbody>{''.join(rows)}</tbody></table></div>"
    )


def _cell(count: int, share: float) -> str:
    ink = "var(--page)" if share > 0.55 else "var(--ink)"
    back = f"color-mix(in srgb,var(--c0) {100 * share:.0f}%,var(--card))"
    cell = f"{share:.2f}<br><small>{count}</small>" if count else "·"
    return f'<td style="background:{back};color:{ink}">{cell}</td>'


def _drawn(line: Line, ink: str, place: object, dots: bool) -> list[str]:
    assert callable(place)
    points = [
        place(a, b)
        for a, b in zip(line.x, line.y, strict=True)
        if math.isfinite(a) and math.isfinite(b)
    ]
    parts = []
    ends = [
        (a, low, high)
        for a, low, high in zip(line.x, line.low or (), line.high or (), strict=False)
        if math.isfinite(low) and math.isfinite(high)
    ]
    if len(ends) > 1:
        upper = [place(a, high) for a, _, high in ends]
        lower = [place(a, low) for a, low, _ in ends]
        outline = " ".join(f"{a:.1f},{b:.1f}" for a, b in [*upper, *reversed(lower)])
        parts.append(f'<polygon points="{outline}" fill="{ink}" fill-opacity=".16"/>')
    path = " ".join(f"{a:.1f},{b:.1f}" for a, b in points)
    parts.append(
        f'<polyline points="{path}" fill="none" stroke="{ink}" stroke-width="2" '
        'stroke-linejoin="round"/>'
    )
    if dots:
        parts += [f'<circle cx="{a:.1f}" cy="{b:.1f}" r="3.4" fill="{ink}"/>' for a, b in points]
    return parts


def _ticks(low: float, high: float) -> list[float]:
    """Return four to eight round figures within the limits."""
    span = high - low
    if not span > 0:
        return [low]
    step = 10.0 ** math.floor(math.log10(span))
    for share in (1.0, 0.5, 0.2, 0.1):
        if span / (step * share) >= 4:
            step *= share
            break
    first = math.ceil(low / step - 1e-9)
    return [round(n * step, 10) for n in range(first, math.floor(high / step + 1e-9) + 1)]


def _svg(width: float, height: float, parts: Sequence[str]) -> Html:
    return Html(
        f'<svg viewBox="0 0 {width:g} {height:g}" width="{width:g}" role="img" '
        f'style="min-width:{min(width, _LEAST):g}px">'
        f"{''.join(parts)}</svg>"
    )


def _line(a: float, b: float, c: float, d: float, ink: str, dash: str = "") -> str:
    dashed = f' stroke-dasharray="{dash}"' if dash else ""
    return f'<line x1="{a:.1f}" y1="{b:.1f}" x2="{c:.1f}" y2="{d:.1f}" stroke="{ink}"{dashed}/>'


def _text(x: float, y: float, words: str, anchor: str, kind: str = "") -> str:
    shown = f' class="{kind}"' if kind else ""
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}"{shown}>{text(words)}</text>'
