"""What a frame's payload says: one dataclass a message, packed and unpacked side by side.

Every message begins with the same ten bytes: type, board, seq, t_us; all numbers are
little-endian. Counters wrap at 2³² (t_us after 71.6 minutes): `taxel.wire.counters` unwraps
them. Knows nothing about frames, ports or volts.

Source: protocol/SPEC.md.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum, IntFlag

from taxel.errors import BadInput

PROTOCOL = 1
"""The version that this module speaks; a hello of another version is refused by the source."""
EVERY_BOARD = 255
"""As the board of a command or a heartbeat of the host: whoever hears it."""

_HEAD = struct.Struct("<BBII")
_HELLO = struct.Struct("<BBIIBBBBIHBBHBB")
_COMMAND = struct.Struct("<BBIIBHHHH")
_HEARTBEAT = struct.Struct("<BBIIBII")
_ACKNOWLEDGE = struct.Struct("<BBIIIIB")
_LONGEST_ID = 32
_LONGEST_LIST = 115
"""Values in a data or current message: what a payload of 240 bytes holds."""
_VALUES = tuple(struct.Struct(f"<BBII{n}H") for n in range(_LONGEST_LIST + 1))
_CURRENTS = tuple(struct.Struct(f"<BBII{n}h") for n in range(_LONGEST_LIST + 1))


class Kind(IntEnum):
    """The first byte of a payload."""

    HELLO = 1
    DATA = 2
    COMMAND = 3
    HEARTBEAT = 4
    ACKNOWLEDGE = 5
    CURRENT = 6


class Ability(IntFlag):
    """What a board can do, as its hello says; flags add up."""

    SENSORS = 1
    """Sends data."""
    CURRENTS = 2
    """Sends motor currents."""
    MOTION = 4
    """Obeys ARM, GRIP and STOP."""


class Order(IntEnum):
    """What a command asks for; its arguments a, b, c are 0 where not named."""

    IDENTIFY = 0
    """Send a hello."""
    STOP = 1
    """Motors off, and no motion until the next ARM."""
    ARM = 2
    """Allow motion. Refused while the host's heartbeat is missing."""
    GRIP = 3
    """Close fingers: a = fingers (bit 0 the first), b = how far, 0 open … 1000 closed, per
    mille, c = current at which a motor stops, mA."""
    SET_RATE = 4
    """Scan a times a second, hertz; the board answers and then says hello."""


class State(IntEnum):
    """What the sender of a heartbeat is doing."""

    IDLE = 0
    ARMED = 1
    MOVING = 2
    STOPPED = 3
    FAULT = 4


class Result(IntEnum):
    """What became of a command."""

    DONE = 0
    EXPIRED = 1
    """Its time was over before it took effect, or it was not refreshed."""
    NOT_ARMED = 2
    UNKNOWN = 3
    """No such order on this board."""
    BAD_ARGUMENT = 4
    OLD = 5
    """Its sequence number is not newer than the last command's."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Hello:
    """Who a board is: sent at boot, after SET_RATE and on IDENTIFY."""

    board: int
    """The board's number in its hand, 0…254."""
    seq: int
    """Timer ticks since boot, u32."""
    t_us: int
    """The board's clock, microseconds since boot, u32."""
    protocol: int = PROTOCOL
    firmware: tuple[int, int, int] = (0, 0, 0)
    """Major, minor, patch; each 0…255."""
    boot_id: int = 0
    """Another number at each boot, u32: sets a reboot apart from a cable that was pulled."""
    rate_hz: int = 1000
    """Scans a second, hertz."""
    channels: int = 0
    """Values in each data message."""
    adc_bits: int = 10
    """The converter's bits; its largest value is 2^bits − 1."""
    reference_mv: int = 5000
    """The voltage of 2^bits counts, millivolts."""
    abilities: Ability = Ability.SENSORS
    board_id: str = ""
    """Serial number or name, at most 32 ASCII characters."""


@dataclass(frozen=True, slots=True)  # positional: made three thousand times a second
class Data:
    """One scan of all of a board's channels."""

    board: int
    seq: int
    """Which timer tick, u32: a number left out is a scan that was missed or lost."""
    t_us: int
    """When the scan began, the board's clock, microseconds, u32."""
    values: tuple[int, ...]
    """One reading a channel, converter counts, u16."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Command:
    """From the host to a board."""

    board: int
    """Which board, or EVERY_BOARD."""
    seq: int
    """The host's own count of commands, u32, rising by one: a board ignores an old one."""
    t_us: int
    """The host's clock, microseconds, u32; comes back in the acknowledge."""
    order: int
    """An `Order`; a number that is none is for the board to refuse."""
    expires_ms: int = 0
    """A motion ends this long after the command came unless it is refreshed, milliseconds;
    0 where nothing lasts. A GRIP with 0 is refused."""
    a: int = 0
    b: int = 0
    c: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Heartbeat:
    """From both sides, ten times a second or more: I live, and this is my state."""

    board: int
    seq: int
    """A board: timer ticks since boot. The host: its count of heartbeats. u32."""
    t_us: int
    state: int
    """A `State`."""
    dropped: int = 0
    """Scans that the sender took and could not send since boot, u32."""
    bad: int = 0
    """Frames that the sender received and threw away since boot, u32."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Acknowledge:
    """From a board: what became of a command. One for each, and one more where it ran out."""

    board: int
    seq: int
    t_us: int
    command_seq: int
    """The command's number."""
    host_us: int
    """The command's t_us, as it came: the host reads its round trip off its own clock."""
    result: int
    """A `Result`."""


