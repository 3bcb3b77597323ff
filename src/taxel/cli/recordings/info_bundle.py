"""What `taxel info` says of a bundle: what it predicts, from what, how it was made and measured."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from taxel.bundles import contract as arrays
from taxel.bundles import grasp
from taxel.bundles.envelope import BundleKind, is_signed
from taxel.bundles.reader import read_contract
from taxel.decisions.recognition import RecogniseConfig
from taxel.decisions.trial_verdict import VerdictConfig
from taxel.labels.rules import RULES
from taxel.plain_text import number_of, visible

if TYPE_CHECKING:
    from taxel.bundles.trials import TrialContract

_CLASSES = 8
"""Classes that are named."""
_SHA256 = 64
"""Digits of a SHA-256 sum."""


def describe_bundle(path: Path, kind: BundleKind) -> tuple[dict[str, str], dict[str, Any]]:
    """Return a bundle's lines, name → text, and all of it as JSON holds it.

    Args:
        path: The file; its checksum is verified, its model is not opened.
        kind: What kind of bundle it is.

    Raises:
        BadBundle: It is damaged or of another format.
    """
    if kind == "array":
        contract = read_contract(path)
        lines, text = _array_lines(contract), arrays.contract_to_json(contract)
        software, digest = contract.software, contract.data_digest
    elif kind == "grasp":
        watch = grasp.read_grasp_contract(path)
        lines, text = _grasp_lines(watch), grasp.contract_to_json(watch)
        software, digest = watch.software, watch.data_digest
    else:
        from taxel.bundles import trials  # needs the extra of cameras

        trial = trials.read_trial_contract(path)
        lines, text = _trial_lines(trial), trials.contract_to_json(trial)
        software, digest = trial.software, trial.data_digest
    size, signed = path.stat().st_size, is_signed(path)
    signature = "with a signature, which is not checked here" if signed else "not signed"
    held = f"{path}, {size / 1e6:.2f} MB, checksum valid, {signature}"
    whole = {"bundle": held} | lines | {"trained on": _data(digest), "made by": software}
    data = {"path": str(path), "bytes": size, "kind": kind, "carries_signature": signed}
    return whole, data | {"contract": json.loads(text)}


def _array_lines(contract: arrays.Contract) -> dict[str, str]:
    window, units = contract.window, ", ".join(dict.fromkeys(contract.units))
    rate = contract.rate_hz if window.grid_hz is None else window.grid_hz
    touches = ", after reference touches" if contract.reference is not None else ""
    if window.level_follow is not None:
        touches = f", levels followed ({visible(window.level_follow)})"
    return {
        "predicts": _classes(contract.target, contract.classes),
        "from": f"{number_of(len(contract.channels), 'channel')} in {visible(units)}, windows of "
        f"{number_of(window.steps, 'scan')} at {rate:g} scans/s{touches}",
        "model": f"{visible(contract.model)}, {contract.parameters} parameters",
        "says UNKNOWN": _array_unknown(contract),
        "measured": _measured(contract.accuracy, "accuracy, ") + _chance(contract.classes),
    }


def _grasp_lines(contract: grasp.GraspContract) -> dict[str, str]:
    rule = RULES.get(contract.rule)
    kind = "probability" if contract.gives_probability else "score"
    source = contract.features + (f" ({contract.weights})" if contract.weights else "")
    return {
        "predicts": visible(contract.rule) + (f": {rule.summary}" if rule else ""),
        "from": f"{number_of(contract.cameras, 'tactile camera')}, "
        f"{contract.width}×{contract.height}, {contract.rate_hz:g} frames/s",
        "model": f"{visible(source)} + {visible(contract.head)}, {_frames(contract.frames)}",
        "warns": f"from a {kind} of {contract.stability.warn:.3f}, unstable from "
        f"{contract.stability.unstable:.3f}",
        "measured": _measured(
            contract.measured, where="on training cups held out, not test cups: "
        ),
    }


def _trial_lines(contract: TrialContract) -> dict[str, str]:
    return {
        "predicts": _classes(contract.target, contract.classes),
        "from": f"camera trials of {number_of(contract.cameras, 'camera')}, {contract.width}×"
        f"{contract.height}, {contract.rate_hz:g} frames/s; "
        f"{number_of(contract.places, 'crop')} of {contract.layout.words}"
        f"{' of the part in which something moves' * contract.moving}",
        "model": f"a blend of models on {', '.join(map(visible, contract.views))}"
        + (f" ({visible(contract.network)})" if contract.network else ""),
        "says UNKNOWN": _trial_unknown(contract),
        "measured": _measured(contract.measured, where="on trials held out: ")
        + _chance(contract.classes),
    }


def _array_unknown(contract: arrays.Contract) -> str:
    """Return when `taxel live` answers UNKNOWN, as `taxel.decisions.recognition.decide` has it."""
    config = RecogniseConfig()
    novel = "novel touch is not tested"
    if contract.unknown is not None:
        novel = f"touch more novel than {100 * (1 - contract.unknown.rejected):g} % of known"
    window = contract.window
    filled = window.fill if window.layout == "B" else 0.0
    gaps = f" beyond short gaps of {100 * filled:g} % of a window" if filled > 0 else ""
    motion = contract.motion
    frozen = motion is not None and motion.knows_frozen(window.steps)
    return (
        f"{_confidence(config.least_confidence)}; values missing, stale or NaN{gaps}; "
        f"a channel at the converter's limit; {'one scan repeated; ' if frozen else ''}{novel}"
    )


def _trial_unknown(contract: TrialContract) -> str:
    """Return the same of camera trials, as `taxel.decisions.trial_verdict.join_crops` has it."""
    novel = "novel touch is not tested"
    if contract.threshold is not None:
        novel = f"a novelty score above {contract.threshold:.3g}"
    short = f"fewer than {contract.layout.span} frames; " if contract.crop > 1 else ""
    return (
        f"{_confidence(VerdictConfig().least_confidence)}; {short}"
        f"a camera that is silent or stands still; {novel}"
    )


def _confidence(least: float) -> str:
    return f"confidence below {least:g} (--least-confidence)"


def _classes(target: str, classes: tuple[str, ...]) -> str:
    more = f" and {len(classes) - _CLASSES} more" if len(classes) > _CLASSES else ""
    return f"{visible(target)}: {', '.join(map(visible, classes[:_CLASSES]))}{more}"


def _measured(values: Mapping[str, float], before: str = "", where: str = "") -> str:
    found = "; ".join(f"{before}{visible(name)} {value:.3g}" for name, value in values.items())
    return where + found if found else "nothing was stored with it"


def _chance(classes: tuple[str, ...]) -> str:
    share = 1 / len(classes)
    return (
        f"; random guessing among {len(classes)} classes gives {share:.2f}, "
        "always naming the majority class may give more"
    )


def _data(digest: str) -> str:
    """Return what a bundle learned from: words, or recordings by the sum over their bytes."""
    whole = len(digest) == _SHA256 and set(digest) <= set("0123456789abcdef")
    return f"recordings with SHA-256 {digest[:12]}…" if whole else visible(digest)


def _frames(count: int) -> str:
    return "frame by frame" if count == 1 else f"{count} frames a window"
