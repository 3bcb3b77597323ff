"""Claims about V4L2's structures: sizes, offsets, requests and constants are the kernel's."""

import ctypes
import shutil
import subprocess
from pathlib import Path

import pytest

from taxel.sources.cameras import v4l2_structs as v4l2

STRUCTS = {
    "v4l2_capability": v4l2.Capability,
    "v4l2_fmtdesc": v4l2.FormatDescription,
    "v4l2_pix_format": v4l2.PixFormat,
    "v4l2_format": v4l2.Format,
    "v4l2_captureparm": v4l2.CaptureParm,
    "v4l2_streamparm": v4l2.StreamParm,
    "v4l2_requestbuffers": v4l2.RequestBuffers,
    "v4l2_buffer": v4l2.Buffer,
    "v4l2_frmsizeenum": v4l2.FrameSize,
    "v4l2_frmivalenum": v4l2.FrameInterval,
}
OTHER_NAMES = {"steps": "stepwise", "request_fd": "request_fd"}
REQUESTS = (
    "QUERYCAP", "ENUM_FMT", "G_FMT", "S_FMT", "REQBUFS", "QUERYBUF", "QBUF", "DQBUF", "STREAMON",
    "STREAMOFF", "G_PARM", "S_PARM", "ENUM_FRAMESIZES", "ENUM_FRAMEINTERVALS",
)  # fmt: skip
CONSTANTS = {
    "V4L2_BUF_TYPE_VIDEO_CAPTURE": v4l2.VIDEO_CAPTURE,
    "V4L2_MEMORY_MMAP": v4l2.MMAP,
    "V4L2_FIELD_ANY": v4l2.FIELD_ANY,
    "V4L2_FRMSIZE_TYPE_DISCRETE": v4l2.DISCRETE,
    "V4L2_CAP_VIDEO_CAPTURE": v4l2.CAN_CAPTURE,
    "V4L2_CAP_STREAMING": v4l2.CAN_STREAM,
    "V4L2_CAP_DEVICE_CAPS": v4l2.HAS_DEVICE_CAPS,
    "V4L2_CAP_TIMEPERFRAME": v4l2.CAN_SET_RATE,
    "V4L2_BUF_FLAG_ERROR": v4l2.BUFFER_ERROR,
    "V4L2_BUF_FLAG_TIMESTAMP_MASK": v4l2.STAMP_MASK,
    "V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC": v4l2.STAMP_MONOTONIC,
    "V4L2_PIX_FMT_MJPEG": v4l2.MJPG,
    "V4L2_PIX_FMT_JPEG": v4l2.JPEG,
}


@pytest.mark.skipif(
    shutil.which("cc") is None or not Path("/usr/include/linux/videodev2.h").exists(),
    reason="needs a C compiler and the kernel's header",
)
def test_structures_and_numbers_are_those_of_the_kernels_header(tmp_path: Path):
    """Sizes, offsets of all fields, request numbers and constants, as a C compiler sees them."""
    ours, lines = {}, []

    def add(name: str, c: str, value: int) -> None:
        ours[name] = value
        lines.append(f'printf("{name} %llu\\n", (unsigned long long)({c}));')

    for name, kind in STRUCTS.items():
        add(name, f"sizeof(struct {name})", ctypes.sizeof(kind))
        for field, *_ in kind._fields_:
            place = OTHER_NAMES.get(field, field)
            if (name, field) != ("v4l2_frmsizeenum", "reserved"):
                add(
                    f"{name}.{field}",
                    f"offsetof(struct {name}, {place})",
                    getattr(kind, field).offset,
                )
    for name in REQUESTS:
        add(name, f"VIDIOC_{name}", getattr(v4l2, name))
    for name, value in CONSTANTS.items():
        add(name, name, value)
    source = tmp_path / "sizes.c"
    source.write_text(
        "#include <stdio.h>\n#include <stddef.h>\n#include <sys/time.h>\n"
        "#include <linux/videodev2.h>\nint main(void) {" + "\n".join(lines) + "return 0; }\n"
    )
    subprocess.run(["cc", "-o", tmp_path / "sizes", source], check=True)
    printed = subprocess.run(
        [tmp_path / "sizes"], check=True, capture_output=True, text=True
    ).stdout

    assert dict(line.rsplit(" ", 1) for line in printed.splitlines()) == {
        name: str(value) for name, value in ours.items()
    }


def test_structures_are_those_of_an_independent_library():
    raw = pytest.importorskip("linuxpy.video.raw")
    for name, kind in STRUCTS.items():
        assert ctypes.sizeof(kind) == ctypes.sizeof(getattr(raw, name)), name
    for name in REQUESTS:
        assert getattr(v4l2, name) == raw.IOC[name].value & 0xFFFFFFFF, name
