"""Adapted bundles and runs keep what they were, whatever happens in between."""

import contextlib
import json
import os
import shutil
from pathlib import Path

import pytest

from taxel.bundles.versions import (
    Change,
    begin_history,
    history_path,
    kept_path,
    new_path,
    read_history,
    replace_with,
    roll_back,
)
from taxel.errors import BadInput


def put(path: Path, text: str, folder: bool) -> Path:
    if folder:
        path.mkdir()
        (path / "run.json").write_text(text)
    else:
        path.write_text(text)
    return path


def content(path: Path) -> str:
    return (path / "run.json" if path.is_dir() else path).read_text()


def adapt(path: Path, text: str, folder: bool) -> int:
    return replace_with(path, put(new_path(path), text, folder), Change(what=text)).number


@pytest.fixture(params=[False, True], ids=["bundle", "run"])
def folder(request: pytest.FixtureRequest) -> bool:
    return bool(request.param)


@pytest.fixture
def path(tmp_path: Path, folder: bool) -> Path:
    return put(tmp_path / ("run" if folder else "a.taxel"), "one", folder)


def test_what_was_never_adapted_has_one_version(path: Path) -> None:
    found = read_history(path)

    assert [version.number for version in found.versions] == [1]
    assert found.current == 1


def test_each_version_is_kept_and_knows_what_it_was_made_from(path: Path, folder: bool) -> None:
    assert adapt(path, "two", folder) == 2
    assert adapt(path, "three", folder) == 3

    found = read_history(path)
    assert content(path) == "three"
    assert [content(kept_path(path, number)) for number in (1, 2)] == ["one", "two"]
    assert found.current == 3
    assert found.version(3).parent == found.version(2).digest
    assert found.version(2).parent == found.version(1).digest
    assert found.version(2).change.what == "two"
    assert not new_path(path).exists()


def test_rolling_back_gives_the_same_bytes_and_keeps_the_later_version(
    path: Path, folder: bool
) -> None:
    adapt(path, "two", folder)
    adapt(path, "three", folder)

    assert roll_back(path).number == 2
    assert content(path) == "two"
    assert content(kept_path(path, 3)) == "three"
    assert roll_back(path, 3).number == 3
    assert content(path) == "three"
    assert roll_back(path, 1).number == 1
    assert (content(path), read_history(path).current) == ("one", 1)


def test_adapting_after_a_roll_back_goes_on_counting(path: Path, folder: bool) -> None:
    adapt(path, "two", folder)
    roll_back(path)

    assert adapt(path, "three", folder) == 3
    found = read_history(path)
    assert found.version(3).parent == found.version(1).digest
    assert content(kept_path(path, 2)) == "two"


