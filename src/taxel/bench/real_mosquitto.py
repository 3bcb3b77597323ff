"""A real mosquitto on this machine, for benches and tests: started, killed, started again."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import time
from pathlib import Path

from taxel.errors import BadInput

MOSQUITTO = shutil.which("mosquitto", path="/usr/sbin:/usr/local/sbin:/usr/bin:/opt/homebrew/sbin")


_START_S = 10.0


def free_port() -> int:
    """Return a port of this machine that is free just now."""
    with socket.create_server(("127.0.0.1", 0)) as probe:
        return int(probe.getsockname()[1])


class Mosquitto:
    """A broker on this machine only; `start` and `kill` as often as wanted.

    Args:
        folder: For its configuration.
        extra: Lines of it beside the listener.
    """

    def __init__(self, folder: Path, extra: str = "allow_anonymous true\n") -> None:
        self.port = free_port()
        self.config = folder / "mosquitto.conf"
        self.config.write_text(f"listener {self.port} 127.0.0.1\n{extra}")
        self.process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Start it, and wait until it listens.

        Raises:
            BadInput: There is no mosquitto on this machine.
            TimeoutError: It does not listen in time.
        """
        if MOSQUITTO is None:
            raise BadInput("mosquitto", "none", "run: apt-get install mosquitto")
        self.process = subprocess.Popen(
            [MOSQUITTO, "-c", str(self.config)], stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )  # fmt: skip
        until_s = time.monotonic() + _START_S
        while time.monotonic() < until_s:
            try:
                socket.create_connection(("127.0.0.1", self.port), 1.0).close()
                return
            except OSError:
                time.sleep(0.02)
        raise TimeoutError("mosquitto does not listen")

    def cpu_s(self) -> float:
        """Return the processor time that it has taken so far, seconds (Linux)."""
        assert self.process is not None
        fields = Path(f"/proc/{self.process.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def kill(self) -> None:
        """End it as by a power cut; once is enough."""
        if self.process is not None:
            self.process.kill()
            self.process.wait()
            self.process = None
