"""Whatever is changed in a recording or a table, it is read or refused in taxel's own words."""

import gzip
import json
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import lz4.frame
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.data_stream import RecordBuilder
from mcap.records import Metadata
from mutations import DEEP, LONG, NUMBERS, changed_bytes, changed_json, changed_npy, changed_wav
from scipy.io import wavfile

from taxel.bench.faults.hostile_files import assembled, chunk, record, records_of
from taxel.clock import ManualClock
from taxel.errors import TaxelError
from taxel.labels.corrections import corrections_path, read_corrections
from taxel.recordings.imports.importing import ImportOptions, import_table
from taxel.recordings.manifest import Manifest, to_record
from taxel.recordings.mark_layout import encode_mark
from taxel.recordings.reader import iterate_frames, read_manifest, read_recording
from taxel.recordings.recovery import recover
from taxel.recordings.summary import summarise
from taxel.recordings.writer import Recorder
from taxel.signals import CameraInfo, Frame, Mark, Samples, SensorInfo
from taxel.sources.opening import open_source
from taxel.views.page.replay_index import read_index
from taxel.windows.config import WindowConfig
from taxel.windows.dataset import load_dataset

pytestmark = pytest.mark.data

FUZZ = settings(
    settings.get_profile("fuzz"),
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)
CHANNELS = 3
SENSOR = SensorInfo(
    name="teng", channels=("a", "b", "c"), units=("V",) * CHANNELS, rate_hz=100.0, full_scale=3.3,
    serial="1", details={"wiring": "one board", "reference_v": "3.3"},
)  # fmt: skip
CAMERA = CameraInfo(name="left", width=32, height=24, rate_hz=30.0, mm_per_px=0.1)
MARK = {"start_s": 50.0, "end_s": 50.2, "labels": {"grasp": "stable"}, "groups": {"cup": "1"}}


