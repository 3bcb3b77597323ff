"""Claims about shifted and turned windows."""

from dataclasses import asdict

import pytest
import torch

from taxel.errors import BadInput
from taxel.training.augment import Augment

ALL_THERE = torch.ones(200, 12, dtype=torch.bool)


def changed(augment: Augment, values: torch.Tensor, mask: torch.Tensor = ALL_THERE) -> torch.Tensor:
    spread = torch.ones(values.shape[2])
    return augment.apply(
        values, mask[: len(values)], spread, values.shape[1], torch.Generator().manual_seed(0)
    )


def test_a_shift_in_time_moves_rows_and_repeats_the_edge() -> None:
    ramp = torch.arange(12.0)[None, :, None].expand(200, 12, 4)

    out = changed(Augment(shift_rows=2), ramp)

    found = {tuple(row.tolist()) for row in out[:, :, 0]}
    expected = {tuple(min(max(i - s, 0), 11) for i in range(12)) for s in range(-2, 3)}
    assert found == {tuple(map(float, row)) for row in expected}
    assert torch.equal(out[:, :, 0], out[:, :, 3])


def test_a_shift_in_time_stays_within_measured_rows() -> None:
    ramp = 1.0 + torch.arange(12.0)[None, :, None].expand(200, 12, 1)
    mask = (torch.arange(12) < 5).expand(200, 12)

    out = changed(Augment(shift_rows=3), ramp * mask.unsqueeze(2), mask)

    assert not out[:, 5:].any()
    assert out[:, :5].min() >= 1.0
    assert out[:, :5].max() == 5.0


def test_a_shift_across_the_hand_moves_whole_fingers() -> None:
    channel = torch.arange(12.0)[None, None, :].expand(200, 12, 12)

    out = changed(Augment(shift_fingers=1), channel)

    left, still, right = [3, 4, 5, 6, 7, 8, 9, 10, 11], list(range(12)), list(range(9))
    expected = {(*left, 9, 10, 11), tuple(still), (0, 1, 2, *right)}
    assert {tuple(map(int, row)) for row in out[:, 0]} == expected


def test_a_shift_across_the_hand_needs_whole_fingers() -> None:
    with pytest.raises(BadInput, match="fingers of 3"):
        changed(Augment(shift_fingers=1), torch.rand(2, 12, 8))


def test_a_quarter_turn_of_a_square_window_is_exact() -> None:
    """At the largest angle, drawn alone: the image's transpose, mirrored."""
    values = torch.rand(200, 12, 12)
    generator = torch.Generator().manual_seed(0)
    turn = 2.0 * torch.rand(200, generator=generator) - 1.0
    most = int(turn.abs().argmax())
    scale = 90.0 / float(turn.abs().max())

    out = changed(Augment(rotate_deg=scale), values)

    quarter = torch.rot90(values[most], 1 if turn[most] > 0 else -1)
    torch.testing.assert_close(out[most], quarter, atol=1e-4, rtol=0)


@pytest.mark.parametrize("shape", [(12, 12), (12, 4), (30, 12)])
def test_a_small_turn_moves_a_point_by_its_angle_in_cells(shape: tuple[int, int]) -> None:
    """A tilted plane stays a plane, turned: also where rows and channels are not as many."""
    rows, channels = shape
    down = (torch.arange(float(rows)) - (rows - 1) / 2)[:, None].expand(shape)
    across = (torch.arange(float(channels)) - (channels - 1) / 2).expand(shape)
    turn = 2.0 * torch.rand(200, generator=torch.Generator().manual_seed(0)) - 1.0
    angle = torch.deg2rad(10.0 * turn)[:, None, None]
    mask = torch.ones(200, rows, dtype=torch.bool)
    inner = (slice(None), slice(rows // 2 - 2, rows // 2 + 2), slice(1, channels - 1))

    for plane, expected in (
        (down, torch.cos(angle) * down + torch.sin(angle) * across),
        (across, torch.cos(angle) * across - torch.sin(angle) * down),
    ):
        out = changed(Augment(rotate_deg=10.0), plane.expand(200, *shape).contiguous(), mask)
        torch.testing.assert_close(out[inner], expected[inner], atol=1e-4, rtol=0)


def test_older_fields_draw_what_they_always_drew() -> None:
    """The new changes take no random number while they are off."""
    old = {k: v for k, v in asdict(Augment(noise=0.1, gain=0.2)).items()
           if k not in ("shift_rows", "rotate_deg", "shift_fingers", "phalanges")}  # fmt: skip
    values = torch.rand(20, 12, 12)
    generator = torch.Generator().manual_seed(0)
    gain = torch.exp(0.2 * torch.randn(20, 1, 1, generator=generator))
    expected = values * gain + 0.1 * torch.randn(20, 12, 12, generator=generator)

    torch.testing.assert_close(changed(Augment(**old), values), expected)
