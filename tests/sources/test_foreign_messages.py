"""What a board did not say just now: frames sent again, hellos of somebody else, other boards."""

import dataclasses
from dataclasses import dataclass, field

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taxel.sources.boards.emulation import EmulatedBoard
from taxel.sources.boards.ledger import Scans
from taxel.sources.boards.port import Chunk
from taxel.sources.boards.stream import BoardStream
from taxel.wire.framing import frame_of
from taxel.wire.messages import Data, Heartbeat, Hello, Kind, pack

FUZZ = settings(settings.get_profile("fuzz"))


@dataclass
class Line:
    """A board on a wire that somebody else can write to as well; a scan a millisecond."""

    board: EmulatedBoard = field(default_factory=EmulatedBoard)
    now_s: float = 0.0
    sent: list[bytes] = field(default_factory=list)
    scans: list[Scans] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.stream = BoardStream("here")
        self.stream.feed([Chunk(0.0, b"", opened=True)])
        self.say(self.board.hello())
        self.run(1)
        self.stream.settle()

    def say(self, *frames: bytes) -> None:
        """Put frames on the wire now."""
        self.scans += self.stream.feed([Chunk(self.now_s, b"".join(frames))])

    def run(self, count: int, answers: bool = True) -> None:
        """Let the board scan; it answers where it is asked for its hello."""
        for _ in range(count):
            self.sent.append(self.board.scan())
            self.now_s += 0.001
            self.say(self.sent[-1])
            if answers and self.stream.wants_hello:
                self.say(self.board.hello())

    def run_at_once(self, count: int) -> None:
        """Let the board scan, and read what it sent only then."""
        came = []
        for _ in range(count):
            self.sent.append(self.board.scan())
            self.now_s += 0.001
            came.append(Chunk(self.now_s, self.sent[-1]))
        self.scans += self.stream.feed(came)
        if self.stream.wants_hello:
            self.say(self.board.hello())

    def pause(self, count: int) -> None:
        """Let the board leave scans out."""
        self.board.skip(count)
        self.now_s += 0.001 * count

    @property
    def seq(self) -> list[tuple[int, int]]:
        """Boot and count of all scans that were taken in."""
        return [(scans.boot, int(seq)) for scans in self.scans for seq in scans.seq]

    def hello(self, **changed: object) -> bytes:
        """Return a hello of this board but for what is changed."""
        board = self.board
        true = Hello(
            board=board.board,
            seq=board.tick % 2**32,
            t_us=board.t_us,
            boot_id=board.boot_id,
            rate_hz=board.rate_hz,
            channels=board.channels,
            board_id=board.board_id,
        )
        return frame_of(pack(dataclasses.replace(true, **changed)))  # type: ignore[arg-type]


FOREIGN_HELLOS = [
    {"boot_id": 7},
    {"boot_id": 7, "seq": 0, "t_us": 0},
    {"channels": 7},
    {"rate_hz": 500},
    {"adc_bits": 12},
    {"reference_mv": 3300},
    {"board_id": "another"},
    {"board": 9},
    {"protocol": 2},
    {"seq": 0, "t_us": 0},
    {"seq": 2**31, "t_us": 5},
]


@pytest.mark.parametrize("changed", FOREIGN_HELLOS, ids=str)
def test_a_hello_of_somebody_else_costs_itself_alone(changed: dict[str, object]):
    line = Line()
    line.run(50)
    line.say(line.hello(**changed))
    line.run(50)
    line.say(line.hello(**changed), line.hello(**changed))
    line.run(50)
    assert line.seq == [(0, i) for i in range(151)]
    ledger = line.stream.ledger
    assert (ledger.scans, ledger.lost, ledger.reboots, ledger.state) == (151, 0, 0, "running")
    assert ledger.bad["foreign"] == 3
    assert (ledger.board, ledger.board_id) == (0, "EMU-0")


