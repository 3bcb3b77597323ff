"""Every number that the TENG thesis claims of its own system, and which stored row answers it.

Knows the rows' names only; knows nothing about where rows are stored.

Source: Balapan, thesis, 2025 (TENG hand).
"""

from __future__ import annotations

from taxel.evaluation.cards.claims import (
    ABOVE_GATE,
    NOT_YET,
    RANDOM,
    SESSION,
    TRIVIAL,
    Claim,
    ClaimsOfPart,
    Link,
    table_row,
)
from taxel.evaluation.teng.table_4_1 import PUBLISHED, ROWS

_TWO_DIGITS = ("Precision", "Recall", "F1-Score")
"""Rows that the thesis prints with two digits."""


def thesis_parts() -> tuple[ClaimsOfPart, ...]:
    """Return the thesis's claims, in its order."""
    return (_thesis_text(), _thesis_table(), _thesis_field())


def _thesis_text() -> ClaimsOfPart:
    claims = []
    for model, task, where, claimed in (
        ("cnn2d", "shape", "abstract, 3.6.2, 5", "98 %"),
        ("cnn2d", "material", "abstract, 3.6.2, 5", "99 %"),
        ("cnn1d", "shape", "abstract, 3.5.2, 5", "94 %"),
        ("cnn1d", "material", "abstract, 5 (3.5.2 says 99 %)", "98 %"),
    ):
        name = f"{'2D' if model == 'cnn2d' else '1D'} CNN, {task}: accuracy"
        rows = ((preset, table_row(preset, task, RANDOM, model, "Test Accuracy"))
                for preset in ("paper", "honest"))  # fmt: skip
        claims.append(
            Claim(
                where=where,
                what=name,
                claimed=claimed,
                theirs=tuple(Link(row, preset, percent=True) for preset, row in rows),
                honest=(Link(_pooled(task, model), percent=True),),
            )
        )
    claims += [
        Claim(
            where="–",
            what=f"best trivial baseline on the same windows, {task}",
            claimed="none given",
            theirs=(Link(table_row("paper", task, RANDOM, *TRIVIAL), "paper", percent=True),
                    Link(table_row("honest", task, RANDOM, *TRIVIAL), "honest", percent=True)),
            honest=(Link(table_row("honest", task, SESSION, *TRIVIAL), percent=True),),
        )
        for task in ("shape", "material")
    ]  # fmt: skip
    claims.append(
        Claim(
            where="3.5.1, 3.6.1",
            what="samples of a shape that the threshold of 1.55 V keeps",
            claimed="31,000 of 160,000 (19 %)",
            theirs=(Link(ABOVE_GATE),),
            honest=(Link(ABOVE_GATE),),
            command="taxel simulate teng",
        )
    )
    return ClaimsOfPart(
        title="TENG hand: headline figures",
        about=(
            "Their split: windows at random, which is inferred, since the thesis names no split; "
            "on simulated recordings with one session a class (paper: our reading of “each shape's "
            "dataset”) and on harder ones (honest: six sessions, each object in "
            "each). Honest split: whole sessions held out, each of the six tested once. "
            "A network that does not clear the best trivial baseline has learned little."
        ),
        command="taxel reproduce table-4-1",
        claims=tuple(claims),
    )


def _pooled(task: str, model: str) -> str:
    return table_row("honest", task, SESSION, model, "all sessions tested once")


def _thesis_table() -> ClaimsOfPart:
    claims = []
    for model, values in PUBLISHED.items():
        short = "2D" if model == "cnn2d" else "1D"
        for row in ROWS:
            both = [
                tuple(Link(table_row("honest", task, split, model, row), task)
                      for task in ("shape", "material"))
                for split in (RANDOM, SESSION)
            ]  # fmt: skip
            claims.append(
                Claim(
                    where="Table 4.1, 4.3",
                    what=f"{short} CNN: {row}",
                    claimed=f"{values[row]:.{2 if row in _TWO_DIGITS else 4}f}",
                    theirs=both[0],
                    honest=both[1],
                )
            )
    return ClaimsOfPart(
        title="TENG hand: Table 4.1",
        about=(
            "The thesis does not say whether its values are of shape or of material: both are "
            "given. Their split: random windows, 20 % for the test and 20 % of the rest watched, "
            "as its figures fit (decision 42). Both columns are of the same simulated recordings, "
            "preset honest; only the split differs. Inference time: ours through ONNX Runtime, one "
            "window, one thread."
        ),
        command="taxel reproduce table-4-1",
        claims=tuple(claims),
    )


