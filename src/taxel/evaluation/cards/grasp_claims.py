"""Every number that the grasp-transition paper claims of its system, and which row answers it.

Knows the rows' names only; knows nothing about where rows are stored.

Source: Zhao, Zheng and Chen, Sensors 2024, 24, 5080.
"""

from __future__ import annotations

from taxel.evaluation.cards.claims import (
    EVERY_CUP,
    NOT_YET,
    ONE_CUP,
    STEP,
    STEP_SHARE,
    Claim,
    ClaimsOfPart,
    Link,
    grasp_row,
)
from taxel.models.transition import (
    FRAMES,
    PUBLISHED_BY_FRAMES,
    TRANSITION_MODELS,
    TransitionModel,
)

_STAND_IN = "efficientnet-lite0"
"""The backbone whose trained weights are at hand everywhere."""
_IMAGENET = "resnet50"
"""The backbone of the paper whose ImageNet weights are at hand."""
_NO_WEIGHTS = "its weights can be distilled (taxel distil), no row is stored yet"
_NOT_RUN = "its trained weights can be fetched, no row is stored yet"


def grasp_parts() -> tuple[ClaimsOfPart, ...]:
    """Return the paper's claims, in its order."""
    return (*_grasp_tables(), _grasp_text())


def _grasp_tables() -> tuple[ClaimsOfPart, ...]:
    first = [m for m in TRANSITION_MODELS.values() if m.published and m.head in
             ("lstm", "transformer")]  # fmt: skip
    second = [TRANSITION_MODELS[f"densenet121+{head}"] for head in ("lstm", "lstm2", "lstm4")]
    baselines = (
        "A difference of pixels alone predicts these labels (98.2 % and 98.1 %; its largest value "
        "in the window 98.7 % and 98.5 %; always naming the commonest class has 59.9 % and "
        "58.0 %). So accuracy here shows parity with the paper, not early warning of slip."
    )
    further = f"Splits, labels, weights, sizes and times are as in Table 1. {baselines}"
    about = (
        "Their split: one of five cups held out, simulated pours, the paper's labels (rule "
        f"change). Honest: every cup held out in turn. {baselines} ResNet50 has "
        "ImageNet weights (`taxel weights fetch resnet50`). Those of the paper's other three "
        "backbones are published on Keras' server only; here they are “distilled”: trained to "
        "give ResNet50's 1000 outputs on touch images of other objects (`taxel distil`), then "
        "frozen. The paper trained end to end; the backbones of three Transformers were trained "
        "so here too, with labels, on pours of 40 or 80 other cups (`taxel train-backbone`). A "
        "new head is trained in each split; it sees how much the outputs differ from those of "
        "the grasp at rest, averaged over the places of the image. `make paper-tables CARD=yes` "
        "makes all rows on a graphics card; without CARD=yes, students learn from smaller images, "
        "and no backbone is trained end to end. Where “Lite0” stands, EfficientNet-Lite0 "
        "(ImageNet) takes DenseNet121's place. Sizes: ours as 32-bit floats, then with the "
        "backbone twice and the head once, which is what the published sizes fit (decision 42). "
        "Times: the paper calls 31.84 ms both one inference step and a whole video; ours is a "
        "step of images at each backbone's own 224 × 224 pixels, whose outputs are averaged over "
        "places first."
    )
    command = "taxel reproduce transition-tables"
    third = tuple(
        Claim(
            where="Table 3",
            what=f"DenseNet121 + LSTM, k = {frames}: accuracy",
            claimed=f"{accuracy:.2f} %",
            why=_NO_WEIGHTS,
            theirs=_links("densenet121+lstm", frames, "lstm", ONE_CUP),
            honest=_links("densenet121+lstm", frames, "lstm", EVERY_CUP),
        )
        for frames, accuracy in PUBLISHED_BY_FRAMES.items()
    )
    return (
        ClaimsOfPart(title="Grasp transitions: Table 1", about=about, command=command,
             claims=tuple(c for m in first for c in _model_claims(m, "Table 1"))),
        ClaimsOfPart(title="Grasp transitions: Table 2, LSTM layers", about=further,
             command=command, claims=tuple(c for m in second for c in _model_claims(m, "Table 2"))),
        ClaimsOfPart(title="Grasp transitions: Table 3, frames in a window", about=further,
             command=command, claims=third),
    )  # fmt: skip


