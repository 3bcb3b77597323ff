"""An audit compares channel by channel: other channels are refused, as in training."""

from pathlib import Path

import numpy as np
import pytest

from taxel.errors import BadDataset
from taxel.evaluation.audit.one_sensor import check_cameras
from taxel.evaluation.audit.reading import read_both, read_touch
from taxel.recordings.imports.importing import import_table
from taxel.signals import CameraInfo


def make_set(folder: Path, name: str, channels: str) -> Path:
    """Import ten trials of two channels, named and ordered so, into a folder of their own."""
    rng = np.random.default_rng(0)
    lines = ["file,channels,time,label:kind"]
    for number in range(10):
        head = ",".join(own.partition("[")[0] for own in channels.split())
        rows = "".join(f"{a:.3f},{b:.3f}\n" for a, b in rng.normal(5.0, 1.0, (20, 2)))
        (folder / f"{name}{number}.csv").write_text(f"{head}\n{rows}")
        lines.append(f"{name}{number}.csv,{channels},rate:10Hz,{'xy'[number % 2]}")
    (folder / f"{name}.csv").write_text("\n".join(lines) + "\n")
    import_table(folder / f"{name}.csv", folder / name)
    return folder / name


@pytest.mark.parametrize("others", ["b[N] a[N]", "a[N] c[N]", "a[N] b[V]"])
def test_recordings_of_other_channels_are_refused(tmp_path: Path, others: str) -> None:
    first, second = make_set(tmp_path, "one", "a[N] b[N]"), make_set(tmp_path, "two", others)
    for file in second.glob("*.mcap"):
        file.rename(first / file.name)

    with pytest.raises(BadDataset, match=r"the channels a \[N\], b \[N\] in every recording"):
        read_touch(first, "kind", lambda *_: None)


def test_a_folder_to_test_on_with_channels_in_another_order_is_refused(tmp_path: Path) -> None:
    first, second = make_set(tmp_path, "one", "a[N] b[N]"), make_set(tmp_path, "two", "b[N] a[N]")

    with pytest.raises(BadDataset, match=r"the channels a, b in both folders; got b, a in the one"):
        read_both(first, second, "kind", lambda *_: None)
    assert len(read_both(first, make_set(tmp_path, "more", "a[N] b[N]"), "kind", print)[0]) == 20


def test_cameras_in_another_order_are_refused_and_others_in_their_place_are_not() -> None:
    left, right, thumb = (
        CameraInfo(name=name, width=32, height=24, rate_hz=25.0)
        for name in ("left", "right", "thumb")
    )
    check_cameras((left, right), (left, right), Path("b.mcap"))
    check_cameras((left, right), (thumb, right), Path("b.mcap"))

    with pytest.raises(BadDataset, match=r"left, right in this order .*; got right, left in b"):
        check_cameras((left, right), (right, left), Path("b.mcap"))
    with pytest.raises(BadDataset, match=r"2 cameras in every recording; got others in b\.mcap"):
        check_cameras((left, right), (left,), Path("b.mcap"))
