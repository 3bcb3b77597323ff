"""Results that `taxel reproduce … --json` wrote to a file, as parts of a page.

Knows Table 4.1, Tables 1 to 3 of the grasp paper, warnings on unseen cups and slip on unseen
objects by their own fields; knows nothing about how they were measured.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from taxel.errors import BadInput
from taxel.evaluation.teng.table_4_1 import PUBLISHED, ROWS
from taxel.plain_text import number_of
from taxel.training.curves import curves_from_json
from taxel.views.report.amounts_part import amounts_part
from taxel.views.report.charts import Axis, Dot, Line, dot_chart, line_chart
from taxel.views.report.curves_part import curves_part
from taxel.views.report.page import (
    Html,
    band,
    figure,
    join,
    key,
    number,
    percent,
    split_name,
    table,
    tag,
)
from taxel.views.tables.grasps import TITLES
from taxel.views.tables.results import HEADINGS

Row = Mapping[str, Any]


def saved_part(data: Any, name: str) -> tuple[str, Html]:
    """Return a title and the tables of one saved result.

    Args:
        data: The parsed JSON.
        name: The file's name, for the message.

    Raises:
        BadInput: It is none of the results that are known.
    """
    try:
        if isinstance(data, dict) and {"rows", "baselines", "steps"} <= set(data):
            return "Grasp transitions: Tables 1 to 3", _transitions(data)
        if isinstance(data, dict) and {"rows", "crops_a_trial", "crop"} <= set(data):
            return f"Camera trials: {data['target']}", _trials(data)
        if isinstance(data, dict) and {"amounts", "split", "model"} <= set(data):
            return f"Accuracy against amount of data: {data['target']}", amounts_part(data)
        if isinstance(data, dict) and "curves" in data:
            curves = curves_from_json(data["curves"])
            with_gap = [curve for curve in curves if math.isfinite(curve.gap[0])]
            return f"Training: {Path(str(data['bundle'])).name}", curves_part(with_gap or curves)
        if isinstance(data, list) and data and {"events", "windows", "by"} <= set(data[0]):
            return "Warnings on unseen cups", _warnings(data)
        if isinstance(data, list) and data and {"columns", "preset"} <= set(data[0]):
            return "Table 4.1 of the TENG hand", join([_teng(entry) for entry in data])
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise BadInput(
            f"a whole result in {name}", "one that lacks parts", "write it again with --json"
        ) from error
    raise BadInput(
        f"what taxel evaluate-trials, learning-curve, train-monitor or taxel reproduce table-4-1, "
        f"transition-tables or grasp-warnings prints with --json in {name}",
        "something else",
        "write it again with: taxel reproduce … --json > FILE.json",
    )


def _transitions(data: Row) -> Html:
    steps = {step["model"]: step for step in data["steps"]}
    parts: list[object] = [
        tag(
            "p",
            f"Labels: rule {data['rule']}, {percent(data['unstable'], 0)} of frames unstable. "
            "“One cup out” is the paper's split (Zhao, Zheng and Chen, Sensors 2024, 24, 5080), "
            "its interval binomial over windows; “every cup” holds each out in turn, whole cups "
            "resampled. The paper's times are an RTX 4090's.",
        )
    ]
    if data["rule"] == "change":
        parts.append(
            tag(
                "p",
                "The paper's rule compares images with the first ones, so that a difference of "
                "pixels alone solves it (see the baselines): read these tables as parity with the "
                "paper, not as a warning of slip.",
                "note leaks",
            )
        )
    for table_number, title in TITLES.items():
        table_rows = [row for row in data["rows"] if table_number in row["plan"]["tables"]]
        if table_rows:
            parts += [
                tag("h3", title),
                _transition_table(table_rows, steps, times=table_number < 3),
            ]
        if table_number == 3 and len(table_rows) > 1:
            parts.append(_by_frames(table_rows))
    parts += [
        tag("h3", "Trivial baselines, same windows"),
        table(
            ["sees only", "one cup out", "every cup", "balanced"],
            [
                [
                    baseline["name"],
                    _scores(baseline["single"]),
                    _scores(baseline["every_cup"]),
                    percent(baseline["every_cup"]["balanced"]),
                ]
                for baseline in data["baselines"]
            ],
        ),
    ]
    return join(parts)


def _transition_table(rows: Sequence[Row], steps: Mapping[str, Row], *, times: bool) -> Html:
    head = ["model", "k", "weights", "paper", "one cup out", "every cup", "parameters"]
    head += ["ms, paper", "ms, ours", "MB, paper", "MB, ours"] if times else []
    cells = []
    for row in rows:
        plan, step = row["plan"], steps.get(row["plan"]["model"])
        own: list[object] = [
            plan["model"].replace("+", " + "),
            plan["frames"],
            row["weights"],
            tag("span", _of_hundred(plan["published"]), "published"),
            _scores(row["single"]),
            _scores(row["every_cup"]) if row["every_cup"] else "",
            f"{row['parameters']:,}",
        ]
        if times:
            own += [
                tag("span", number(row["published_ms"], 2), "published"),
                number(step["stream_ms"] if step else None, 2),
                tag("span", number(row["published_mb"], 1), "published"),
                number(row["size_mb"], 1),
            ]
        cells.append(own)
    return table(head, cells)


def _by_frames(rows: Sequence[Row]) -> Html:
    """Return Table 3 as curves over the frames in a window."""
    models = sorted({row["plan"]["model"] for row in rows})
    lines, entries = [], []
    paper: dict[int, float] = {}
    for index, model in enumerate(models):
        by_frames = sorted(
            (row for row in rows if row["plan"]["model"] == model),
            key=lambda row: int(row["plan"]["frames"]),
        )
        ink = f"var(--c{index % 6})"
        lines.append(
            Line(
                name=model,
                x=[row["plan"]["frames"] for row in by_frames],
                y=[row["single"]["accuracy"] for row in by_frames],
                low=[row["single"]["interval"][0] for row in by_frames],
                high=[row["single"]["interval"][1] for row in by_frames],
                colour=ink,
            )
        )
        entries.append((ink, f"{model}, one cup out"))
        published = {row["plan"]["frames"]: row["plan"]["published"] for row in by_frames}
        paper |= {k: value / 100 for k, value in published.items() if value is not None}
    if paper:
        lines.append(
            Line(name="paper", x=list(paper), y=list(paper.values()), colour="var(--grey)")
        )
        entries.append(("var(--grey)", "paper"))
    frames = sorted({row["plan"]["frames"] for row in rows})
    least = min([*(v for line in lines for v in (line.low or line.y)), 0.9])
    chart = line_chart(
        lines,
        Axis(label="frames in a window, k", low=frames[0], high=frames[-1], ticks=frames),
        Axis(label="accuracy", low=max(0.0, int(least * 20) / 20), high=1),
    )
    return figure(chart, key(entries))


def _warnings(rows: Sequence[Row]) -> Html:
    cells = [[row["name"], percent(row["windows"]["balanced"]), number(row["windows"]["auc"], 3),
              *_events(row["events"])] for row in rows]  # fmt: skip
    head = ["monitor", "balanced", "AUC", "lead, s: median [95 %]", "p5 … p95", "missed",
            "false alarms/min [95 %]", "early"]  # fmt: skip
    parts: list[object] = [
        tag(
            "p",
            "Warnings before the event, cups never seen. A lead below 0 came too late; false "
            "alarms are counted in runs that hold. Intervals: whole cups resampled "
            f"({number_of(rows[0]['events']['clusters'], 'cup')}); false alarms: exact Poisson.",
        ),
        table(head, cells),
    ]
    for name, groups in rows[0]["by"].items():
        parts += [
            tag("h3", f"{rows[0]['name']}, by {name}"),
            table(
                [name, "runs", "slips", *head[3:]],
                [[value, own["runs"], own["events"], *_events(own)]
                 for value, own in groups.items()],
            ),
        ]  # fmt: skip
    return join(parts)


def _events(own: Row) -> list[object]:
    low, high = own["lead_interval_s"]
    least, most = own["false_alarms_poisson"]
    return [
        f"{number(own['lead_median_s'], 2)} [{number(low, 2)}, {number(high, 2)}]",
        f"{number(own['lead_p5_s'], 2)} … {number(own['lead_p95_s'], 2)}",
        percent(own["missed_share"], 0),
        f"{number(own['false_alarms_per_min'], 2)} [{number(least, 2)}, {number(most, 2)}]",
        percent(own["early_share"], 0),
    ]


def _crop_words(data: Row) -> str:
    """Return what a crop is; results saved by older versions have crops of whole trials."""
    every = data.get("every", 1)
    words = number_of(data["crop"], "frame")
    if every > 1:
        words = f"{number_of(data['crop'], 'image')}, one in {every} frames,"
    moving = " of the part in which something moves" if data.get("of_moving_part") else ""
    return words + moving


def _trials(data: Row) -> Html:
    # What is not finite was saved as null: a figure that any row has is a column of all.
    names = dict.fromkeys(
        name for row in data["rows"] for name, value in row["trials"].items()
        if isinstance(value, float)
    )  # fmt: skip
    return join(
        [
            tag(
                "p",
                f"{number_of(data['trials'], 'trial')}, "
                f"{number_of(data['crops_a_trial'], 'crop')} of {_crop_words(data)} "
                f"each; {data['split']}, {number_of(data['folds'], 'fold')}.",
            ),
            table(
                ["name", *names],
                [[row["name"], *(number(row["trials"].get(name), 3) for name in names)]
                 for row in data["rows"]],
            ),
        ]
    )  # fmt: skip


def _teng(section: Row) -> Html:
    models = list(section["columns"])
    head: list[object] = ["metric"]
    for model in models:
        name = HEADINGS.get(model, model)
        head += [tag("span", f"{name}, thesis", "published")] if model in PUBLISHED else []
        head.append(f"{name}, ours")
    body = []
    for row in ROWS:
        cells: list[object] = [row]
        for model in models:
            if model in PUBLISHED:
                cells.append(tag("span", number(PUBLISHED[model][row]), "published"))
            cells.append(number(section["columns"][model]["rows"][row]))
        body.append(cells)
    dots = []
    for model in models:
        pooled = section["columns"][model]["pooled"]
        low, high = (float("nan") if end is None else float(end) for end in pooled["interval"])
        dots.append(Dot(HEADINGS.get(model, model), pooled["scores"]["accuracy"], low, high))
    dots += [Dot(name, value, colour="var(--grey)") for name, value in section["trivial"].items()]
    about = [
        f"{section['task']}, preset {section['preset']}, split: ", split_name(section["split"])
    ]  # fmt: skip
    return join(
        [
            tag("h3", join(about)),
            table(head, body),
            figure(
                dot_chart(dots),
                "Each window predicted once; 95 % CI over sessions. Grey: trivial baselines.",
            ),
        ]
    )


def _scores(row: Row) -> str:
    return f"{100 * row['accuracy']:.1f} {band(*row['interval'])}"


def _of_hundred(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}"
