"""A network that sees the mean of rows: which rows count as measured."""

from __future__ import annotations

import torch

from taxel.models.blend import thinned


def test_the_mean_of_rows_is_measured_where_all_of_them_are():
    values = torch.arange(14.0).reshape(1, 7, 2)
    mask = torch.tensor([[True, True, True, False, True, True, True]])

    mean, measured = thinned(values, mask, 2)

    assert mean.tolist() == [[[1.0, 2.0], [5.0, 6.0], [9.0, 10.0]]]
    assert measured.tolist() == [[True, False, True]]
