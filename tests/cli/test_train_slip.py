"""`taxel train-slip` refuses what cannot be meant before anything is simulated."""

import json
from pathlib import Path

import pytest

from taxel.bundles.grasp import read_grasp_bundle
from taxel.cli.main import main


@pytest.mark.parametrize(
    ("words", "needed"),
    [
        ("--cups 4", "needed --cups from 8 to 480; got 4"),
        ("--cups 481", "needed --cups from 8 to 480; got 481"),
        ("--false-alarms 0", "--false-alarms above 0"),
        ("--head rule --seed 3", "--seed"),
        ("--false-alarms-shear 0.4", "--gel both"),
        ("--gel both --false-alarms-shear 0", "--false-alarms-shear above 0"),
    ],
)
def test_what_cannot_be_meant_is_refused_in_one_line(
    words: str, needed: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = str(tmp_path / "slip.taxel")
    with pytest.raises(SystemExit) as ended:
        main(["train-slip", str(tmp_path / "poses"), "--output", output, *words.split()])

    assert ended.value.code == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert needed in line
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["trials.csv", "one/left.AVI", "a.mcap"])
def test_a_folder_of_recordings_is_not_filled_with_simulated_poses(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "data" / name
    file.parent.mkdir(parents=True)
    file.touch()
    with pytest.raises(SystemExit) as ended:
        main(["train-slip", str(tmp_path / "data"), "--output", str(tmp_path / "slip.taxel")])

    assert ended.value.code == 2
    assert f"which holds {file.name}; name a new one" in capsys.readouterr().err
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == [file]


@pytest.mark.slow
def test_both_gels_are_learned_from_and_the_rate_is_kept_on_each(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    poses, output = tmp_path / "poses", tmp_path / "slip.taxel"
    words = f"train-slip {poses} --gel both --cups 8 --output {output} --json"
    main([*words.split(), "--false-alarms", "2", "--false-alarms-shear", "3"])

    found = json.loads(capsys.readouterr().out)
    assert found["gel"] == "both"
    assert set(found["by_gel"]) == {"1", "2"}
    assert found["by_gel"]["1"]["events"]["clusters"] == 8
    for gel, most in (("1", 2.0), ("2", 3.0)):
        assert found["by_gel"][gel]["events"]["false_alarms_per_min"] <= most
    for name in ("images-0", "images-1", "images-other", "images-moving"):
        for gel in ("", "-gel-2"):
            assert len(list(poses.glob(f"*-{name}{gel}.npz"))) == 8
    contract = read_grasp_bundle(output).contract
    assert contract.features == "slip-rings"
    assert "missed on gel 2" in contract.measured
    assert "rigid gels and of layers" in contract.data_digest
