"""Do the same with several values at once: the first here, each other in a thread of its own.

Of use where the work lets go of the interpreter, as decoding and models do. Knows nothing about
what is done.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

Value = TypeVar("Value")
Result = TypeVar("Result")


class SideBySide:
    """Threads that wait for work; they start with the first that there is.

    Args:
        most: Values at once, at least 1; more of them follow as threads are free.
    """

    def __init__(self, most: int) -> None:
        self._pool = ThreadPoolExecutor(most - 1, "taxel beside") if most > 1 else None

    def map(self, do: Callable[[Value], Result], values: Sequence[Value]) -> list[Result]:
        """Return what `do` gives for each value, in their order.

        What it raises for the first of them is raised here, once all have ended.
        """
        if self._pool is None or len(values) < 2:
            return [do(value) for value in values]
        others = [self._pool.submit(do, value) for value in values[1:]]
        try:
            first = do(values[0])
        finally:
            for other in others:
                other.exception()
        return [first, *(other.result() for other in others)]
