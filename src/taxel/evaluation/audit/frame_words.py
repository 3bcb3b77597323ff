"""An audit of cameras in a camera's words: what is a row of an array is a frame there.

Knows nothing about what was looked for.
"""

from __future__ import annotations

import re
from dataclasses import replace

from taxel.evaluation.audit.finding import Finding

_ROW = re.compile(r"\b([Rr])ow(s?)\b")
_COUNTED = re.compile(r"(?<=\d )rows$|(?<=of the )rows(?= in common)")


def as_frames(finding: Finding) -> Finding:
    """Return a finding whose sentences speak of frames; names among its examples stay as they are.

    Args:
        finding: Of cameras, in the words of arrays.
    """
    return replace(
        finding,
        message=_ROW.sub(_frame, finding.message),
        mend=_ROW.sub(_frame, finding.mend),
        examples=tuple(_COUNTED.sub("frames", example) for example in finding.examples),
    )


def _frame(found: re.Match[str]) -> str:
    return f"{'F' if found[1] == 'R' else 'f'}rame{found[2]}"
