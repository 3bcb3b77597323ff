"""What was tried, kept beside the output, so that an interrupted choice goes on where it was.

Each try is stored as soon as it is done, under a digest of all that it depends on: windows,
classes, inner folds, candidate, software. Knows nothing about blends.
"""

from __future__ import annotations

import hashlib
import io
import json
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadFile
from taxel.foreign.archives import read_arrays
from taxel.held import sweep
from taxel.recordings.whole import write_whole
from taxel.training.choose.candidates import Candidate

if TYPE_CHECKING:
    from taxel.training.choose.part import Part


def tries_folder(output: Path) -> Path:
    """Return where tries are kept until the run is complete."""
    return output.with_name(f"{output.name}.tries")


class KeptTries:
    """A folder of tries; without one nothing is kept.

    Args:
        folder: Made with the first try.
        depends_on: Plain values that a try depends on besides windows and candidate.
    """

    def __init__(self, folder: Path | None, depends_on: Any) -> None:
        self.used = 0
        """Tries that were found done by an earlier run."""
        self._folder = folder
        self._older = set() if folder is None else {path.name for path in folder.glob("*.npz")}
        self._about = json.dumps(depends_on, sort_keys=True, default=str)

    def find(
        self, part: Part, candidate: Candidate, blocks: tuple[str, ...]
    ) -> tuple[NDArray[np.float64] | None, float]:
        """Return a candidate's logits and seconds where they were kept, else None."""
        if self._folder is None:
            return None, 0.0
        path = self._path(part, candidate, blocks)
        try:
            kept = read_arrays(path, ("logits", "seconds"))
            logits, seconds = kept["logits"], float(kept["seconds"][0])
        except (OSError, BadFile, KeyError, IndexError, ValueError):
            return None, 0.0
        if logits.shape != (int(part.scored.sum()), part.classes) or not np.isfinite(logits).all():
            return None, 0.0
        self.used += path.name in self._older
        return logits.astype(np.float64), seconds

    def keep(
        self,
        part: Part,
        candidate: Candidate,
        blocks: tuple[str, ...],
        logits: NDArray[np.float64],
        seconds: float,
    ) -> None:
        """Store a try, whole or not at all.

        Raises:
            RecordingFailed: The disk refused.
        """
        if self._folder is None:
            return
        content = io.BytesIO()
        np.savez(content, logits=logits, seconds=np.array([seconds]))
        write_whole(self._path(part, candidate, blocks), content.getvalue())

    def forget(self) -> None:
        """Remove all tries, and their folder where nothing else is in it."""
        if self._folder is None or self._folder.is_symlink():
            return
        with suppress(OSError):
            sweep(self._folder)
            for path in self._folder.glob("*.npz"):
                path.unlink()
            self._folder.rmdir()

    def _path(self, part: Part, candidate: Candidate, blocks: tuple[str, ...]) -> Path:
        assert self._folder is not None
        prepared = part.prepared
        digest = hashlib.sha256(self._about.encode())
        about = [
            asdict(prepared.dataset.config),
            prepared.dataset.digest,
            asdict(candidate),
            blocks,
        ]
        digest.update(json.dumps(about, sort_keys=True, default=str).encode())
        levels = prepared.dataset.to_level, prepared.dataset.tested_level
        arrays = (part.windows, part.fold, part.y, part.scored, *levels)
        for array in (own for own in arrays if own is not None):
            digest.update(np.ascontiguousarray(array).tobytes())
        return self._folder / f"{digest.hexdigest()[:32]}.npz"
