"""A PGE on a real Modbus RTU server, a cable of two pseudo-terminals, and ways to break it."""

import asyncio
import os
import pty
import select
import threading
import time
import tty
from collections.abc import Iterator
from contextlib import contextmanager

from pymodbus.constants import ExcCodes
from pymodbus.server import ModbusSerialServer
from pymodbus.simulator import DataType, SimData, SimDevice

from taxel.actions.gripper import Motion
from taxel.actions.sim_gripper import Fingers, FingersConfig

_STATES = {Motion.MOVING: 0, Motion.REACHED: 1, Motion.CAUGHT: 2, Motion.DROPPED: 3}
_FIRST = 0x0100


class Cable:
    """Two pseudo-terminals whose masters are joined by a thread."""

    def __init__(self) -> None:
        self._near, near_slave = pty.openpty()
        self._far, far_slave = pty.openpty()
        for end in (near_slave, far_slave):
            tty.setraw(end)
        self._slaves = [near_slave, far_slave]
        self.near, self.far = os.ttyname(near_slave), os.ttyname(far_slave)
        self.delay_s = 0.0
        """Delay of what the gripper says, seconds."""
        self.spoil = b""
        """Bytes put before what the gripper says."""
        self.mute = False
        """True: what the gripper says is lost."""
        self.heard: list[bytes] = []
        """What the host said."""
        self._end = os.pipe()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        late: list[tuple[float, bytes]] = []
        while True:
            wait = 0.001 if late else 1.0
            ready, _, _ = select.select([self._near, self._far, self._end[0]], [], [], wait)
            if self._end[0] in ready:
                return
            if self._near in ready:
                request = os.read(self._near, 4096)
                self.heard.append(request)
                os.write(self._far, request)
            if self._far in ready:
                answer = os.read(self._far, 4096)
                if not self.mute:
                    late.append((time.monotonic() + self.delay_s, self.spoil + answer))
            while late and late[0][0] <= time.monotonic():
                os.write(self._near, late.pop(0)[1])

    def pull(self) -> None:
        """Pull the cable: both ports are gone."""
        if not self._thread.is_alive():
            return
        os.write(self._end[1], b".")
        self._thread.join()
        for fd in (*self._slaves, self._near, self._far, *self._end):
            os.close(fd)


class PgeEmulator:
    """The registers of a PGE, with fingers behind them, on a pymodbus server of its own thread."""

    def __init__(self, port: str, device_id: int, initialised: bool, set_pct: int) -> None:
        self.fingers = Fingers(FingersConfig(closing_s=0.2, latency_s=0.005))
        self.initialised = initialised
        self.busy = False
        """True: every request is answered by an exception."""
        self.writes: list[tuple[int, int]] = []
        self._device = SimDevice(
            device_id,
            simdata=[
                SimData(_FIRST, values=[0, set_pct] + [0] * 0x101, datatype=DataType.REGISTERS)
            ],
            action=self._action,
        )
        self._port = port
        self._id = device_id
        self._up = threading.Event()
        self._thread = threading.Thread(target=lambda: asyncio.run(self._serve()))
        self._thread.start()
        assert self._up.wait(5)

    async def _serve(self) -> None:
        self._server = ModbusSerialServer(
            self._device, port=self._port, baudrate=115200, timeout=1, trace_packet=self._only_mine
        )
        self._loop = asyncio.get_running_loop()
        await self._server.serve_forever(background=True)
        self._up.set()
        await self._server.serving
        await asyncio.sleep(0)

    def _only_mine(self, sending: bool, packet: bytes) -> bytes:
        """Be silent for other ids, as on a real bus; pymodbus 3.16 answers with an exception."""
        return packet if sending or packet[:1] == bytes([self._id]) else b""

    async def _action(
        self, _: int, start: int, address: int, count: int, registers: list[int], values: object
    ) -> ExcCodes | None:
        if self.busy:
            return ExcCodes.DEVICE_BUSY
        fingers = self.fingers
        now_s = time.monotonic()
        fingers.advance(now_s)
        if isinstance(values, list):
            self.writes.append((address, values[0]))
            registers[address - start] = values[0]
            if address == 0x0100:
                self.initialised = True
            if address == 0x0101:
                fingers.set_pct = values[0]
            if address == 0x0103:
                fingers.command(values[0], registers[0x0101 - start], now_s)
            return None
        registers[0x0200 - start] = int(self.initialised)
        registers[0x0201 - start] = _STATES[fingers.motion]
        registers[0x0202 - start] = round(fingers.position_permille)
        return None

    def close(self) -> None:
        """End the server and its thread."""
        if self._thread.is_alive():
            asyncio.run_coroutine_threadsafe(self._server.shutdown(), self._loop).result(5)
            self._thread.join(5)


@contextmanager
def pge_on_a_cable(
    device_id: int = 1, initialised: bool = True, set_pct: int = 0
) -> Iterator[tuple[Cable, PgeEmulator]]:
    """A cable with a PGE at its far end."""
    cable = Cable()
    pge = PgeEmulator(cable.far, device_id, initialised, set_pct)
    try:
        yield cable, pge
    finally:
        pge.close()
        cable.pull()
