"""A TCP server on 127.0.0.1 that speaks a JAKA controller's JSON, with a tool that moves."""

import json
import select
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from taxel.actions.arm import ArmLimits, SimArm
from taxel.clock import SystemClock


class JakaEmulator:
    """One client at a time, as the real one."""

    def __init__(self) -> None:
        self._arm = SimArm(ArmLimits(speed_mm_s=250, accel_mm_s2=2000), SystemClock())
        self._arm.connect()
        self.enabled = True
        self.refuse: dict[str, tuple[str, str]] = {}
        """Command → errorCode and errorMsg."""
        self.piece = 4096
        """Bytes sent at a time, a millisecond apart."""
        self.before = b""
        """Bytes sent before each reply."""
        self.mute = False
        self.positions: Any = None
        """What stands for the position, instead of the true one."""
        self.heard: list[dict[str, Any]] = []
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = self._listener.getsockname()[1]
        self._client: socket.socket | None = None
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        decoder = json.JSONDecoder()
        kept = ""
        while not self._end.is_set():
            watched = [self._listener, *([self._client] if self._client else [])]
            ready, _, _ = select.select(watched, [], [], 0.01)
            if self._listener in ready:
                self.hang_up()
                self._client, kept = self._listener.accept()[0], ""
            elif self._client in ready and self._client is not None:
                try:
                    data = self._client.recv(4096)
                except OSError:
                    data = b""
                if not data:
                    self.hang_up()
                kept += data.decode()
                while kept:
                    try:
                        command, used = decoder.raw_decode(kept)
                    except ValueError:
                        break
                    kept = kept[used:]
                    self._answer(command)

    def _answer(self, command: dict[str, Any]) -> None:
        name = command["cmdName"]
        code, words = self.refuse.get(name, ("0", ""))
        reply: dict[str, Any] = {"errorCode": code, "errorMsg": words, "cmdName": name}
        if code == "0":
            self.heard.append(command)
            reply |= self._do(name, command)
        if self.mute:
            return
        data = self.before + json.dumps(reply).encode()
        for i in range(0, len(data), self.piece):
            if i:
                time.sleep(0.001)
            if self._client is not None:
                self._client.sendall(data[i : i + self.piece])

    def _do(self, name: str, command: dict[str, Any]) -> dict[str, Any]:
        if name == "get_robot_state":
            enabled = "robot_enabled" if self.enabled else "robot_disabled"
            return {"enable": enabled, "power": "powered_on"}
        if name == "get_tcp_pos":
            true = [100.0, -20.5, self._arm.status().height_mm, 180.0, 0.0, 90.0]
            return {"tcp_pos": true if self.positions is None else self.positions}
        if name == "moveL":
            self._arm.lower(-command["cartPosition"][2], command["speed"])
        if name == "stop_program":
            self._arm.stop()
        return {}

    def hang_up(self) -> None:
        client, self._client = self._client, None
        if client is not None:
            client.close()

    def close(self) -> None:
        self._end.set()
        self._thread.join()
        self.hang_up()
        self._listener.close()


@contextmanager
def emulated_jaka() -> Iterator[JakaEmulator]:
    jaka = JakaEmulator()
    try:
        yield jaka
    finally:
        jaka.close()
