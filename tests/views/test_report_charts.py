"""Cells and charts of the page: escaped, and drawn where the numbers say."""

import re

from taxel.training.curves import Curve, Epoch
from taxel.views.report.charts import Axis, Dot, Line, dot_chart, line_chart, matrix
from taxel.views.report.curves_part import curves_part
from taxel.views.report.page import Html, band, percent, table, tag, text


def test_cells_and_captions_are_escaped_and_html_is_kept():
    assert "&lt;b&gt;" in table(["<b>"], [["<i>", Html("<u>x</u>")]])
    assert "<u>x</u>" in table([], [[Html("<u>x</u>")]])
    assert tag("p", "a & b") == "<p>a &amp; b</p>"
    assert text(Html("<p>")) == "<p>"
    assert percent(float("nan")) == percent(None) == "–"
    assert band(float("nan"), float("nan")) == ""
    assert band(1.0, 1.0) == "[all alike]"


def test_a_chart_places_points_where_its_axes_say():
    drawn = line_chart(
        [Line(name="a", x=[0, 10], y=[0, 1], low=[0, 0.5], high=[0.5, 1])],
        Axis(label="x", low=0, high=10),
        Axis(label="y", low=0, high=1),
        size=(480, 280),
    )
    (points,) = re.findall(r'<polyline points="([^"]+)"', drawn)

    assert points == "56.0,236.0 466.0,12.0"
    assert "<polygon" in drawn


def test_a_value_that_is_not_finite_is_left_out_of_a_chart():
    drawn = line_chart(
        [Line(name="a", x=[0, 1, 2], y=[0, float("nan"), 1])],
        Axis(label="x", low=0, high=2),
        Axis(label="y", low=0, high=1),
    )

    assert "nan" not in drawn
    row = dot_chart([Dot("a", float("nan"))])
    assert "nan" not in row
    assert ">–</text>" in row


def test_a_matrix_shows_shares_of_the_true_class():
    drawn = matrix(["a", "b"], [[3, 1], [0, 0]])

    assert "0.75<br><small>3</small>" in drawn
    assert "0.25<br><small>1</small>" in drawn


def test_a_gap_that_is_not_known_is_a_dash():
    """An epoch whose accuracy was not measured gave nan points."""
    curve = Curve("fold 1", (Epoch(1, 0.5, training_loss=0.4, validation_loss=0.6),))
    page = curves_part([curve])
    assert "nan" not in page
    assert "Gap after the last epoch: 0.200 nats, – points." in page