@pytest.fixture(scope="module")
def honest(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A recording of 60 scans, six frames and a mark, in three chunks."""
    path = tmp_path_factory.mktemp("honest") / "a.mcap"
    manifest = Manifest(
        sensor=SENSOR, cameras=(CAMERA,), labels={"shape": "sphere"}, groups={"session": "7"},
        created="2025-01-01T00:00:00+00:00", wall_anchor_ns=1_700_000_000_000_000_000,
    )  # fmt: skip
    with Recorder(path, manifest) as recorder:
        for part in range(3):
            number = np.arange(20 * part, 20 * part + 20)
            time_s = 50.0 + number / 100.0
            recorder.write(
                Samples(
                    values=np.random.default_rng(part).random((20, CHANNELS)).astype(np.float32),
                    counter=number.astype(np.int64), device_s=time_s, arrival_s=time_s,
                    fitted_s=time_s, validity=np.zeros((20, CHANNELS), np.uint8),
                )
            )  # fmt: skip
            for i in range(2):
                at = 50.0 + 0.2 * part + 0.05 * i
                recorder.frame(
                    Frame(camera=0, jpeg=b"\xff\xd8image", counter=2 * part + i, device_s=at,
                          arrival_s=at, fitted_s=at)
                )  # fmt: skip
            recorder.flush()
        recorder.mark(Mark(**MARK))
    return path.read_bytes()


def written(entry: Metadata) -> bytes:
    """Return a metadata record's payload."""
    builder = RecordBuilder()
    entry.write(builder)
    return bytes(builder.end()[9:])


@st.composite
def changed_manifest(draw: st.DrawFn) -> bytes:
    """Return a metadata record with one thing changed and its check sum right."""
    pairs = to_record(Manifest(sensor=SENSOR, cameras=(CAMERA,), labels={"x": "y"}))
    del pairs["crc32"]
    name = draw(st.sampled_from(sorted(pairs)))
    if name in ("sensor", "labels", "groups", "cameras"):
        pairs[name] = draw(changed_json(json.loads(pairs[name]))).decode()
    else:
        texts = ["", "1", "-1", "9" * 30, "9" * 19, "x", "1.5", "\0", "é"]
        pairs[name] = draw(st.sampled_from(texts))
    text = json.dumps(pairs, ensure_ascii=False, sort_keys=True)
    return written(Metadata("taxel", pairs | {"crc32": f"{zlib.crc32(text.encode()):08x}"}))


@st.composite
def changed_content(draw: st.DrawFn, content: bytes) -> bytes:
    """Return what a chunk holds, with scans, frames, marks or bytes changed."""
    kind = draw(st.sampled_from(("bytes", "mark", "time", "tail", "message")))
    if kind == "bytes":
        return draw(changed_bytes(content))
    if kind == "mark":
        text = draw(changed_json(MARK))
        return content + record(5, struct.pack("<HIQQ", 2, 0, 0, 0) + text)
    if kind == "time":  # a scan's fitted time: record head 9, message head 22, CDR 4
        time_s = float(draw(st.sampled_from([n for n in NUMBERS if isinstance(n, float)])))
        place = 35 + draw(st.integers(0, 3)) * 8
        return content[:place] + struct.pack("<d", time_s) + content[place + 8 :]
    if kind == "tail":
        return content + draw(st.binary(max_size=9))
    channel = draw(st.sampled_from((0, 1, 2, 3, 4, 65535)))
    body = draw(st.binary(max_size=120))
    return content + record(5, struct.pack("<HIQQ", channel, 0, 0, 0) + body)


def content_of(payload: bytes) -> bytes:
    return bytes(lz4.frame.decompress(payload[43:]))


@st.composite
def changed_recording(draw: st.DrawFn, honest: bytes) -> bytes:
    """Return a recording with one thing changed: a byte, a record, a chunk, or the manifest."""
    kind = draw(st.sampled_from(("bytes", "manifest", "manifest", "chunk", "chunk", "record")))
    if kind == "bytes":
        return draw(changed_bytes(honest))
    records = [record for record in records_of(honest) if record[0] not in (2, 15)]
    if kind == "manifest":
        payload = draw(changed_manifest())
        # Recovery would find the honest copy in the channel's record.
        kept = [(o, p) for o, p in records if o not in (4, 12)]
        return assembled([(12, payload), *kept])
    if kind == "chunk":
        places = [i for i, (opcode, _) in enumerate(records) if opcode == 6]
        place = draw(st.sampled_from(places))
        content = draw(changed_content(content_of(records[place][1])))
        packed = chunk(content)[9:]
        return assembled([*records[:place], (6, packed), *records[place + 1 :]])
    place = draw(st.integers(0, len(records) - 1))
    opcode, payload = records[place]
    match draw(st.sampled_from(("payload", "opcode", "remove", "twice", "length", "first"))):
        case "payload":
            records[place] = (opcode, draw(changed_bytes(payload)))
        case "opcode":
            records[place] = (draw(st.integers(0, 255)), payload)
        case "remove":
            del records[place]
        case "twice":
            records.insert(place, records[place])
        case "first":
            records.insert(0, records.pop(place))
        case "length":
            length = draw(st.sampled_from([0, 1, 2**31, 2**63, 2**64 - 1]))
            return assembled(records[:place], record(opcode, payload, length))
    return assembled(records)


def tried(read: Callable[[], Any]) -> Any:
    """Return what is read; None where it is refused in taxel's own words, on one line."""
    try:
        return read()
    except TaxelError as error:
        refused = str(error)
    assert "\n" not in refused, refused
    return None


def replayed(path: Path) -> int:
    """Return the scans and frames that a source gives of a recording, as fast as it can."""
    count = 0
    with open_source(f"replay://{path}?speed=max", ManualClock()) as source:
        for _ in range(60):
            count += len(source.read(0.0)) + len(source.frames()) + len(source.marks())
            if source.ended:
                break
    return count


@given(st.data())
@FUZZ
def test_a_recording_is_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, honest: bytes, data: st.DataObject
) -> None:
    path = tmp_path_factory.getbasetemp() / "fuzzed.mcap"
    path.write_bytes(data.draw(changed_recording(honest)))

    manifest = tried(lambda: read_manifest(path))
    recording = tried(lambda: read_recording(path))
    tried(lambda: list(iterate_frames(path)))
    row = tried(lambda: summarise(path))
    if row is not None:
        json.dumps(row)
    tried(lambda: replayed(path))
    tried(lambda: load_dataset(path, WindowConfig()))
    tried(lambda: load_dataset(path, WindowConfig(grid_hz=None, steps=2, stride=1, pad=True)))
    if manifest is not None:
        tried(lambda: read_index(path, manifest))
    mended = path.with_name("mended.mcap")
    if tried(lambda: recover(path, mended, overwrite=True)) is not None:
        read_recording(mended)  # what is recovered is sound
    if recording is not None:
        for mark in recording.marks:
            encode_mark(mark, 0, recording.manifest.wall_anchor_ns)


TABLE = "t,a,b,spare\n" + "".join(f"{10 * i},{i}.5,-{i},x\n" for i in range(6))
LYING = "\n".join(map(",".join, zip(*[line.split(",")[:3] for line in TABLE.split()], strict=True)))
LIST = "file,label:sign,group:session,channels,time,full_scale,sensor\n"
ROW = ["values.csv", "x", "1", "a[V] b[V]", "t[ms]", "3.3", "glove"]
CELLS = ["", " ", "nan", "inf", "-1", "0", "1e400", "9" * 400, "1_0", "1,5", "x", "a[V]",
         "a[V] a[V]", "[V]", "t[s]", "t[hours]", "1[s]", "rate:0Hz", "rate:1e9Hz",
         "rate:" + "9" * 400 + "Hz", "values.npy", "values.csv.gz", "none.csv",
         "../values.csv", ".", "/dev/zero", "a" * 300,
         "é\u0301", "\u202e", '"', "'", DEEP, LONG, "layout"]  # fmt: skip
VALUES = np.round(np.random.default_rng(0).random((6, 3)), 3)
VALUES[:, 0] = np.arange(6)


