"""What recognisers told: each by itself, named so that a person can tell them apart."""

from typing import Any

from taxel.live.station.answers import Answers


def note(who: str, label: str) -> dict[str, Any]:
    return {"who": who, "target": "shape", "label": label, "grasp": label,
            "grasp_confidence": 0.9, "reason": ""}  # fmt: skip


def test_the_page_shows_one_bundle_on_two_hands_as_two() -> None:
    answers = Answers(
        [{"target": "shape", "bundle": "a.taxel", "who": f"monitor {n}/0"} for n in (1, 2)]
    )
    answers.add(note("monitor 2/0", "cube"))
    answers.add(note("monitor 1/0", "ball"))

    shown = [(answer["target"], answer["label"]) for answer in answers.newest()]
    assert shown == [
        ("shape (a.taxel, monitor 1/0)", "ball"),
        ("shape (a.taxel, monitor 2/0)", "cube"),
    ]