@pytest.mark.parametrize("step", range(6))
def test_a_kill_at_any_step_loses_no_version(
    path: Path, folder: bool, step: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each rename and replacement in turn is the one before which the process ends."""
    adapt(path, "two", folder)
    put(new_path(path), "three", folder)
    calls = {"n": 0}

    def dying(real):  # type: ignore[no-untyped-def]
        def call(*args):  # type: ignore[no-untyped-def]
            calls["n"] += 1
            if calls["n"] > step:
                raise KeyboardInterrupt
            return real(*args)

        return call

    with monkeypatch.context() as patch:
        patch.setattr(os, "rename", dying(os.rename))
        patch.setattr(os, "replace", dying(os.replace))
        with contextlib.suppress(KeyboardInterrupt):
            replace_with(path, new_path(path), Change(what="three"))

    found = read_history(path)
    texts = {content(path)} | {content(path) for path in path.parent.glob(f"{path.stem}.v[0-9]*")
                               if path.suffix != ".json"}  # fmt: skip
    assert {"one", "two"} <= texts
    assert content(path) in ("two", "three")
    assert found.current == {"two": 2, "three": 3}[content(path)]


def test_a_version_whose_file_is_gone_cannot_come_back(path: Path, folder: bool) -> None:
    adapt(path, "two", folder)
    kept = kept_path(path, 1)
    kept.rename(kept.with_name("elsewhere"))

    with pytest.raises(BadInput, match="version 1"):
        roll_back(path)
    assert content(path) == "two"


def test_there_is_nothing_to_go_back_to_at_first(path: Path) -> None:
    with pytest.raises(BadInput, match="former version"):
        roll_back(path)


def test_another_name_says_what_it_was_made_from(path: Path, folder: bool) -> None:
    other = put(path.with_name("b" if folder else "b.taxel"), "two", folder)

    begin_history(other, path, Change(what="two", before={"all": 0.5}, after={"all": 0.9}))

    (version,) = read_history(other).versions
    assert version.parent == read_history(path).versions[0].digest
    assert version.change.after == {"all": 0.9}


def test_a_damaged_history_is_one_plain_line(path: Path, folder: bool) -> None:
    adapt(path, "two", folder)
    (path.parent / f"{path.stem}.versions.json").write_text("{")

    with pytest.raises(BadInput, match="damaged"):
        read_history(path)


def test_what_is_no_version_is_never_touched(path: Path, folder: bool) -> None:
    """Someone's own run stands where the first version would be kept, another's where the next."""
    own = put(kept_path(path, 1), "my own", folder)

    number = adapt(path, "two", folder)
    later = put(kept_path(path, number), "mine too", folder)
    adapt(path, "three", folder)

    found = read_history(path)
    assert (content(own), content(later), content(path)) == ("my own", "mine too", "three")
    assert roll_back(path).change.what == "two"
    assert content(path) == "two"
    assert roll_back(path).change.what == "found without a history"
    assert content(path) == "one"
    assert (content(own), content(later)) == ("my own", "mine too")
    assert content(kept_path(path, found.current)) == "three"


def test_something_put_where_a_version_goes_back_to_is_left_alone(path: Path, folder: bool) -> None:
    adapt(path, "two", folder)
    own = put(kept_path(path, 2), "my own", folder)

    roll_back(path)

    assert (content(own), content(path)) == ("my own", "one")
    assert content(kept_path(path, 3)) == "two"
    assert read_history(path).version(3).change.what == "two"


def test_moving_a_damaged_history_away_destroys_no_version(path: Path, folder: bool) -> None:
    adapt(path, "two", folder)
    history_path(path).unlink()

    assert adapt(path, "three", folder) == 3
    assert [content(kept_path(path, number)) for number in (1, 2)] == ["one", "two"]


def test_someones_own_folder_beside_a_missing_one_is_not_taken_for_a_kill(tmp_path: Path) -> None:
    put(tmp_path / "run.new", "my own", True)
    put(new_path(tmp_path / "run"), "left half-way", True)

    with pytest.raises(BadInput, match="no "):
        read_history(tmp_path / "run")
    assert (tmp_path / "run.new").exists()


def test_the_same_again_makes_no_version_and_rolling_back_goes_back(
    path: Path, folder: bool
) -> None:
    adapt(path, "two", folder)

    assert adapt(path, "two", folder) == 2
    assert len(read_history(path).versions) == 2
    assert not new_path(path).exists()
    assert roll_back(path).number == 1
    assert content(path) == "one"


def test_a_former_version_made_again_is_that_version(path: Path, folder: bool) -> None:
    adapt(path, "two", folder)
    adapt(path, "three", folder)

    assert adapt(path, "two", folder) == 2
    assert [version.number for version in read_history(path).versions] == [1, 2, 3]
    assert roll_back(path).number == 1
    assert content(kept_path(path, 3)) == "three"


def test_an_older_history_with_the_same_twice_still_goes_back(path: Path, folder: bool) -> None:
    adapt(path, "two", folder)
    stored = json.loads(history_path(path).read_text())
    again = dict(stored["versions"][1])
    stored["versions"].append(again | {"number": 3, "parent": again["digest"]})
    history_path(path).write_text(json.dumps(stored))
    shutil.copytree(path, kept_path(path, 2)) if folder else shutil.copy(path, kept_path(path, 2))

    assert roll_back(path).number == 1
    assert content(path) == "one"


@pytest.mark.parametrize(
    "wrong",
    [
        {"number": "2"}, {"number": "../2"}, {"number": True}, {"number": 0}, {"digest": 3},
        {"made": None}, {"change": "text"}, {"change": {"what": 1, "data": []}}, {"number": 1},
        {"change": {"what": "x", "data": [], "before": []}},
        {"change": {"what": "x", "data": [], "after": {"all": "0.5"}}},
    ],
)  # fmt: skip
def test_a_history_of_wrong_types_is_one_plain_line(path: Path, folder: bool, wrong: dict) -> None:
    adapt(path, "two", folder)
    stored = json.loads(history_path(path).read_text())
    stored["versions"][1] |= wrong
    history_path(path).write_text(json.dumps(stored))

    with pytest.raises(BadInput, match="damaged"):
        read_history(path)


def test_a_folder_is_found_from_inside_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = put(tmp_path / "run", "one", True)
    adapt(path, "two", True)
    monkeypatch.chdir(path)

    assert read_history(Path()).current == 2


def test_the_same_again_is_the_number_that_the_history_says(path: Path, folder: bool) -> None:
    """Something else stands where the version in use would be kept; it is not kept now."""
    adapt(path, "two", folder)
    put(kept_path(path, 2), "my own", folder)

    assert adapt(path, "two", folder) == read_history(path).current == 2
