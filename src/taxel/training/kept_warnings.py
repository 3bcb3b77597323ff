"""Forests grown on several threads, without a flood of warnings about that.

scikit-learn sets Python's warning filters anew around each tree. They belong to the whole process:
with trees on several threads some restore what others have just emptied. Then it warns at every
tree, and filters stay lost. Knows nothing about forests.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager

_LOST = "`sklearn.utils.parallel.delayed` should be used with"
"""How scikit-learn begins where it finds the filters empty. Source: its 1.9, `_FuncWrapper`."""


@contextmanager
def warnings_kept() -> Iterator[None]:
    """Keep this process's warning filters, whatever threads within do to them.

    Other warnings are given at the end. Threads must end within.
    """
    with warnings.catch_warnings(record=True) as caught:
        warnings.filterwarnings("ignore", _LOST, UserWarning)
        yield
    for warning in caught:
        if not str(warning.message).startswith(_LOST):
            warnings.warn_explicit(
                warning.message, warning.category, warning.filename, warning.lineno
            )
