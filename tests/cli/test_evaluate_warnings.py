"""`taxel evaluate` with a bundle that watches grasps: what it takes, before anything is watched."""

from collections.abc import Callable
from pathlib import Path

import pytest

from taxel.cli.trial_verbs import verb_for_data


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "needed recordings to score slip-both-gels on; got none"),
        (["grasps", "--split", "group:object"], "--split, which would change nothing"),
        (["grasps", "--folds", "table.csv"], "a bundle of an array beside --folds"),
    ],
)
def test_what_a_warning_has_no_use_for_is_refused(
    words: list[str], message: str, refused: Callable[[list[str]], str]
) -> None:
    assert message in refused(["evaluate", "slip-both-gels", *words])


def test_recordings_of_cameras_beside_a_warning_are_no_camera_trials(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same folder is scored by evaluate-trials beside a bundle of camera trials, or alone."""
    monkeypatch.setattr("taxel.cli.trial_verbs.of_trials", lambda path: path == tmp_path)

    assert verb_for_data("evaluate", [str(tmp_path)]) == "evaluate-trials"
    assert verb_for_data("evaluate", ["slip-rule", str(tmp_path)]) == "evaluate"
