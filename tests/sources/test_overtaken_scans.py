"""A board's answer to who it is may stand on the wire before scans of earlier ticks."""

from taxel.sources.boards.emulation import EmulatedBoard
from taxel.sources.boards.port import Chunk
from taxel.sources.boards.stream import BoardStream
from taxel.wire.framing import frame_of
from taxel.wire.messages import Hello, pack


def test_scans_that_a_boards_first_hello_overtook_are_taken_but_none_before_them():
    board = EmulatedBoard(first_tick=18, first_us=18_000)
    scans = [board.scan() for _ in range(5)]
    stream = BoardStream("here")
    place = Hello(board=0, seq=21, t_us=21_000, boot_id=board.boot_id, rate_hz=1000,
                  channels=board.channels, board_id=board.board_id)  # fmt: skip
    taken = stream.feed([Chunk(0.02, b"".join((frame_of(pack(place)), *scans)))])
    assert [int(seq) for part in taken for seq in part.seq] == [19, 20, 21, 22]
    assert stream.ledger.lost == 0
    assert stream.ledger.bad["replayed"] == 1  # 18 is none of this hello's
