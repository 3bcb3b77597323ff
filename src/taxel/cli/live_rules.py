"""What `taxel live --rules` may be about: the classes of the bundles that recognise something."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from taxel.errors import BadInput

if TYPE_CHECKING:
    from taxel.bundles.signing import Trust


def known_classes(bundles: Sequence[Path], trust: Trust | None) -> dict[str, tuple[str, ...]]:
    """Return target → classes of every bundle that recognises something.

    Raises:
        BadInput: None does.
        BadBundle: One cannot be read, or is not signed by a key of `trust`.
    """
    from taxel.bundles.grasp import is_grasp_bundle
    from taxel.bundles.reader import read_contract
    from taxel.bundles.trials import is_trial_bundle, read_trial_contract

    known: dict[str, tuple[str, ...]] = {}
    for path in bundles:
        if is_grasp_bundle(path):
            continue
        read = read_trial_contract if is_trial_bundle(path) else read_contract
        contract = read(path, trust)
        more = (name for name in contract.classes if name not in known.get(contract.target, ()))
        known[contract.target] = (*known.get(contract.target, ()), *more)
    if not known:
        raise BadInput(
            "a bundle that names classes beside --rules", "a grasp monitor alone",
            "leave --rules out: what to do about a grasp is shown without it",
        )  # fmt: skip
    return known