@dataclass(frozen=True, slots=True)
class Current:
    """Motor or contact currents, one a motor."""

    board: int
    seq: int
    t_us: int
    milliamps: tuple[int, ...]
    """i16 each; negative while a motor opens."""


Message = Hello | Data | Command | Heartbeat | Acknowledge | Current


def pack(message: Message) -> bytes:
    """Return a message as a frame's payload.

    Raises:
        BadInput: A field does not fit its place on the wire.
    """
    try:
        return _pack(message)
    except (struct.error, UnicodeEncodeError, IndexError) as error:
        raise BadInput(
            "fields within the ranges of protocol/SPEC.md",
            f"{message} ({error})",
            "give values that fit",
        ) from error


def _pack(message: Message) -> bytes:
    match message:
        case Data(board, seq, t_us, values):
            return _VALUES[_counted(values)].pack(Kind.DATA, board, seq, t_us, *values)
        case Current(board, seq, t_us, milliamps):
            size = _counted(milliamps)
            return _CURRENTS[size].pack(Kind.CURRENT, board, seq, t_us, *milliamps)
        case Hello():
            return _pack_hello(message)
        case Command() as m:
            head = (Kind.COMMAND, m.board, m.seq, m.t_us)
            return _COMMAND.pack(*head, m.order, m.expires_ms, m.a, m.b, m.c)
        case Heartbeat() as beat:
            head = (Kind.HEARTBEAT, beat.board, beat.seq, beat.t_us)
            return _HEARTBEAT.pack(*head, beat.state, beat.dropped, beat.bad)
        case Acknowledge() as answer:
            head = (Kind.ACKNOWLEDGE, answer.board, answer.seq, answer.t_us)
            return _ACKNOWLEDGE.pack(*head, answer.command_seq, answer.host_us, answer.result)


def _counted(values: tuple[int, ...]) -> int:
    if not values:
        raise IndexError("no values")
    return len(values)


def _pack_hello(hello: Hello) -> bytes:
    name = hello.board_id.encode("ascii")
    if len(name) > _LONGEST_ID:
        raise IndexError(f"a board id of {len(name)} characters")
    fixed = _HELLO.pack(
        Kind.HELLO,
        hello.board,
        hello.seq,
        hello.t_us,
        hello.protocol,
        *hello.firmware,
        hello.boot_id,
        hello.rate_hz,
        hello.channels,
        hello.adc_bits,
        hello.reference_mv,
        hello.abilities,
        len(name),
    )
    return fixed + name


def unpack(payload: bytes) -> Message | None:
    """Return the message that a payload is; None where it is none of this protocol.

    A payload must have exactly the length of its type. Never raises on bytes.
    """
    if len(payload) < _HEAD.size:
        return None
    kind, size = payload[0], len(payload)
    if kind == Kind.DATA:
        values = size - _HEAD.size
        if not values or values % 2 or values // 2 > _LONGEST_LIST:
            return None
        _, board, seq, t_us, *readings = _VALUES[values // 2].unpack(payload)
        return Data(board, seq, t_us, tuple(readings))
    if kind == Kind.CURRENT:
        values = size - _HEAD.size
        if not values or values % 2 or values // 2 > _LONGEST_LIST:
            return None
        _, board, seq, t_us, *readings = _CURRENTS[values // 2].unpack(payload)
        return Current(board, seq, t_us, tuple(readings))
    if kind == Kind.HELLO:
        return _unpack_hello(payload)
    return _unpack_fixed(kind, payload)


def _unpack_fixed(kind: int, payload: bytes) -> Message | None:
    if kind == Kind.COMMAND and len(payload) == _COMMAND.size:
        _, board, seq, t_us, order, expires_ms, a, b, c = _COMMAND.unpack(payload)
        return Command(
            board=board, seq=seq, t_us=t_us, order=order, expires_ms=expires_ms, a=a, b=b, c=c
        )
    if kind == Kind.HEARTBEAT and len(payload) == _HEARTBEAT.size:
        _, board, seq, t_us, state, dropped, bad = _HEARTBEAT.unpack(payload)
        return Heartbeat(board=board, seq=seq, t_us=t_us, state=state, dropped=dropped, bad=bad)
    if kind == Kind.ACKNOWLEDGE and len(payload) == _ACKNOWLEDGE.size:
        _, board, seq, t_us, command_seq, host_us, result = _ACKNOWLEDGE.unpack(payload)
        return Acknowledge(
            board=board,
            seq=seq,
            t_us=t_us,
            command_seq=command_seq,
            host_us=host_us,
            result=result,
        )
    return None


def _unpack_hello(payload: bytes) -> Hello | None:
    name = payload[_HELLO.size :]
    if len(payload) < _HELLO.size or len(name) > _LONGEST_ID:
        return None
    _, board, seq, t_us, protocol, *rest = _HELLO.unpack(payload[: _HELLO.size])
    major, minor, patch, boot_id, rate_hz, channels, adc_bits, reference_mv, abilities, n = rest
    if n != len(name) or not all(0x20 <= byte < 0x7F for byte in name):
        return None
    if not rate_hz or not 8 <= adc_bits <= 16 or not reference_mv or channels > _LONGEST_LIST:
        return None
    return Hello(
        board=board,
        seq=seq,
        t_us=t_us,
        protocol=protocol,
        firmware=(major, minor, patch),
        boot_id=boot_id,
        rate_hz=rate_hz,
        channels=channels,
        adc_bits=adc_bits,
        reference_mv=reference_mv,
        abilities=Ability(abilities),
        board_id=name.decode("ascii"),
    )