def _links(model: str, frames: int, head: str, split: str) -> tuple[Link, ...]:
    """Return the links of an accuracy: the backbone's own row, and our small backbone's."""
    names = [("", model)]
    if model.startswith("densenet121"):
        names.append(("Lite0", f"{_STAND_IN}+{head}"))
    return tuple(Link(grasp_row(name, frames, split), label) for label, name in names)


def _model_claims(model: TransitionModel, table: str) -> list[Claim]:
    published = model.published
    assert published is not None
    name = model.name.replace("+", " + ")
    step = (
        Link(grasp_row(model.name, FRAMES, STEP)),
        Link(grasp_row(model.name, FRAMES, STEP_SHARE), "share of this machine's limit"),
    )
    return [
        Claim(
            where=table,
            what=f"{name}: accuracy",
            claimed=f"{published.accuracy_percent:.2f} %",
            why=_NOT_RUN if model.backbone == _IMAGENET else _NO_WEIGHTS,
            theirs=_links(model.name, FRAMES, model.head, ONE_CUP),
            honest=_links(model.name, FRAMES, model.head, EVERY_CUP),
        ),
        Claim(
            where=table,
            what=f"{name}: parameters",
            claimed=f"{published.parameters:,}",
            ours=f"{model.parameters:,}",
        ),
        Claim(
            where=table,
            what=f"{name}: time of a step",
            claimed=f"{published.step_ms:.2f} ms",
            theirs=step,
            honest=step,
            why=NOT_YET,
            command="taxel bench transitions --full --only 'steps of Tables'",
        ),
        Claim(
            where=table,
            what=f"{name}: size",
            claimed=f"{published.size_mb:.2f} MB",
            ours=f"{model.size_mb():.2f} MB, twice {model.size_mb(backbones=2):.2f} MB",
        ),
    ]


def _grasp_text() -> ClaimsOfPart:
    lite = "rule change, EfficientNet-Lite0 + LSTM"
    warning = "slip warning, forecast"
    step = grasp_row("densenet121+lstm", FRAMES, STEP)
    return ClaimsOfPart(
        title="Grasp transitions: text",
        about=(
            "The paper's warning comes when the images begin to change. Ours is also measured "
            "against the true slip: a warning counts if it comes before the cup has slid 300 µm."
        ),
        command="taxel bench transitions --full",
        claims=(
            Claim(
                where="abstract, 5.2, 6",
                what="average accuracy on unseen objects",
                claimed="98.90 %",
                theirs=(Link(f"{lite}, {ONE_CUP}", "Lite0"),),
                honest=(Link(f"{lite}, {EVERY_CUP}", "Lite0"),),
            ),
            Claim(
                where="abstract, 5.2",
                what="inference, DenseNet121 + LSTM (RTX 4090; ours: two processor cores); called "
                "a step here and a whole video in 5.2; ours is a step",
                claimed="31.84 ms",
                theirs=(Link(step),),
                honest=(Link(step),),
            ),
            Claim(
                where="5.2, figure 8",
                what="instability is identified before slippage: median warning before gross slip",
                claimed="before (no number)",
                honest=(Link(f"{warning}: median lead before 300 um, cups never seen"),),
            ),
            Claim(
                where="5.2",
                what="false alarms while the grasp holds",
                claimed="not stated",
                honest=(Link(f"{warning}: false alarms"),),
            ),
            Claim(
                where="5.2",
                what="grasps avoided from failing by the warning in a person's hands",
                claimed="not tried by the paper",
                honest=(
                    Link("warning only, the person stops 0.5 s after it: preventable drops "
                         "prevented"),
                ),
            ),
        ),
    )  # fmt: skip
