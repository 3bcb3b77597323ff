"""What a Rerun viewer gets of a station's rings; the package itself is not needed."""

from __future__ import annotations

from typing import Any

import numpy as np

from taxel.live.station.page_link import PageSeen, ViewConfig
from taxel.signals import Samples, SensorInfo, Validity
from taxel.views.rerun_bridge import _Bridge

HAND = SensorInfo(name="hand", channels=("a", "b"), units=("V", "V"), rate_hz=100.0)


class Viewer:
    """Keeps what is logged."""

    def __init__(self) -> None:
        self.logged: list[tuple[str, Any]] = []

    def set_time(self, name: str, duration: float) -> None:
        pass

    def Scalars(self, values: Any) -> Any:  # noqa: N802  # as rerun calls it
        return values

    def log(self, path: str, what: Any) -> None:
        self.logged.append((path, what))


def test_a_value_that_may_not_be_used_is_a_gap_and_no_zero():
    """Boards fill scans that never came with zeros, and flag them."""
    viewer = Viewer()
    bridge = _Bridge.__new__(_Bridge)
    bridge._rerun, bridge._row_s = viewer, [-np.inf]
    bridge._view = ViewConfig(
        sources=(PageSeen(url="", ring="", sensor=HAND, cameras=()),), decisions=(), status="",
        requests="", beats="", stall_s=0.1,
    )  # fmt: skip
    scans = Samples.from_values(np.array([[0.5, 0.0], [0.7, 0.2]]), np.array([0.0, 0.01]))
    scans.validity[0, 1] = Validity.MISSING
    bridge._log(0, 0, scans)
    rows = [values.tolist() for _, values in viewer.logged]
    assert np.isnan(rows[0][1])
    np.testing.assert_allclose([rows[0][0], *rows[1]], [0.5, 0.7, 0.2], rtol=1e-6)
