"""Claims about the public data sets, on files made here and, where present, on the real ones."""

import gzip
import os
from pathlib import Path

import numpy as np
import pytest

from taxel.errors import BadTable
from taxel.recordings.imports.importing import import_rows
from taxel.recordings.imports.known import KNOWN, chain_sessions, glove_rows, icub_rows
from taxel.recordings.imports.value_tables.layouts import read_icub
from taxel.recordings.reader import read_recording

DATA = Path(os.environ.get("TAXEL_DATA", Path(__file__).parents[2] / "../shared/data"))


def test_pieces_that_follow_one_another_are_one_session():
    """The clock runs on from piece to piece; a long pause or an earlier stamp opens another."""
    files = [("a2", 20e3, 30e3), ("a1", 0.0, 10e3), ("late", 200e3, 210e3)]
    assert chain_sessions(files, 60.0) == {"a1": "a1", "a2": "a1", "late": "late"}


def test_overlapping_pieces_are_never_one_session():
    """One board cannot record two files at once."""
    files = [("a", 0.0, 50e3), ("b", 40e3, 90e3), ("c", 95e3, 99e3)]
    assert chain_sessions(files, 60.0) == {"a": "a", "b": "b", "c": "b"}


def test_a_piece_joins_the_session_that_ended_last():
    """Of two open sessions the nearer one is the likelier."""
    files = [("a", 0.0, 10e3), ("b", 5e3, 30e3), ("c", 35e3, 40e3), ("d", 36e3, 45e3)]
    assert chain_sessions(files, 60.0) == {"a": "a", "b": "b", "c": "b", "d": "a"}


def glove_file(path: Path, start_ms: int) -> None:
    header = "Timestamp," + ",".join(f"Data{i}" for i in (0, 1, 2, 3, 4, 6, 7, 8))
    rows = [f"{start_ms + 11 * i}," + ",".join(str(i + c) for c in range(8)) for i in range(20)]
    path.write_bytes(gzip.compress("\n".join([header, *rows]).encode()))


def test_a_glove_folder_becomes_recordings_with_sign_file_and_session(tmp_path):
    """Files of one sign are chained, those of different signs never."""
    for name, start_ms in (("B_1", 1000), ("B_2-b", 30_000), ("C_1", 60_000)):
        glove_file(tmp_path / f"{name}.csv.gz", start_ms)
    made = import_rows(glove_rows(tmp_path), tmp_path / "out")
    manifests = {path.stem: read_recording(path).manifest for path in made}
    assert manifests["B_2-b"].labels == {"sign": "B"}
    assert manifests["B_2-b"].groups == {"file": "B_2-b", "session": "B_1", "power_on": "B_1"}
    assert manifests["C_1"].groups["session"] == "C_1"
    assert manifests["C_1"].sensor.units == ("count",) * 5 + ("deg",) * 3


ICUB_STEP = [
    " ".join(str(100 + i) for i in range(9)),
    "1 2 3 4 5",
    *[" ".join(str(12 * finger + i) for i in range(12)) for finger in range(5)],
]


def test_an_icub_grasp_is_sixty_taxels_five_maxima_nine_encoders(tmp_path):
    """In the order of the fingers in the file."""
    (tmp_path / "cup_3.txt").write_text("\n".join(["-10000", *ICUB_STEP, *ICUB_STEP]) + "\n")
    (tmp_path / "full_coke_1.txt").write_text("left out")
    (made,) = import_rows(icub_rows(tmp_path), tmp_path / "out")
    recording = read_recording(made)
    assert recording.samples.values.shape == (2, 74)
    np.testing.assert_array_equal(
        recording.samples.values[1], [*range(60), *range(1, 6), *range(100, 109)]
    )
    assert recording.manifest.sensor.channels[12] == "index_1"
    assert recording.manifest.labels == {"object": "cup"}
    assert recording.manifest.groups["trial_number"] == "3"


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        (["-10000", *ICUB_STEP[:-1]], "cut short"),
        (["-10000"], "cut short"),
        (["-10000", *ICUB_STEP[:2], "1 2", *ICUB_STEP[3:]], "12 values; got 2 .*line 4"),
        (["-10000", "one", *ICUB_STEP[1:]], "line 2"),
    ],
)
def test_a_wrong_icub_file_is_one_plain_line(tmp_path, lines, words):
    """The line that is wrong is named."""
    (tmp_path / "cup_1.txt").write_text("\n".join(lines))
    with pytest.raises(BadTable, match=words):
        read_icub(tmp_path / "cup_1.txt")


@pytest.mark.parametrize("name", KNOWN)
def test_a_folder_without_the_data_set_is_one_plain_line(name, tmp_path):
    """The message says which files were looked for."""
    with pytest.raises(BadTable, match="--data"):
        KNOWN[name].rows(tmp_path)


@pytest.mark.real
@pytest.mark.skipif(not (DATA / "teng-glove").is_dir(), reason="no real glove recordings here")
def test_the_real_glove_imports_whole(tmp_path):
    """Ten signs; every file is in one session, and pieces of one session never overlap."""
    rows = glove_rows(DATA / "teng-glove")
    made = import_rows(rows[:6], tmp_path / "out")
    assert len({row.labels["sign"] for row in rows}) == 10
    assert all(len(read_recording(path).samples) > 1000 for path in made)
    sessions = {row.groups["session"] for row in rows}
    assert {row.groups["power_on"] for row in rows} <= sessions
    assert len(sessions) < len(rows)


@pytest.mark.real
@pytest.mark.skipif(not (DATA / "icub-grasp").is_dir(), reason="no real iCub recordings here")
def test_the_real_icub_grasps_import_whole(tmp_path):
    """Ten classes without the unreliable one, each with at least 20 grasps of 4 to 22 steps."""
    made = import_rows(icub_rows(DATA / "icub-grasp"), tmp_path / "out")
    recordings = [read_recording(path) for path in made]
    objects = [recording.manifest.labels["object"] for recording in recordings]
    assert len(set(objects)) == 10
    assert min(objects.count(name) for name in objects) >= 20
    assert {len(recording.samples) for recording in recordings} <= set(range(4, 23))
