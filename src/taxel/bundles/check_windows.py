"""What a bundle's check windows must be, and must give, where it is opened.

Knows nothing about contracts, files or what the windows hold.
"""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from taxel.bundles.contract import LARGEST_DIFFERENCE
from taxel.errors import BadBundle


def other_windows(name: str, shape: tuple[int, ...], array: NDArray[Any]) -> BadBundle:
    """Return the error of a check array whose shape or kind of number is another.

    Args:
        name: What it holds, as "probabilities".
        shape: That it must have.
        array: The array as stored.
    """
    return BadBundle(
        f"check {name} of shape {shape}", f"{array.dtype} of shape {array.shape}",
        "write the bundle again with taxel bundle",
    )  # fmt: skip


def refuse_other_probabilities(difference: float) -> None:
    """Refuse a bundle that gives something else than when it was written.

    Args:
        difference: The largest of a probability on the check windows, as
            `taxel.bundles.engine.largest_difference` gives it; NaN is refused too.

    Raises:
        BadBundle: It is above `LARGEST_DIFFERENCE`.
    """
    if not difference <= LARGEST_DIFFERENCE:
        raise BadBundle(
            f"its check windows to give the stored probabilities within {LARGEST_DIFFERENCE:g}",
            f"a difference of {difference:.2g} on this machine",
            "write the bundle again here, or report this machine's processor",
        )
