"""A slip warning's score is not printed as if it were a probability."""

import pytest

from taxel.bundles.grasp import read_grasp_bundle
from taxel.bundles.shipped import shipped_bundle
from taxel.cli.main import main


@pytest.mark.parametrize(
    ("name", "probability"), [("slip-forecast", False), ("slip-rule", False), ("cup-pour", True)]
)
def test_a_bundle_says_whether_its_number_is_a_probability(name: str, probability: bool) -> None:
    assert read_grasp_bundle(shipped_bundle(name)).contract.gives_probability == probability


def test_a_forecasts_number_is_printed_as_a_score(capsys: pytest.CaptureFixture[str]) -> None:
    main(["live", "slip-forecast", "sim://cup-pour?speed=max", "--seconds", "1"])
    printed = capsys.readouterr().out

    assert "score(gross-slip)" in printed
    assert "P(gross-slip)" not in printed
