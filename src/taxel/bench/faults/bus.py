"""What a station notices of a subscriber of its live bus that stands still: nothing.

Knows nothing about what is published.

Background of our choices: docs/decisions/0052.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
from contextlib import ExitStack
from importlib.util import find_spec
from pathlib import Path

from taxel.bench.faults.quiet_station import STILL, lost_frames, spells_ms, spells_row
from taxel.bench.real_mosquitto import free_port
from taxel.bench.rows import Row, missing, row
from taxel.bundles.shipped import CUP_POUR, shipped_bundle
from taxel.live.station.station import Station
from taxel.live.station.wiring import StationConfig

_STOPPED_S = 8.0
"""How long the subscriber is stopped at the end, seconds. Source: our choice, as for a stopped
page (`faults.slow_page_rows`)."""
_SUBSCRIBER = """
import sys
from taxel.bus.zenoh_reader import BusReader
with BusReader(sys.argv[1]) as reader:
    while True:
        if reader.take(wait_s=0.1):
            print("came", flush=True)
"""
_RATIO = "bus subscriber stopped: median time to the alarm, over that with it running"
_READY_S = 20.0
"""How long a subscriber may take to hear the first message, seconds. Source: our choice."""


def bus_rows() -> list[Row]:
    """Stop a subscriber in mid-flight; see what the station notices of it."""
    if find_spec("zenoh") is None:
        return [missing(_RATIO, "ratio", "<= 1.1", "eclipse-zenoh is not installed")]
    from taxel.bus.addresses import parse_zenoh
    from taxel.bus.zenoh_publisher import ZenohPublishing, publish

    url = f"zenoh://127.0.0.1:{free_port()}/bench"
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        config = StationConfig(sources=(STILL,), bundles=(shipped_bundle(CUP_POUR),))
        with ExitStack() as stack:
            station = stack.enter_context(Station(config))
            view = station.view_config()
            station.add_process(
                "publisher", publish,
                lambda place: ZenohPublishing(place=place, view=view, address=parse_zenoh(url)),
            )  # fmt: skip
            subscriber = stack.enter_context(Subscriber(url))
            station.record(Path(scratch) / "all.mcap", {})
            station.run(_READY_S, subscriber.hears)
            spells = spells_ms(station, subscriber.signal)
            subscriber.signal(signal.SIGSTOP)
            station.run(_STOPPED_S)
            subscriber.signal(signal.SIGKILL)
            alarms = [a.text for a in station.guard.alarms.alarms if "publisher" in a.text]
        lost, ledger = lost_frames(station), station.ledger()
    return [
        row(f"bus subscriber stopped for {_STOPPED_S:g} s: frames lost by source, monitor or "
            "recorder", lost, "frames", "<=", 0.0, f"{ledger['source']['produced']} messages made; "
            f"the publisher missed {ledger['publisher']['dropped']}"),
        row("bus subscriber stopped: alarms about the publisher", len(alarms), "alarms", "<=", 0.0,
            "; ".join(alarms)),
        spells_row(_RATIO, spells),
    ]  # fmt: skip


class Subscriber:
    """A program that listens to a station, to be stopped and killed; use it in a `with` block.

    Args:
        url: The station's address, which publishes already.
    """

    def __init__(self, url: str) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-c", _SUBSCRIBER, url], stdout=subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        )  # fmt: skip
        assert self._process.stdout is not None
        self._output = self._process.stdout
        os.set_blocking(self._output.fileno(), False)

    def hears(self) -> bool:
        """True once a message has come, asked for the first time since; never waits."""
        return bool(self._output.read(4))

    def signal(self, number: signal.Signals) -> None:
        """Send a signal to it."""
        self._process.send_signal(number)

    def __enter__(self) -> Subscriber:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.wait()
        self._output.close()
