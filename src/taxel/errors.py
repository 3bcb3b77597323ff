"""Every error that taxel raises on purpose, in one tree.

    TaxelError
    ├── BadInput (ValueError)          what was given cannot be used as it is
    │   ├── BadFile                    a file beyond the bounds of what is read
    │   ├── BadTable                   an import manifest or a table of values
    │   ├── BadRecording               a recording that cannot be read
    │   ├── BadDataset                 recordings that do not make a data set for this job
    │   ├── BadSplit                   a split that these trials cannot give
    │   ├── BadSource                  a source's address or what it delivers
    │   └── BadBundle                  a bundle that is damaged or does not fit
    ├── RecordingFailed (OSError)      the disk refused; latched by the writer
    ├── WorkerLost (RuntimeError)      a job ended each worker that it was given to
    └── MissingExtra (ImportError)     an optional package is not installed

Each message is one plain line that says what was needed, what was got and how
to mend it. The command line prints that line and ends with exit code 2.
Knows nothing about any stage.
"""

from __future__ import annotations

import os
from errno import EEXIST, ENOTDIR
from pathlib import Path


class TaxelError(Exception):
    """Base of all errors that taxel raises on purpose."""


class BadInput(TaxelError, ValueError):
    """What was given cannot be used; says needed, got and how to mend it.

    Args:
        needed: What would have been right, without a full stop.
        got: What was found instead, without a full stop.
        mend: What the reader can do about it, without a full stop.
    """

    def __init__(self, needed: str, got: str, mend: str) -> None:
        self.needed = needed
        self.got = got
        self.mend = mend
        # A name out of somebody's file may hold line ends; the message stays one line.
        super().__init__(" ".join(f"needed {needed}; got {got}; {mend}.".splitlines()))

    def __reduce__(self) -> tuple[type[BadInput], tuple[str, str, str]]:
        """Pickle by the constructor's arguments, so that a worker's error arrives whole."""
        return type(self), (self.needed, self.got, self.mend)


class BadFile(BadInput):
    """A file is not a plain file, too large, or nested or packed too deeply."""


class BadTable(BadInput):
    """An import manifest or a table of values cannot be read."""


class BadRecording(BadInput):
    """A recording is missing, damaged or of another kind."""


class BadDataset(BadInput):
    """The recordings do not make a data set for this job."""


class BadSplit(BadInput):
    """The trials cannot be split in the way that was asked for."""


class BadSource(BadInput):
    """A source's address is wrong, or it delivers what it should not."""


class BadBundle(BadInput):
    """A bundle is damaged, unsafe or does not fit its source."""


class RecordingFailed(TaxelError, OSError):
    """The disk refused a write; the recorder keeps raising this until it is closed."""


def not_written(
    path: object, error: OSError, mend: str = "make room or choose another place"
) -> RecordingFailed:
    """Return the error of a file or folder that the disk refused, or that would lie in a file."""
    got = error.strerror or str(error)
    if error.errno in (EEXIST, ENOTDIR):
        above = next(p for p in Path(str(path)).absolute().parents if os.path.lexists(p))
        if not above.is_dir():
            got, mend = f"{above}, which is no folder", mend.removeprefix("make room or ")
    return RecordingFailed(f"needed to write {path}; got {got}; {mend}.")


class WorkerLost(TaxelError, RuntimeError):
    """A job ended its worker each time, as one that takes more memory than there is does."""

    def __init__(self, job: str, fate: str, attempts: int) -> None:
        self._made_of = (job, fate, attempts)
        after = f" after {attempts} attempt{'s' * (attempts > 1)}" if attempts else ""
        super().__init__(
            f"needed a worker that completes {job}; got none{after}: {fate}; "
            "give it more memory, or fewer --workers."
        )

    def __reduce__(self) -> tuple[type[WorkerLost], tuple[str, str, int]]:
        """Pickle by the constructor's arguments, so that a worker's error arrives whole."""
        return type(self), self._made_of


class MissingExtra(TaxelError, ImportError):
    """An optional package is missing; the message names the extra to install."""

    def __init__(self, package: str, extra: str, purpose: str) -> None:
        self.package = package
        self.extra = extra
        self.purpose = purpose
        super().__init__(
            f"needed the package {package} for {purpose}; it is not installed; "
            f"run: pip install 'taxel[{extra}]'."
        )

    def __reduce__(self) -> tuple[type[MissingExtra], tuple[str, str, str]]:
        """Pickle by the constructor's arguments, so that a worker's error arrives whole."""
        return type(self), (self.package, self.extra, self.purpose)