def _thesis_field() -> ClaimsOfPart:
    """Return what sections 4.3 and 4.4 claim beyond the table; rows are those of bench audit."""
    return ClaimsOfPart(
        title="TENG hand: beyond the laboratory (sections 4.3 and 4.4)",
        about=(
            "The thesis gives no split for these; windows of one grasp may stand on both sides. "
            "Ours hold whole sessions out. Rows of conditions, first our recogniser: gate 0.6 V, "
            "60 rows, three reference touches a session, trained with dust, moisture and "
            "movement. Then, as “thesis's”, the thesis's own setting on the same sessions: gate "
            "1.55 V, 12 rows, no reference touches, trained clean and still."
        ),
        command="taxel bench audit --full",
        claims=(
            Claim(
                where="4.3",
                what="unseen shapes and materials (elongated prism, rubber composite): "
                "recognition; ours after 5 grasps of them",
                claimed="above 90 %",
                honest=(
                    Link(f"sim honest, prism recognised after 5 grasps, {SESSION}", "prism"),
                    Link(f"sim honest, rubber recognised after 5 grasps, {SESSION}", "rubber"),
                ),
                why="a class that was never trained cannot be named; what can be asked is whether "
                "it is answered UNKNOWN, and recognised after a few grasps",
            ),
            Claim(
                where="4.3",
                what="last layer trained again for new classes; ours: accuracy of all classes "
                "after 5 grasps of the new one",
                claimed="faster, more accurate (no number)",
                honest=(
                    Link(f"sim honest, new shape from 5 grasps, {SESSION}", "shape"),
                    Link(f"sim honest, new material from 5 grasps, {SESSION}", "material"),
                ),
                why=NOT_YET,
            ),
            Claim(
                where="4.4",
                what="accuracy under all of these; ours at 23 °C, clean and still, new sessions",
                claimed="above 95 %",
                honest=_at_condition("23 °C, clean and still"),
                why=NOT_YET,
            ),
            *(
                Claim(
                    where=where,
                    what=f"{what}: accuracy; ours: points lost at worst",
                    claimed=claimed,
                    honest=_at_condition(f"{condition} *, points lost at worst"),
                    why=NOT_YET,
                )
                for where, condition, what, claimed in (
                    ("4.3", "moving", "moving objects (conveyor belt)", "robust (no number)"),
                    ("4.4", "temperature", "20 to 35 °C", "above 95 %"),
                    ("4.4", "dust", "dust on the objects", "above 95 %"),
                    ("4.4", "moisture", "moisture on the objects", "above 95 %"),
                )
            ),
            Claim(
                where="4.4",
                what="illumination that changes: accuracy",
                claimed="above 95 %",
                why="a triboelectric sensor sees no light; there is nothing to simulate",
            ),
            Claim(
                where="4.4",
                what="trials misclassified for altered surfaces or extreme temperature",
                claimed="below 3 %",
                why="the thesis does not say which trials are meant; 3 % and “above 95 %” disagree",
            ),
        ),
    )


def _at_condition(what: str) -> tuple[Link, ...]:
    """Return the rows of bench audit at one condition, by windows, in both settings."""
    return tuple(
        Link(f"sim, new sessions, {task} by windows, {setting}*: {what}", f"{label}{task}")
        for label, setting in (("", "wider training"), ("thesis's ", "the thesis's setting"))
        for task in ("shape", "material")
    )
