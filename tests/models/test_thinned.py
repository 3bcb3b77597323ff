"""Networks that see the mean of rows: which rows count as measured, and which plans are read."""

from __future__ import annotations

import json
from dataclasses import asdict

import pytest
import torch

from taxel.errors import BadInput
from taxel.models.blend import Part, Plan, read_plan, thinned


def test_the_mean_of_rows_is_measured_where_all_of_them_are():
    values = torch.arange(14.0).reshape(1, 7, 2)
    mask = torch.tensor([[True, True, True, False, True, True, True]])

    mean, measured = thinned(values, mask, 2)

    assert mean.tolist() == [[[1.0, 2.0], [5.0, 6.0], [9.0, 10.0]]]
    assert measured.tolist() == [[True, False, True]]


@pytest.mark.parametrize("head", ["network:touchnet/0", "network:touchnet/21", "network:touchnet/",
                                  "network:touchnet/101", "network:touchnet/-1"])  # fmt: skip
def test_a_plan_whose_network_sees_no_whole_row_is_refused(head: str):
    """Windows have 20 rows: of these at most 20 can be one."""
    plan = Plan(20, (0,), 2, (Part(head, ()),))

    with pytest.raises(BadInput, match="a blend's plan"):
        read_plan(json.dumps(asdict(plan)).encode())


def test_a_plan_whose_network_sees_all_rows_as_one_is_read():
    plan = Plan(20, (0,), 2, (Part("network:touchnet/20", ()),))

    assert read_plan(json.dumps(asdict(plan)).encode()) == plan
