"""ROS 2's CDR, little endian, for messages whose size differs: texts, numbers, pairs of texts.

Scans and the times of frames have fixed sizes and are numpy arrays instead (scan_layout.py).
Knows nothing about what the values mean.

Source: OMG DDS-XTypes 1.3, 7.4 (XCDR1): each value on a multiple of its size, counted behind the
head; a text has its length with the NUL that ends it.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping

CDR_LITTLE_ENDIAN = 0x0100
"""The CDR head 00 01 00 00, read as a little-endian u32."""
CDR_HEAD = struct.pack("<I", CDR_LITTLE_ENDIAN)
_COUNT = struct.Struct("<I")
_FLOAT = struct.Struct("<d")


class CdrWriter:
    """Put values one behind another; `content` is the message."""

    def __init__(self) -> None:
        self._body = bytearray()

    @property
    def content(self) -> bytes:
        """The message with its head."""
        return CDR_HEAD + bytes(self._body)

    def count(self, value: int) -> None:
        """Put a uint32."""
        self._align(_COUNT.size)
        self._body += _COUNT.pack(value)

    def float64(self, value: float) -> None:
        """Put a float64."""
        self._align(_FLOAT.size)
        self._body += _FLOAT.pack(value)

    def flag(self, value: bool) -> None:
        """Put a bool, one byte."""
        self._body.append(bool(value))

    def data(self, content: bytes) -> None:
        """Put a uint8[]."""
        self.count(len(content))
        self._body += content

    def text(self, value: str) -> None:
        """Put a string."""
        self.data(value.encode() + b"\0")

    def pairs(self, value: Mapping[str, str]) -> None:
        """Put diagnostic_msgs/KeyValue[]."""
        self.count(len(value))
        for name, text in value.items():
            self.text(name)
            self.text(text)

    def _align(self, size: int) -> None:
        self._body += b"\0" * (-len(self._body) % size)


class CdrReader:
    """Take values one behind another; every length is checked against what is there.

    Raises:
        ValueError: From every method: the message ends before, or is laid out otherwise.
    """

    def __init__(self, content: bytes) -> None:
        if not content.startswith(CDR_HEAD):
            raise ValueError("a message without the head of little-endian CDR")
        self._body = content[len(CDR_HEAD) :]
        self._at = 0

    def count(self) -> int:
        """Take a uint32."""
        return int(self._number(_COUNT))

    def float64(self) -> float:
        """Take a float64."""
        return float(self._number(_FLOAT))

    def flag(self) -> bool:
        """Take a bool."""
        (value,) = self._take(1)
        return bool(value)

    def data(self) -> bytes:
        """Take a uint8[]."""
        return self._take(self.count())

    def text(self) -> str:
        """Take a string.

        Raises:
            ValueError: It does not end where it says, or is not UTF-8.
        """
        content = self.data()
        if not content.endswith(b"\0"):
            raise ValueError("a text does not end where it says")
        return content[:-1].decode()

    def pairs(self) -> dict[str, str]:
        """Take diagnostic_msgs/KeyValue[].

        Raises:
            ValueError: A name stands twice, or a text is damaged.
        """
        found: dict[str, str] = {}
        for _ in range(self.count()):
            name = self.text()
            if name in found:
                raise ValueError("a name stands twice among the pairs of a message")
            found[name] = self.text()
        return found

    def _number(self, form: struct.Struct) -> int | float:
        self._at += -self._at % form.size
        value: int | float = form.unpack(self._take(form.size))[0]
        return value

    def _take(self, size: int) -> bytes:
        end = self._at + size
        if end > len(self._body):
            raise ValueError("a message ends before its last value")
        part, self._at = self._body[self._at : end], end
        return part
