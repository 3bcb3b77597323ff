"""A bundle knows the trials that it was trained on again, whichever camera saw which images."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from taxel.cli.main import main
from taxel.evaluation.camera_trials.learned_trials import fingerprints, trained_on
from taxel.windows.camera_trials import read_camera_trials


@pytest.mark.parametrize("order", ["ab", "ba"])
@pytest.mark.parametrize("imported", [False, True])
def test_a_trial_is_known_again_also_with_its_cameras_swapped(
    tmp_path: Path, order: str, imported: bool
) -> None:
    rng = np.random.default_rng(0)
    for name in ("a0", "b0", "a1", "b1"):
        np.save(tmp_path / f"{name}.npy", rng.integers(0, 255, (3, 24, 32, 3), np.uint8))
    for name, (left, right) in (("seen", "ab"), ("scored", order)):
        rows = [f"{left}{n}.npy,{right}{n}.npy,{'pq'[n]}" for n in range(2)]
        text = "\n".join(["left,right,label:kind", *(rows if name == "scored" else rows[:1])])
        (tmp_path / f"{name}.csv").write_text(text + "\n")
    scored = tmp_path / "scored.csv"
    if imported:
        main(["import", str(scored), "--output", str(tmp_path / "scored")])
        scored = tmp_path / "scored"
    seen = SimpleNamespace(learned=fingerprints(read_camera_trials(tmp_path / "seen.csv")))

    assert trained_on(seen, read_camera_trials(scored)) == (f"0001-{order[0]}0",)
