"""What a calibration file says, as one HTML page and as lines for a terminal.

No script, no link to another file. Knows nothing about recordings or how figures were made.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from taxel.calibration.stored import shown_units
from taxel.plain_text import html_text, number_of
from taxel.recordings.whole import write_whole

Document = Mapping[str, Any]

_WIDE = ("curve", "hum ")
"""What columns begin with that a terminal has no room for."""
_NOTES = (
    "range N: from where the curve is three times the noise above rest (extrapolated where that is "
    "below the smallest press) to where 95 % of presses lie within half of the true force",
    "/N: slope at the middle force; hysteresis: falling less rising forces, share of the span",
    "rise: 10 to 90 %, gauge and sensor together; noise: rms at the full rate; hum: 50 and 60 Hz",
    "error N: mean error of presses held out, forces in the sensor's range; line N: the same of a "
    "straight line, the trivial baseline",
)
"""What the columns mean."""

_STYLE = """
body{font:15px/1.5 system-ui,sans-serif;max-width:1180px;margin:2rem auto;padding:0 1rem;
color:#1b1f24}
table{border-collapse:collapse;margin:.6rem 0 1.4rem;font-size:13px;
font-variant-numeric:tabular-nums}
th,td{padding:.2rem .55rem;border-bottom:1px solid #dde1e6;text-align:right;white-space:nowrap}
th:first-child,td:first-child{text-align:left}thead th{border-bottom:2px solid #8894a3}
.scroll{overflow-x:auto}figure{margin:1rem 0}img{max-width:100%}figcaption,small{color:#566170}
code{background:#f0f2f5;padding:.1rem .3rem;border-radius:3px}
@media(prefers-color-scheme:dark){body{background:#15181c;color:#e4e7eb}code{background:#272c33}
th,td{border-color:#343b44}img{background:#fff;border-radius:4px}}
"""


def columns(document: Document) -> list[str]:
    """Return the columns of the table of sensors, in the units of this array."""
    unit, small, _ = shown_units(document["sensor"]["units"])
    return [
        "sensor", "curve", "R²", "range N", f"{unit}/N", "hysteresis %", "repeat %",
        f"noise {small}", f"hum {small}", f"drift {small}/h", "rise ms", "error N", "line N",
    ]  # fmt: skip


def notes(document: Document) -> list[str]:
    """Return what the columns mean, in the units of this array."""
    unit, _, _ = shown_units(document["sensor"]["units"])
    return [unit + note if note.startswith("/N") else note for note in _NOTES]


def sensor_row(entry: Mapping[str, Any], factor: float) -> list[str]:
    """Return one sensor's cells, in the order of `columns`.

    Args:
        entry: The sensor's part of a calibration.
        factor: What small values are multiplied by, as `shown_units` gives it.
    """
    small, drift = ("{:.1f}", "{:+.0f}") if factor > 1 else ("{:.3g}", "{:+.3g}")
    rest, noise = entry["rest"], entry["noise"]
    errors = entry["errors"][-1] if entry["errors"] else None
    span = None
    if entry["curve"] is not None and entry["volts"]:
        span = max(entry["volts"])
    range_n = "–"
    if entry["largest_n"] is not None:
        range_n = f"{_below(entry)}{entry['smallest_n']:.2g} … {entry['largest_n']:.2g}"
    hysteresis = entry["hysteresis"]
    return [
        entry["channel"],
        "none"
        if entry["curve"] is None
        else ", ".join(f"{value:.3g}" for value in entry["curve"].values()),
        _text(entry["r2"], "{:.3f}"),
        range_n,
        _text(entry["sensitivity"][1][1] if entry["sensitivity"] else None, "{:.3g}"),
        _with_ends(
            hysteresis["mean_pct"], hysteresis["low_pct"], hysteresis["high_pct"], "{:+.1f}"
        ),
        _text(None if span is None else _share(entry["repeatability_v"], span), "{:.1f}"),
        _text(_times(noise["rms_v"], factor), small),
        " / ".join(_text(_times(noise[hum], factor), small) for hum in ("hum_50_v", "hum_60_v")),
        "–" if rest is None else _text(_times(rest["per_hour"], factor), drift),
        _text(_times(entry["rise_s"][0], 1000.0), "{:.0f}"),
        "–" if errors is None else _text(errors["curve_n"][0], "{:.3f}"),
        "–" if errors is None else _text(errors["line_n"][0], "{:.3f}"),
    ]


def narrow_table(document: Document) -> tuple[list[str], list[list[str]]]:
    """Return the columns that fit a terminal, and each sensor's cells; intervals are left out."""
    names = columns(document)
    *_, factor = shown_units(document["sensor"]["units"])
    rows = []
    for entry in document["channels"]:
        cells = dict(zip(names, sensor_row(entry, factor), strict=True))
        if entry["why_none"]:
            cells["range N"] = "no curve"
        cells["hysteresis %"] = cells["hysteresis %"].partition(" ")[0]
        rows.append([cell for name, cell in cells.items() if not name.startswith(_WIDE)])
    return [name for name in names if not name.startswith(_WIDE)], rows


def findings(document: Document) -> list[str]:
    """Return what holds for the whole array, one plain line each."""
    channels = document["channels"]
    pressed = [channel for channel in channels if channel["curve"] is not None]
    scores = document["form_scores_aicc"]
    others = ", ".join(f"{form} {score:.0f}" for form, score in scores.items())
    low, high = document["forces_n"]
    lines = [
        f"a curve for {len(pressed)} of {number_of(len(channels), 'sensor')}; form "
        f"{document['form']} "
        f"(AICc: {others}); forces {low:.2f} to {high:.2f} N, read at the press's "
        f"{document['measure']}"
    ]
    reasons: dict[str, list[str]] = {}
    for channel in channels:
        if channel["curve"] is None:
            reasons.setdefault(channel["why_none"], []).append(channel["channel"])
    lines += [f"no curve for {', '.join(names)}: {why}" for why, names in reasons.items()]
    for errors in document["errors"]:
        lines.append(
            f"error of held-out presses, {errors['split']} "
            f"({number_of(errors['presses'], 'press')}): "
            f"{_interval(errors['curve_n'])} N; straight line {_interval(errors['line_n'])} N"
        )
    for result in [document["at_one_force"], *document["references"]]:
        lines.append(_uniform(result))
    named = document["ghosts"]["named"]
    more = "; …" if len(named) > 6 else ""
    lines.append(f"ghosts above 0.5 %: {'; '.join(named[:6]) or 'none found with certainty'}{more}")
    lines += _louder(document)
    falls = [channel["fall_s"][0] for channel in pressed if channel["fall_s"][0] is not None]
    if falls:
        lines.append(
            f"under a constant force the signal decays with a time constant of "
            f"{1000 * min(falls):.0f} to {1000 * max(falls):.0f} ms"
        )
    back = [channel["recovery_s"][0] for channel in pressed if channel["recovery_s"][0] is not None]
    if back:
        lines.append(
            f"response 10 to 90 % and recovery 90 to 10 %, gauge included, medians: "
            f"{_spread([channel['rise_s'][0] for channel in pressed])} and {_spread(back)} ms"
        )
    floor = [
        channel["channel"] for channel in channels if (channel["noise"]["at_floor"] or 0.0) > 0.2
    ]
    if floor:
        lines.append(
            "at rest these read 0 in more than a fifth of the scans, which hides noise, drift "
            f"and small ghosts: {', '.join(floor)}"
        )
    lost = (
        sum(channel["saturated"] for channel in channels),
        sum(channel["unusable"] for channel in channels),
    )
    if any(lost):
        lines.append(
            f"left out: {number_of(lost[0], 'press')} of forces at which the converter is at "
            f"its end, {lost[1]} with unusable values"
        )
    return lines


def _louder(document: Document) -> list[str]:
    """Return a warning for each sensor beside which another channel surely responds more.

    Then the presses may be noted under the wrong name, and the curves are of something else.
    """
    names = [channel["channel"] for channel in document["channels"]]
    lines = []
    shares, errors = document["ghosts"]["share"], document["ghosts"]["error"]
    for row, (own, doubt) in enumerate(zip(shares, errors, strict=True)):
        surely = {
            column: share - 2.0 * error
            for column, (share, error) in enumerate(zip(own, doubt, strict=True))
            if column != row and share is not None and error is not None
        }
        most = max(surely, key=surely.__getitem__, default=row)
        if surely.get(most, 0.0) > 1.0:
            lines.append(
                f"warning: while {names[row]} is pressed, {names[most]} responds "
                f"{own[most]:.3g} times as much as {names[row]} itself: its curve may be of "
                f"another sensor; check the names in the presses, then whether {names[row]} is "
                "connected"
            )
    return lines


def _spread(seconds: list[float | None]) -> str:
    """Return the least and the largest of some times, milliseconds."""
    known = [1000.0 * value for value in seconds if value is not None]
    return f"{min(known):.0f} to {max(known):.0f}" if known else "–"


def write_page(path: Path, document: Document, command: str) -> None:
    """Write the page, whole or not at all.

    Args:
        path: The file to write.
        document: What the calibration file holds.
        command: What made it.

    Raises:
        RecordingFailed: The disk refused.
    """
    from taxel.calibration import figures

    sensor = document["sensor"]
    title = f"Sensors of {sensor['name']} {sensor['serial']}".strip()
    head = "".join(f"<th>{html_text(name)}</th>" for name in columns(document))
    *_, factor = shown_units(sensor["units"])
    body = "".join(
        "<tr>"
        + "".join(f"<td>{html_text(cell)}</td>" for cell in sensor_row(channel, factor))
        + "</tr>"
        for channel in document["channels"]
    )
    conditions = ", ".join(f"{k} {v}" for k, v in document["conditions"].items()) or "not known"
    sources = "; ".join(
        f"{source['source']}, {number_of(source['presses'], 'press')}"
        for source in document["made_from"]
    )
    parts = [
        f"<h1>{html_text(title)}</h1>",
        f"<p>{html_text(document['created'])}; {html_text(sources)}. "
        f"Conditions: {html_text(conditions)}.</p>",
        "<ul>"
        + "".join(f"<li>{html_text(finding)}</li>" for finding in findings(document))
        + "</ul>",
        f'<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>'
        "</div>",
        f"<p><small>{'. '.join(map(html_text, notes(document)))}.</small></p>",
        "<h2>Curves</h2>",
        _figure(figures.curves(document), "Values above the baseline over the gauge's newtons."),
        "<h2>Error on presses that were not fitted on</h2>",
        _figure(
            figures.errors_by_force(document),
            "Where the blue line meets the dotted one, the sensor gives no force.",
        ),
        "<h2>Uniformity</h2>",
        _figure(
            figures.uniformity(document),
            "Dashed: median. Red diamonds: named as outliers. Grey arrows: the converter was at "
            "its end, so the value says “at least”.",
        ),
        "<h2>Ghosts between channels</h2>",
        _figure(figures.ghosts(document), "Area of each channel while another one is pressed."),
        "<h2>At rest</h2>",
        _figure(figures.rest(document), "Noise and hum; drift with its 95 % interval."),
        f"<h2>How this was made</h2><p><code>{html_text(command)}</code></p>"
        f"<p><small>{html_text(document['software'])}; calibration "
        f"{document['sha256'][:12]}.</small></p>",
    ]
    page = (
        f'<!doctype html><html lang="en"><meta charset="utf-8"><title>{html_text(title)}</title>'
        '<meta name="viewport" content="width=device-width,initial-scale=1">'
        f"<style>{_STYLE}</style><body>{''.join(parts)}</body></html>\n"
    )
    write_whole(path, page)


def _uniform(result: Mapping[str, Any]) -> str:
    ends = sum(result["at_least"])
    if result["spread_pct"] is None:
        if not ends:
            return f"at {result['at']}: fewer than two channels to compare"
        return (
            f"at {result['at']}: {number_of(ends, 'channel')} at the converter's end, "
            "nothing to compare"
        )
    text = (
        f"at {result['at']}: channels alike within {_two_digits(result['spread_pct'])} % (standard "
        f"deviation), {_two_digits(result['range_pct'])} % from lowest to highest"
    )
    far = ", ".join(f"{name}" for name in result["outliers"])
    return text + (f"; far off, not counted: {far}" if far else "; none far off")


def _two_digits(number: float) -> str:
    return f"{number:.0f}" if number >= 100 else f"{number:.2g}"


def _figure(png: bytes, caption: str) -> str:
    data = base64.b64encode(png).decode()
    return (
        f'<figure><img alt="{html_text(caption)}" src="data:image/png;base64,{data}">'
        f"<figcaption>{html_text(caption)}</figcaption></figure>"
    )


def _below(entry: Mapping[str, Any]) -> str:
    """Return "≤ " where the smallest usable force is the curve's word alone."""
    return "≤ " if entry["smallest_n"] < min(entry["force_n"]) else ""


def _interval(interval: Sequence[float | None]) -> str:
    value, low, high = interval
    return f"{_text(value, '{:.3f}')} [{_text(low, '{:.3f}')}, {_text(high, '{:.3f}')}]"


def _with_ends(value: float | None, low: float | None, high: float | None, form: str) -> str:
    if value is None:
        return "–"
    return f"{form.format(value)} [{_text(low, form)}, {_text(high, form)}]"


def _text(value: float | None, form: str) -> str:
    return "–" if value is None else form.format(value)


def _times(value: float | None, factor: float) -> float | None:
    return None if value is None else factor * value


def _share(value: float | None, of: float) -> float | None:
    return None if value is None or of <= 0 else 100.0 * value / of
