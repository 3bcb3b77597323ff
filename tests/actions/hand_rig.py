"""A hand controller in Python behind a pseudo-terminal, with a watchdog and motors that feel.

Follows protocol/SPEC.md; a thread of its own, since the host must not wait for it.
"""

import os
import pty
import select
import threading
import time
import tty
from collections.abc import Iterator
from contextlib import contextmanager

from taxel.wire import messages as wire
from taxel.wire.framing import DELIMITER, FrameDecoder, frame_of

WATCHDOG_S = 0.2
FREE_MA, CONTACT_MA = 80, 400


class HandEmulator:
    """One board with four motors; an object stops the fingers at `object_permille`."""

    def __init__(self) -> None:
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        self.port = os.ttyname(self._slave)
        self.boot_id = 7
        self.state = wire.State.IDLE
        self.closed = 0.0
        """Where the fingers are, 0 open … 1000 closed."""
        self.object_permille = 600.0
        self.stuck_ma: int | None = None
        """A current that the motors draw whatever they do."""
        self.ignored: dict[wire.Order, int] = {}
        """How many commands of a kind are not heard."""
        self.mute = False
        """True: nothing is sent."""
        self.noise = b""
        """Bytes put before each frame."""
        self.orders: list[wire.Order] = []
        self.stopped_s = 0.0
        """When the watchdog struck, seconds."""
        self.heard_beat_s = -1.0
        self.beats = 0
        """How many heartbeats of the host were heard."""
        self.abilities = wire.Ability.CURRENTS | wire.Ability.MOTION
        self._grip: tuple[float, float, float] | None = None
        self._decoder = FrameDecoder()
        self._start_s = time.monotonic()
        self._reported_s = self._moved_s = self._start_s
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        while not self._end.is_set():
            if select.select([self._master], [], [], 0.002)[0]:
                for payload in self._decoder.feed(os.read(self._master, 4096)):
                    self._hear(wire.unpack(payload))
            now = time.monotonic()
            self._watch(now)
            self._move(now)
            if now - self._reported_s >= 0.01:
                self._reported_s = now
                self._report()

    def _head(self) -> dict[str, int]:
        ticks = int((time.monotonic() - self._start_s) * 1e6)
        return {"board": 1, "seq": ticks // 1000, "t_us": ticks & 0xFFFFFFFF}

    def _say(self, message: wire.Message) -> None:
        if not self.mute:
            os.write(self._master, self.noise + DELIMITER + frame_of(wire.pack(message)))

    def _report(self) -> None:
        head = self._head()
        self._say(wire.Heartbeat(**head, state=self.state))
        moving = self._grip is not None
        drawn = CONTACT_MA if moving and self.closed >= self.object_permille else FREE_MA * moving
        drawn = drawn if self.stuck_ma is None else self.stuck_ma
        self._say(wire.Current(head["board"], head["seq"], head["t_us"], (drawn, 0, 0, 0)))

    def _hear(self, message: wire.Message | None) -> None:
        if isinstance(message, wire.Heartbeat):
            self.heard_beat_s = time.monotonic()
            self.beats += 1
        if not isinstance(message, wire.Command):
            return
        order = wire.Order(message.order)
        if self.ignored.get(order, 0) > 0:
            self.ignored[order] -= 1
            return
        self.orders.append(order)
        result = wire.Result.DONE
        if order is wire.Order.IDENTIFY:
            self.hello()
        elif order is wire.Order.STOP:
            self._grip, self.state = None, wire.State.STOPPED
        elif order is wire.Order.ARM:
            if time.monotonic() - self.heard_beat_s > WATCHDOG_S:
                result = wire.Result.NOT_ARMED
            else:
                self.state = wire.State.ARMED
        elif self.state not in (wire.State.ARMED, wire.State.MOVING):
            result = wire.Result.NOT_ARMED
        else:
            self._grip = (time.monotonic() + message.expires_ms / 1000, message.b, message.c)
            self.state = wire.State.MOVING
        self._say(
            wire.Acknowledge(
                **self._head(), command_seq=message.seq, host_us=message.t_us, result=result
            )
        )

    def hello(self) -> None:
        self._say(
            wire.Hello(**self._head(), boot_id=self.boot_id, abilities=self.abilities, board_id="h")
        )

    def reboot(self) -> None:
        self.boot_id += 1
        self._grip, self.state = None, wire.State.IDLE
        self.hello()

    def _watch(self, now: float) -> None:
        armed = self.state in (wire.State.ARMED, wire.State.MOVING)
        if armed and now - self.heard_beat_s > WATCHDOG_S:
            self._grip, self.state, self.stopped_s = None, wire.State.STOPPED, now

    def _move(self, now: float) -> None:
        step, self._moved_s = now - self._moved_s, now
        if self._grip is None:
            return
        until, target, limit_ma = self._grip
        touched = self.closed >= self.object_permille
        if now >= until or (touched and limit_ma <= CONTACT_MA):
            self._grip, self.state = None, wire.State.ARMED
        elif not touched:
            self.closed = min(self.closed + 4000 * step, target, self.object_permille)

    def close(self) -> None:
        if self._thread.is_alive():
            self._end.set()
            self._thread.join()
            os.close(self._master)
            os.close(self._slave)


@contextmanager
def emulated_hand() -> Iterator[HandEmulator]:
    hand = HandEmulator()
    try:
        yield hand
    finally:
        hand.close()