@st.composite
def changed_cells(draw: st.DrawFn, text: str) -> bytes:
    """Return a table's text with a cell, a line or its coding changed."""
    lines = [line.split(",") for line in text.splitlines()]
    for _ in range(draw(st.integers(1, 2))):
        row = draw(st.integers(0, len(lines) - 1))
        column = draw(st.integers(0, len(lines[row]) - 1)) if lines[row] else 0
        match draw(st.sampled_from(("cell", "cell", "drop", "more", "line", "twice"))):
            case "cell" if lines[row]:
                lines[row][column] = draw(st.one_of(st.sampled_from(CELLS), st.text(max_size=5)))
            case "drop" if lines[row]:
                del lines[row][column]
            case "more":
                lines[row].insert(column, draw(st.sampled_from(CELLS)))
            case "line":
                lines.insert(row, draw(st.sampled_from([[], [""], ["x"], ["#"], [",", ","]])))
            case "twice":
                lines.append(list(lines[row]))
    found = "\n".join(map(",".join, lines)).encode("utf-8", "surrogatepass")
    coding = draw(st.sampled_from(("utf-8",) * 8 + ("utf-16", "utf-32", "latin-1", "bytes", "cr")))
    if coding == "bytes":
        return draw(changed_bytes(found))
    if coding == "cr":
        return found.replace(b"\n", b"\r")
    return found if coding == "utf-8" else found.decode(errors="replace").encode(coding, "replace")


def npy_of(values: np.ndarray) -> bytes:
    import io

    raw = io.BytesIO()
    np.save(raw, values)
    return raw.getvalue()


def wav_of(values: np.ndarray) -> bytes:
    import io

    raw = io.BytesIO()
    wavfile.write(raw, 100, values.astype(np.float32))
    return raw.getvalue()


@given(st.data())
@FUZZ
def test_tables_are_imported_or_refused(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    folder = tmp_path_factory.getbasetemp() / "tables"
    folder.mkdir(exist_ok=True)
    what = data.draw(
        st.sampled_from(
            ("list", "csv", "csv", "gz", "npy", "npy", "wav", "wav", "lying", "intervals")
        )
    )
    row = dict(zip(LIST.strip().split(","), ROW, strict=True))
    content = {"values.csv": TABLE.encode(), "values.npy": npy_of(VALUES)}
    intervals = b"start_s,end_s,label:x\n0,0.02,a\n0.03,0.05,b\n"
    if what == "csv":
        content["values.csv"] = data.draw(changed_cells(TABLE))
    elif what == "gz":
        packed = gzip.compress(TABLE.encode())
        content["values.csv.gz"] = data.draw(changed_bytes(packed))
        row["file"] = "values.csv.gz"
    elif what == "npy":
        content["values.npy"] = data.draw(changed_npy(content["values.npy"]))
        row |= {"file": "values.npy", "channels": "2[V] 3[V]", "time": "1[s]"}
    elif what == "wav":
        content["values.wav"] = data.draw(changed_wav(wav_of(VALUES)))
        row |= {"file": "values.wav", "channels": data.draw(st.sampled_from(("", "3[V] 1[V]"))),
                "time": ""}  # fmt: skip
    elif what == "lying":
        content["values.csv"] = data.draw(changed_cells(LYING))
        time = data.draw(st.sampled_from(("t[ms]", "1[ms]", "rate:9Hz")))
        row |= {"time": time, "axes": "channels rows"}
    elif what == "intervals":
        intervals = data.draw(changed_cells(intervals.decode()))
    table = ",".join(row) + "\n" + ",".join(row.values()) + "\n"
    content["list.csv"] = data.draw(changed_cells(table)) if what == "list" else table.encode()
    for name, own in content.items():
        (folder / name).write_bytes(own)
    (folder / "intervals.csv").write_bytes(intervals)

    made = tried(
        lambda: import_table(
            folder / "list.csv", folder / "out",
            intervals=folder / "intervals.csv" if what == "intervals" else None,
            options=ImportOptions(
                overwrite=True, missing=data.draw(st.sampled_from(("refuse", "keep")))
            ),
        )
    )  # fmt: skip

    for path in made or ():
        assert len(read_recording(path).samples) > 0  # what is imported can be read
        path.unlink()


STORED = {"format": 1, "recording": "a.mcap", "corrections": [
    {"rule": "change", "onset_s": 0.5, "author": "me", "note": ""}]}  # fmt: skip


@given(text=st.one_of(changed_json(STORED), changed_bytes(json.dumps(STORED).encode())))
@settings(FUZZ, max_examples=FUZZ.max_examples // 4)
def test_corrections_are_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, text: bytes
) -> None:
    recording = tmp_path_factory.getbasetemp() / "corrected.mcap"
    corrections_path(recording).write_bytes(text)

    tried(lambda: read_corrections(recording, 2.0))


def test_the_honest_recording_is_read(honest: bytes, tmp_path: Path) -> None:
    """Otherwise nothing above would be tried."""
    path = tmp_path / "a.mcap"
    path.write_bytes(
        assembled([record for record in records_of(honest) if record[0] not in (2, 15)])
    )

    assert len(read_recording(path).samples) == 60
    assert len(list(iterate_frames(path))) == 6
    assert replayed(path) > 60
