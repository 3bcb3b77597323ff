"""An audit of cameras speaks of frames, and names all pairs of copies with two labels."""

from collections.abc import Callable

from taxel.evaluation.audit.audit import make_case
from taxel.evaluation.audit.copy_findings import shared_copies
from taxel.evaluation.audit.finding import Finding
from taxel.evaluation.audit.frame_words import as_frames
from taxel.evaluation.audit.touch_set import TouchSet


def test_rows_become_frames_in_sentences_and_not_in_names() -> None:
    finding = Finding(
        kind="duplicates", verdict="leak",
        message="Rows meet; one row of 4. Arrows and rowing stay.",
        mend="cut rows", examples=("two rows#0", "slip: 31 rows"),
    )  # fmt: skip
    found = as_frames(finding)
    assert found.message == "Frames meet; one frame of 4. Arrows and rowing stay."
    assert (found.mend, found.examples) == ("cut frames", ("two rows#0", "slip: 31 frames"))


def test_all_pairs_with_two_labels_are_named_with_them(
    make_set: dict[str, Callable[..., TouchSet]],
) -> None:
    """Others, though more alike, come after them."""
    touch = make_set["camera"]()
    case = make_case(touch, None, 10, 0)
    same = [(0, 16), (1, 17), (2, 18), (3, 19)]
    odd = [(4, 12), (5, 13), (6, 14), (7, 15)]
    pairs = {**dict.fromkeys(same, 1.0), **dict.fromkeys(odd, 0.9)}
    found = shared_copies(case, "duplicates", pairs, "hold the same rows")
    assert "(4 of 8 pairs with two different labels)" in found.message
    assert [example.split(" (")[0] for example in found.examples] == [
        f"r{a:02d}#0 [c0] and r{b:02d}#0 [c1]" for a, b in odd
    ]
    few = shared_copies(case, "duplicates", {**dict.fromkeys(same, 1.0), odd[0]: 0.9}, "meet")
    assert [example.split(" (")[0] for example in few.examples] == [
        "r04#0 [c0] and r12#0 [c1]", "r00#0 and r16#0", "r01#0 and r17#0",
    ]  # fmt: skip
