"""Names in figures and on the page: literal, whatever matplotlib or a browser would do."""

import json

import matplotlib
import numpy as np
import pytest

from taxel.plain_text import visible
from taxel.plotting import drawn_name, plt
from taxel.views.figures import plots as figures
from taxel.views.page.clients import to_json

NAMES = ("$x^$", "$\\frac{1}$", "a\x1b[2Jb", "_hidden", "\u202eb")


def test_a_name_with_dollars_is_no_formula_and_breaks_no_figure():
    matrix = [[1] * len(NAMES)] * len(NAMES)
    for png in (
        figures.confusion(NAMES, matrix, "$x^$"),
        figures.traces(np.arange(9.0), np.ones((9, len(NAMES)), np.float32), NAMES, "$N", "$x^$"),
        figures.accuracies(NAMES, [0.5] * len(NAMES), [(0.4, 0.6)] * len(NAMES), "$x^$"),
        figures.intensity_maps({name: np.ones((2, 2), np.float32) for name in NAMES}, "V"),
    ):
        assert png.startswith(b"\x89PNG")


def test_all_names_stand_in_a_legend():
    figure, axes = plt.subplots()
    for name in NAMES:
        axes.plot([0, 1], label=drawn_name(name))
    found = [text.get_text() for text in axes.legend().get_texts()]
    plt.close(figure)

    assert found == [drawn_name(name) for name in NAMES]
    assert matplotlib.rcParams["text.parse_math"] is False


@pytest.mark.parametrize("name", [*NAMES, "<script>", "\ud800"])
def test_the_page_gets_names_that_can_be_seen(name):
    message = json.loads(to_json({"array": {"channels": [name], name: 1.0}, "text": "plain"}))

    assert message == {"array": {"channels": [visible(name)], visible(name): 1.0}, "text": "plain"}
    assert message["array"]["channels"][0].isprintable()


def test_a_long_message_is_not_cut_as_a_name_is():
    message = "needed µ; " * 100

    assert json.loads(to_json({"reason": message}))["reason"] == message
