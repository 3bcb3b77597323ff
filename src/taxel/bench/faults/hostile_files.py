"""Make the files of an attacker: each is small on the disk and asks for more than anybody has.

`make_bundles` and its kin fill a folder; each file's name says what it is. For `taxel bench faults`
and the tests. Knows nothing about the commands that read them.
"""

from __future__ import annotations

import gzip
import hashlib
import io
import json
import os
import struct
import zipfile
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path

import lz4.frame

from taxel.bundles.envelope import FIRST_WORDS

GIB = 2**30
Edit = Callable[[bytes], bytes]


def sealed(body: bytes) -> bytes:
    """Return a zip as a bundle whose checksum holds."""
    return FIRST_WORDS + b"1 " + hashlib.sha256(body).hexdigest().encode() + b"\n" + body


def members_of(bundle: Path) -> dict[str, bytes]:
    """Return the members of an honest bundle."""
    with zipfile.ZipFile(bundle) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def zipped(members: Mapping[str, bytes]) -> bytes:
    """Return members as a zip."""
    body = io.BytesIO()
    with zipfile.ZipFile(body, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return body.getvalue()


def zeros_deflated(size: int) -> bytes:
    """Return so many zeros as a raw deflate stream: one block, packed once and repeated."""
    block = 2**24
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    packed = packer.compress(bytes(block)) + packer.flush(zlib.Z_FULL_FLUSH)
    return packed * (size // block) + packer.flush()


def zip_of_one(name: str, data: bytes, size: int) -> bytes:
    """Return a zip with one deflated member that says to be of a size."""
    word = min(size, 0xFFFFFFFF)
    extra = b"" if size < 0xFFFFFFFF else struct.pack("<HHQ", 1, 8, size)
    fields = (20, 0, 8, 0, 33, 0, len(data), word, len(name), len(extra))
    local = b"PK\3\4" + struct.pack("<5H3I2H", *fields) + name.encode() + extra + data
    central = b"PK\1\2" + struct.pack("<H", 20) + struct.pack("<5H3I2H", *fields)
    central += struct.pack("<3H2I", 0, 0, 0, 0, 0) + name.encode() + extra
    return (
        local
        + central
        + struct.pack("<4s4H2LH", b"PK\5\6", 0, 0, 1, 1, len(central), len(local), 0)
    )


def wav(size: int) -> bytes:
    """Return the head of a WAV file of 16-bit integers that claims so many bytes of them."""
    form = struct.pack("<4sIHHIIHH", b"fmt ", 16, 1, 1, 44_100, 88_200, 2, 16)
    return (
        b"RIFF" + struct.pack("<I", 2**32 - 1) + b"WAVE" + form + struct.pack("<4sI", b"data", size)
    )


def mat4(name: str, rows: int, columns: int, data: bytes = b"") -> bytes:
    """Return a variable of a .mat file of version 4 that claims a size."""
    return struct.pack("<5i", 0, rows, columns, 0, len(name) + 1) + name.encode() + b"\0" + data


def npy(head: str, data: bytes = b"") -> bytes:
    """Return a .npy file with a head of one's own."""
    text = head.encode("latin-1") + b"\n"
    return b"\x93NUMPY\1\0" + len(text).to_bytes(2, "little") + text + data


def sparse(path: Path, head: bytes = b"", size: int = 10 * GIB) -> None:
    """Write a file that says to be large and takes no room."""
    with path.open("wb") as file:
        file.write(head)
        file.truncate(size)


def rewritten(bundle: Path, name: str, edit: Edit) -> bytes:
    """Return a bundle with one member changed, its checksum right."""
    members = members_of(bundle)
    return sealed(zipped(members | {name: edit(members[name])}))


def json_with(**changes: object) -> Edit:
    """Return an edit of a contract: "window.stride" is written window__stride."""

    def edit(text: bytes) -> bytes:
        data = json.loads(text)
        for place, value in changes.items():
            *parts, last = place.split("__")
            inner = data
            for part in parts:
                inner = inner[part]
            inner[last] = value
        return json.dumps(data).encode()

    return edit


_LISTED = b"PK\1\2\x14\3\x14\0\0\0\x08\0"
"""How a deflated member begins in a zip's list: signature, versions, flags, method."""
DEEP = b'{"format":' + b"[" * 200_000 + b"]" * 200_000 + b"}"
LONG_NUMBER = b'{"format":' + b"9" * 1_000_000 + b"}"


def record(opcode: int, payload: bytes, length: int | None = None) -> bytes:
    """Return an MCAP record, which may lie about its length."""
    return struct.pack("<BQ", opcode, len(payload) if length is None else length) + payload


def chunk(content: bytes, size: int | None = None) -> bytes:
    """Return an MCAP chunk whose CRC holds."""
    packed = lz4.frame.compress(content)
    stated = len(content) if size is None else size
    head = struct.pack("<QQQII", 0, 0, stated, zlib.crc32(content), 3) + b"lz4"
    return record(6, head + struct.pack("<Q", len(packed)) + packed)


def records_of(recording: bytes) -> list[tuple[int, bytes]]:
    """Return the records of an honest recording."""
    at, found = 8, []
    while at < len(recording) - 8:
        opcode, length = struct.unpack_from("<BQ", recording, at)
        found.append((opcode, recording[at + 9 : at + 9 + length]))
        at += 9 + length
    return found


def first_content(recording: bytes) -> bytes:
    """Return what the first chunk of an honest recording holds."""
    payload = next(payload for opcode, payload in records_of(recording) if opcode == 6)
    return bytes(lz4.frame.decompress(payload[43:]))


def with_chunk(recording: bytes, content: bytes) -> bytes:
    """Return a recording whose first chunk holds something else."""
    records = records_of(recording)
    place = next(i for i, (opcode, _) in enumerate(records) if opcode == 6)
    return assembled(records[:place], chunk(content))


def assembled(records: list[tuple[int, bytes]], more: bytes = b"") -> bytes:
    """Return a recording of some records, ended as one ends; its check sums are left out."""
    magic = b"\x89MCAP0\r\n"
    body = b"".join(record(opcode, payload) for opcode, payload in records)
    end = record(15, bytes(4)) + record(2, bytes(20))
    return magic + body + more + end + magic


def make_bundles(folder: Path, honest: Path) -> None:
    """Write bundles that ask for memory, time or a traceback.

    Raises:
        MissingExtra: The package onnx is not installed.
    """
    from taxel.bench.faults.hostile_models import (
        endless_loop,
        long_work,
        outside_data,
        wide_product,
    )

    members = members_of(honest)
    size = 6 * GIB
    packed = zeros_deflated(size)
    write = {
        "member-of-6-gib": sealed(zip_of_one("model.onnx", packed, size)),
        "member-that-lies": sealed(zip_of_one("bundle.json", packed, 100)),
        "unneeded-6-gib": sealed(zip_of_one("extra.bin", packed, size)),
        "deep-json": rewritten(honest, "bundle.json", lambda _: DEEP),
        "long-number": rewritten(honest, "bundle.json", lambda _: LONG_NUMBER),
        "twice-named": rewritten(
            honest, "bundle.json", lambda text: text.replace(b"{", b'{"target":"x",', 1)
        ),
        "latin-json": rewritten(honest, "bundle.json", lambda text: text + "é".encode("latin-1")),
        "npy-bomb": rewritten(honest, "check_values.npy", lambda _: npy(
            "{'descr': '<f4', 'fortran_order': False, 'shape': (1000000, 1000000), }")),
        "npy-negative": rewritten(honest, "check_values.npy", lambda _: npy(
            "{'descr': '<f4', 'fortran_order': False, 'shape': (-1, 12, 12), }")),
        "npy-nested": rewritten(honest, "check_values.npy", lambda _: npy("(" * 9000)),
        "loop": sealed(zipped(members | {"model.onnx": endless_loop()})),
        "wide-product": sealed(zipped(members | {"model.onnx": wide_product()})),
        "long-work": sealed(zipped(members | {"model.onnx": long_work()})),
        "outside-data": sealed(zipped(members | {"model.onnx": outside_data()})),
        "no-model": sealed(zipped(members | {"model.onnx": b"\0" * 100})),
        "two-classes-fewer": rewritten(honest, "bundle.json", json_with(classes=["one"])),
        "classes-of-numbers": rewritten(honest, "bundle.json", json_with(classes=[1, 2, 3])),
        "steps-of-a-billion": rewritten(honest, "bundle.json", json_with(window__steps=10**9)),
        "stride-of-text": rewritten(honest, "bundle.json", json_with(window__stride="12 **/ x")),
        "nan-scaling": rewritten(
            honest, "bundle.json", json_with(scaling__offset=[float("nan")] * 12)
        ),
        "list-for-object": rewritten(honest, "bundle.json", lambda _: b"[1, 2]"),
        "encrypted": sealed(zipped(members).replace(_LISTED, _LISTED[:-4] + b"\1\0\x08\0")),
        "odd-packing": sealed(zipped(members).replace(_LISTED, _LISTED[:-2] + b"\x63\0")),
        "name-not-utf8": sealed(
            zipped(members).replace(_LISTED, _LISTED[:-4] + b"\0\x08\x08\0")
            .replace(b"bundle.json", b"bundle\xff\xfeson")
        ),
        "many-members": sealed(zipped({f"{i}": b"" for i in range(5000)})),
    }  # fmt: skip
    for name, data in write.items():
        (folder / f"{name}.taxel").write_bytes(data)
    sparse(folder / "sparse.taxel", FIRST_WORDS + b"1 " + b"0" * 64 + b"\n")


def make_recordings(folder: Path, honest: Path) -> None:
    """Write recordings that ask for memory, time or a traceback."""
    sound = honest.read_bytes()
    records = records_of(sound)
    head = [kept for kept in records if kept[0] in (1, 3, 4, 12)]
    mark = json.dumps({"start_s": 0, "end_s": 1, "labels": [1], "groups": {}}).encode()
    message = struct.pack("<HIQQ", 2, 0, 0, 0)
    write = {
        "labels-as-a-list": with_chunk(sound, record(5, message + mark)),
        "odd-tail": with_chunk(sound, first_content(sound) + b"\5\0\0"),
        "short-message": with_chunk(sound, record(5, b"\1")),
        "endless-length": assembled(head, record(6, b"", 2**63)),
        "lz4-bomb": assembled(head, chunk(bytes(31 * 2**20), 2**62)),
        "lz4-bomb-said-small": assembled(head, chunk(bytes(31 * 2**20), 100)),
        "deep-mark": with_chunk(sound, record(5, message + DEEP)),
        "long-number-mark": with_chunk(sound, record(5, message + LONG_NUMBER)),
        "nothing-but-heads": assembled(head, (b"\6" + bytes(36) + b"\3\0\0\0lz4") * 100_000),
    }
    for name, data in write.items():
        (folder / f"{name}.mcap").write_bytes(data)
    sparse(folder / "sparse.mcap", sound[: len(sound) // 2])
    sparse(folder / "sparse-zeros.mcap")


def make_tables(folder: Path) -> None:
    """Write tables that ask for memory or a traceback, each with an import table beside it."""
    block = gzip.compress(b"1,2,3\n" * 2**20, 9)
    (folder / "bomb.csv.gz").write_bytes(gzip.compress(b"t,a,b\n") + block * (2900 // 6))
    sparse(folder / "sparse.csv")
    sparse(
        folder / "sparse.npy", npy("{'descr': '<f8', 'fortran_order': False, 'shape': (3, 3), }")
    )
    (folder / "npy-bomb.npy").write_bytes(
        npy("{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000, 3), }")
    )
    (folder / "npy-nested.npy").write_bytes(npy("-" * 60_000 + "1"))
    sparse(folder / "sparse.wav", wav(2**32 - 2))
    (folder / "wav-lies.wav").write_bytes(wav(2**31))
    (folder / "one-line.csv").write_bytes(b"1," * (40 * 2**20))
    (folder / "open-quote.csv").write_bytes(b't,a,b\n0,1,"' + b"x\n" * 2**20)
    (folder / "nan.csv").write_bytes(b"t,a,b\n0,1,2\nnan,1,2\n")
    for file in sorted(path for kind in ("*.csv*", "*.npy", "*.wav") for path in folder.glob(kind)):
        npy_names = file.suffix == ".npy" or file.name in ("one-line.csv",)
        columns, time = ("2[V] 3[V]", "1[s]") if npy_names else ("a[V] b[V]", "t[s]")
        columns, time = ("*[FS]", "") if file.suffix == ".wav" else (columns, time)
        (folder / f"{file.name}.table").write_text(
            f"file,label:x,channels,time\n{file.name},y,{columns},{time}\n"
        )
    no_columns = mat4("X", 3, 2, bytes(48)) + mat4("y", 2**31 - 1, 0)
    (folder / "no-columns.mat").write_bytes(no_columns)
    (folder / "no-columns.mat.table").write_text(
        "file,trials,axes,label:x,channels,time\n"
        "no-columns.mat,X,trials channels,from:y,*[V],rate:9Hz\n"
    )
    (folder / "channels.csv").write_bytes(b"t,a\n0,1\n1,2\n")
    (folder / "many-words.table").write_text(
        f"file,label:x,channels,time\nchannels.csv,y,{'a ' * 60_000},t[s]\n"
    )


def make_others(folder: Path) -> None:
    """Write what is no file where a file is asked for."""
    os.mkfifo(folder / "pipe.taxel")
    os.mkfifo(folder / "pipe.mcap")
    os.mkfifo(folder / "pipe.json")
    (folder / "zero.taxel").symlink_to("/dev/zero")
    (folder / "zero.mcap").symlink_to("/dev/zero")
    (folder / "zero.json").symlink_to("/dev/zero")
    for name in ("pipes", "zeros"):
        (folder / name).mkdir()
    os.mkfifo(folder / "pipes" / "a.mcap")
    (folder / "zeros" / "a.mcap").symlink_to("/dev/zero")
    (folder / "folder.mcap").mkdir()
    (folder / "deep.json").write_bytes(DEEP)
    sparse(folder / "sparse.json")


def make_runs(folder: Path, code_folder: Path, run: Path) -> None:
    """Write runs whose JSON cannot be right, and runs whose metadata would become C code.

    Args:
        folder: Gets the former.
        code_folder: Gets the latter.
        run: An honest run.
    """
    about = json.loads((run / "run.json").read_text())
    edits: dict[str, object] = {
        "members-below-zero": about | {"members": -1},
        "members-of-a-billion": about | {"members": 10**9},
        "steps-of-a-billion": about
        | {
            "contract": about["contract"]
            | {"window": about["contract"]["window"] | {"steps": 10**9}}
        },
    }
    code: dict[str, object] = {
        "software-that-ends-a-comment": about
        | {"contract": about["contract"]
           | {"software": "taxel **//\n__attribute__((constructor)) void f(void) {}\n/*"}},
        "digest-of-code": about
        | {"contract": about["contract"] | {"data_digest": "*/ int x;" * 9}},
        "class-of-code": about
        | {"contract": about["contract"]
           | {"classes": ['a"\n#include "/etc/passwd"\n', "b", "c"]}},
    }  # fmt: skip
    places = {folder / name: data for name, data in edits.items()}
    places |= {code_folder / name: data for name, data in code.items()}
    for made, data in places.items():
        made.mkdir()
        for file in run.iterdir():
            (made / file.name).write_bytes(file.read_bytes())
        (made / "run.json").write_text(json.dumps(data))
    deep = folder / "deep-run"
    deep.mkdir()
    (deep / "run.json").write_bytes(DEEP)