@pytest.mark.parametrize("changed", FOREIGN_HELLOS, ids=str)
def test_a_hello_of_somebody_else_while_the_board_is_silent_does_not_last(
    changed: dict[str, object],
):
    line = Line()
    line.run(50)
    for _ in range(5):
        line.pause(100)
        line.say(line.hello(**changed))
        line.run(20)
    assert line.seq == [(0, i + 100 * max(0, (i - 51) // 20 + 1) if i > 50 else i) for i in
                        range(151)]  # fmt: skip
    assert (line.stream.ledger.reboots, line.stream.ledger.state) == (0, "running")


def test_a_hello_of_somebody_else_with_scans_that_fit_it_between_two_of_the_board_s():
    """Twenty at once: by numbers alone a boot that began, but the boot before goes on."""
    line = Line()
    line.run(50)
    forged = EmulatedBoard(first_tick=3)
    line.say(line.hello(boot_id=7, seq=0, t_us=0), *(forged.scan() for _ in range(20)))
    line.run(50)
    assert line.seq == [(0, i) for i in range(101)]
    assert line.stream.ledger.reboots == 0


def test_the_first_hello_may_be_somebody_else_s():
    board = EmulatedBoard()
    stream = BoardStream("here")
    stranger = EmulatedBoard(board=3, channels=7, board_id="other")
    stream.feed([Chunk(0.0, b"", opened=True), Chunk(0.0, stranger.hello())])
    assert stream.feed([Chunk(0.001, board.scan() + board.scan())]) == []
    assert stream.ready
    assert not stream.confirmed
    assert stream.wants_hello
    (scans,) = stream.feed([Chunk(0.003, board.hello() + board.scan())])
    assert stream.confirmed
    assert not stream.wants_hello
    assert (scans.seq.tolist(), stream.ledger.board_id) == ([2], "EMU-0")


@pytest.mark.parametrize("count", [1, 2, 3, 10, 200])
def test_frames_sent_again_are_counted_as_that_and_not_as_scans(count: int):
    line = Line()
    line.run(300)
    line.say(*line.sent[-count:])
    line.run(100)
    line.say(*line.sent[:count])
    line.run(100)
    assert line.seq == [(0, i) for i in range(501)]
    ledger = line.stream.ledger
    assert (ledger.scans, ledger.lost, ledger.reboots) == (501, 0, 0)
    assert ledger.bad["replayed"] == 2 * count


def test_each_frame_sent_twice_is_one_scan():
    line = Line()
    for _ in range(200):
        line.run(1)
        line.say(line.sent[-1])
    line.run(1)
    assert line.seq == [(0, i) for i in range(202)]
    assert line.stream.ledger.bad["replayed"] == 200


@pytest.mark.parametrize("answers", [True, False])
@pytest.mark.parametrize("with_hello", [True, False])
def test_a_boot_played_again_while_the_board_is_silent_is_no_scan(answers: bool, with_hello: bool):
    """A whole second of it, hello first, at its own pace; the board only says hello, or nothing."""
    line = Line()
    greeting = line.hello()
    line.run(1000)
    before = len(line.seq)
    line.say(*[greeting] * with_hello)
    for frame in line.sent[:1000]:
        line.now_s += 0.001
        line.board.skip(1)
        line.say(frame)
        if answers and line.stream.wants_hello:
            line.say(line.board.hello())
    assert len(line.seq) == before
    line.run(50)
    assert line.seq[before:] == [(0, i) for i in range(2001, 2051)]
    ledger = line.stream.ledger
    assert (ledger.scans, ledger.lost, ledger.reboots) == (1051, 1000, 0)


def test_an_earlier_boot_played_again_is_no_reboot():
    line = Line()
    greeting = line.hello()
    line.run(100)
    line.say(line.board.reboot())
    line.run(100)
    line.pause(50)
    line.say(greeting, *line.sent[:50])
    line.now_s += 0.05
    line.say(*line.sent[50:100])
    line.pause(50)
    line.run(10)
    assert line.seq[101:] == [(1, i) for i in [*range(100), *range(200, 210)]]
    assert line.stream.ledger.reboots == 1


@pytest.mark.parametrize("lost", [False, True])
@pytest.mark.parametrize("noise", [False, True])
def test_a_real_reboot_is_there_in_a_few_hundredths_of_a_second_and_loses_no_scan(
    lost: bool, noise: bool
):
    line = Line()
    line.run(500)
    greeting = line.board.reboot()
    if not lost:
        line.say(greeting)
    at = len(line.seq)
    for _ in range(100):
        line.run(1)
        if noise and len(line.sent) % 7 == 0:
            line.say(line.sent[400], line.sent[401])
        if len(line.seq) > at:
            break
    assert line.now_s - 0.501 <= 0.03
    line.run(50)
    first = line.seq[at][1]
    assert line.seq[at:] == [(1, first + i) for i in range(len(line.seq) - at)]
    assert first == 0 or (lost and noise and first <= 20)  # without a hello, by numbers alone
    assert (line.stream.ledger.reboots, line.stream.ledger.lost) == (1, 0)


@pytest.mark.parametrize("ran", [2, 10, 20, 29, 60])
@pytest.mark.parametrize("at_once", [True, False])
def test_a_reset_in_a_boards_first_moments_is_a_reboot(ran: int, at_once: bool):
    """Both boots count alike, and the second soon passes the first."""
    line = Line()
    line.run(ran)
    came = [Chunk(line.now_s, line.board.reboot())]
    came += [Chunk(line.now_s + 0.001 * i, line.board.scan()) for i in range(1, 121)]
    for chunks_read in [came] if at_once else [[chunk] for chunk in came]:
        line.scans += line.stream.feed(chunks_read)
    assert line.seq == [*((0, i) for i in range(ran + 1)), *((1, i) for i in range(120))]
    assert line.stream.ledger.reboots == 1


def test_other_boards_scans_and_beats_on_the_same_wire_are_theirs():
    line = Line()
    line.run(10)
    other = EmulatedBoard(board=4, first_tick=10, first_us=10_000)
    beat = frame_of(pack(Heartbeat(board=4, seq=1, t_us=1, state=0, dropped=99)))
    for _ in range(20):
        line.say(other.scan(), beat)
        line.run(1)
    assert line.seq == [(0, i) for i in range(31)]
    ledger = line.stream.ledger
    assert (ledger.lost, ledger.dropped, ledger.bad["foreign"]) == (0, 0, 40)


def test_a_scan_from_the_future_does_not_move_the_board():
    """Half an hour ahead, count and clock alike: no buffer holds so much."""
    line = Line()
    line.run(10)
    ahead = EmulatedBoard(first_tick=1_800_000, first_us=1_800_000_000)
    line.say(*(ahead.scan() for _ in range(5)))
    line.run(30)
    assert line.seq == [(0, i) for i in range(41)]
    assert line.stream.ledger.lost == 0


def test_a_host_that_slept_while_the_board_ran_on_finds_the_same_boot():
    line = Line()
    line.run(10)
    line.board.skip(3_600_000)
    line.run(40)
    assert line.seq[-1] == (1, 3_600_050)
    assert line.stream.ledger.reboots == 0


def test_a_hole_in_what_was_read_at_once_loses_the_hole_alone():
    """A port's buffer that ran over: half a second is gone, and the rest comes as one piece."""
    line = Line()
    line.run(10)
    frames = [line.board.scan() for _ in range(50)]
    line.board.skip(450)
    line.say(*frames, *(line.board.scan() for _ in range(50)))
    line.run(40)
    assert line.seq == [(0, i) for i in [*range(61), *range(511, 601)]]
    assert (line.stream.ledger.lost, line.stream.ledger.reboots) == (450, 0)


INJECTED = st.sampled_from(["hello", "boot", "again", "last", "other", "wild", "noise", "forged"])


@pytest.mark.data
@FUZZ
@given(st.lists(st.tuples(st.integers(1, 8), INJECTED, st.integers(0, 2**32 - 1)), max_size=6))
def test_whatever_is_put_between_a_board_s_frames_all_its_scans_come_once(
    injected: list[tuple[int, str, int]],
):
    line = Line(EmulatedBoard(first_tick=2000, first_us=2_000_000))  # in its first second a hello
    other = EmulatedBoard(board=4)  # that was made up, and frames sent again, look like a reset
    for count, kind, number in injected:
        line.run_at_once(count)
        again = line.sent[number % len(line.sent) :][:20]
        forged = EmulatedBoard(first_tick=number % 1000, first_us=number)
        foreign = {
            "hello": [line.hello(**FOREIGN_HELLOS[number % len(FOREIGN_HELLOS)])],
            "boot": [line.hello(boot_id=number ^ 1, seq=0, t_us=0), *again],
            "again": again,
            "last": line.sent[-1:],
            "other": [other.scan()],
            "wild": [frame_of(pack(Data(0, number % 1000, number, (1, 2, 3, 4))))],
            "noise": [b"\x00", number.to_bytes(4, "little"), b"\x00"],
            "forged": [line.hello(boot_id=number ^ 1, seq=number % 1000, t_us=number),
                       *(forged.scan() for _ in range(10))],
        }[kind]  # fmt: skip
        if kind not in ("wild", "forged") or not near(line, forged.tick, number):
            line.say(*foreign)
    line.run_at_once(26)
    assert line.seq == [(0, 2000 + i) for i in range(len(line.sent))]
    assert (line.stream.ledger.reboots, line.stream.ledger.lost) == (0, 0)


def near(line: Line, tick: int, t_us: int) -> bool:
    """Whether made-up scans stand where the board's next could: nobody can tell them apart."""
    return abs(tick - line.board.tick) < 60 and abs(t_us - line.board.t_us) < 80_000


payloads = st.one_of(
    st.binary(min_size=1, max_size=60),
    st.builds(
        lambda *fields: pack(Data(*fields)),
        st.integers(0, 2),
        st.integers(0, 2**32 - 1),
        st.integers(0, 2**32 - 1),
        st.lists(st.integers(0, 65535), min_size=4, max_size=5).map(tuple),
    ),
    st.builds(
        lambda **fields: pack(Hello(**fields)),
        board=st.integers(0, 2),
        seq=st.integers(0, 2**32 - 1),
        t_us=st.integers(0, 2**32 - 1),
        protocol=st.integers(0, 2),
        boot_id=st.integers(0, 3),
        rate_hz=st.integers(1, 65535),
        channels=st.integers(0, 5),
        adc_bits=st.integers(8, 16),
        reference_mv=st.integers(1, 65535),
    ),
    st.binary(max_size=30).map(lambda rest: bytes([Kind.HEARTBEAT]) + rest),
)
chunks = st.builds(
    lambda passed_s, frames, noise, gone, opened: (passed_s, frames, noise, gone, opened),
    st.floats(0.0, 5000.0),
    st.lists(payloads, max_size=6),
    st.binary(max_size=20),
    st.booleans(),
    st.booleans(),
)


@pytest.mark.data
@FUZZ
@given(st.lists(chunks, max_size=12), st.booleans())
def test_any_bytes_and_any_messages_at_any_time_only_give_scans_that_rise(
    steps: list[tuple[float, list[bytes], bytes, bool, bool]], settled: bool
):
    stream, now_s, last = BoardStream("here"), 0.0, {-1: -1}
    for passed_s, frames, noise, gone, opened in steps:
        now_s += passed_s
        came = [Chunk(now_s, b"".join(map(frame_of, frames)) + noise)]
        if gone or opened:
            came.append(Chunk(now_s, b"", gone=gone, opened=opened and not gone))
        for scans in stream.feed(came):
            assert scans.boot >= max(last)
            assert scans.seq[0] > last.get(scans.boot, -2)
            assert (scans.seq[1:] > scans.seq[:-1]).all()
            last[scans.boot] = int(scans.seq[-1])
        if settled and stream.ready:
            stream.settle()
    ends = sum(b"".join([*map(frame_of, frames), noise]).count(0) for _, frames, noise, *_ in steps)
    assert sum(stream.ledger.bad.values()) <= ends + len(steps)
