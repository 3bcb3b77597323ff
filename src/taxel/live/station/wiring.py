"""What a station runs, and its processes wired to each other by rings.

Knows nothing about supervising them.

Background of our choices: docs/decisions/0019.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from taxel.actions.interlock import InterlockConfig
from taxel.actions.rule_table import RuleTable
from taxel.bundles.envelope import checksum_of, is_trial_bundle
from taxel.bundles.signing import Trust
from taxel.calibration.stored import read_calibration
from taxel.errors import BadInput, BadSource
from taxel.live.station.acquisition import Acquisition, acquire
from taxel.live.station.fitting import misfit, read_own_contract
from taxel.live.station.guard import GuardConfig
from taxel.live.station.inference import infer
from taxel.live.station.packets import pack
from taxel.live.station.page_link import PageSeen, ViewConfig
from taxel.live.station.processes import ProcessGroup, Worker
from taxel.live.station.recorder_link import RECORDER
from taxel.live.station.recording import Recording, apart, choose_recorded, record
from taxel.live.station.ring import Ring, RingReader, RingWriter
from taxel.live.station.watching import LOOK_S, Inference
from taxel.live.station.worker import Place, Rank
from taxel.models.devices import CPU
from taxel.plain_text import number_of
from taxel.signals import CameraInfo, SensorInfo
from taxel.sources.opening import is_replay, options_of, recordings_of

_RING_BYTES = 16 * 2**20
"""Of a source: six seconds of two cameras at 60 Hz. Source: our choice."""
_NOTE_BYTES = 2**18
"""Of a ring of notes: some hundreds of decisions. Source: our choice."""
_ALONE = (
    "taxel live with one bundle (no --also beside one of cameras) and no --page, --record, "
    "--gripper, --tell, --publish and --beside, and no column alarm in --rules"
)
"""When there is no station, for messages."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StationConfig:
    """What runs."""

    sources: tuple[str, ...]
    bundles: tuple[Path, ...]
    trust: Trust | None = None
    """Keys of which one must have signed each bundle; any bundle unless given."""
    least_confidence: float = 0.5
    device: str = CPU
    """On which ONNX Runtime runs the bundles."""
    rules: RuleTable = RuleTable(())  # noqa: RUF009  # frozen
    """From what is recognised to an action."""
    guard: GuardConfig = field(default_factory=GuardConfig)
    interlock: InterlockConfig = field(
        default_factory=lambda: InterlockConfig(min_n=15.0, max_n=50.0)
    )
    recordings: Path = Path("recordings")
    """Folder of recordings that are started from the page."""
    labels: Mapping[str, str] = field(default_factory=dict)
    """Of such recordings; what is typed on the page goes first."""
    groups: Mapping[str, str] = field(default_factory=dict)
    """Of such recordings, too."""
    calibration: Path | None = None
    """Of an array among the sources, which the page then shows in newtons."""
    drill: bool = False
    """Let processes obey orders to go wrong, for `taxel bench faults`."""
    disk_bytes: int | None = None
    """Where the disk ends, for drills."""


@dataclass(slots=True)
class Feed:
    """One open source."""

    url: str
    ring: str
    to: RingWriter
    worker: Worker
    sensor: SensorInfo = field(
        default_factory=lambda: SensorInfo(name="none", channels=(), units=(), rate_hz=0.0)
    )
    cameras: tuple[CameraInfo, ...] = ()


@dataclass(slots=True)
class MonitorLink:
    """One inference process."""

    worker: Worker
    decisions: str
    heard: RingReader
    to: RingWriter
    feed: Feed
    """The source that it follows."""
    bundles: list[dict[str, Any]] = field(default_factory=list)
    """What each bundle is."""

    @property
    def watches(self) -> bool:
        """True where one of them watches a grasp."""
        return bool(self.watchers)

    @property
    def watchers(self) -> list[str]:
        """Names of those that watch a grasp."""
        return [entry["who"] for entry in self.bundles if entry["kind"] == "grasp"]


def begin_grasp(monitors: Sequence[MonitorLink]) -> None:
    """Order every monitor to begin a new grasp; the first process that watches one reports all."""
    first = next((monitor for monitor in monitors if monitor.watches), None)
    for monitor in monitors:
        report = {"all": True} if monitor is first else {"report": False}
        monitor.to.put(pack({"do": "new grasp", **report}))


class Wiring:
    """Starts sources, then the monitors that fit them, and the recorder.

    Args:
        config: What runs.
        stack: Ends what is opened here.
        processes: Starts processes.

    Raises:
        BadSource: A source cannot be opened.
        BadBundle: A bundle is damaged, or fits none of the sources.
    """

    def __init__(
        self, config: StationConfig, stack: contextlib.ExitStack, processes: ProcessGroup
    ) -> None:
        self._config, self._stack, self._processes = config, stack, processes
        self.feeds: list[Feed] = []
        self.monitors: list[MonitorLink] = []
        self.unwatched: tuple[str, ...] = ()
        """Sources with cameras that no bundle watches."""
        self.not_recorded = ""
        """Names of arrays that a recording does not hold."""
        self.status = self.ring()
        """Ring of the station's own snapshots."""
        self.requests = self.ring()
        """Ring of the page's requests."""
        for path in config.bundles:  # before anything is opened
            read_own_contract(path, config.trust)
        self.levels: dict[str, dict[str, Any]] = {}
        """Recogniser → where its session's level stands; a process started again goes on there."""
        self._checksums = {path: checksum_of(path) for path in config.bundles}
        for number, url in enumerate(config.sources):
            _check_whole(url)
            _check_pace(url)
            self._start_feed(url, number)
        for feed in self.feeds:
            feed.sensor, feed.cameras = processes.opened(feed.worker)
        self._calibrated = self._calibrate(config.calibration)
        for index, paths in self._assign().items():
            trials = [path for path in paths if is_trial_bundle(path)]
            for name, rank, own in (
                ("monitor", Rank.MODEL, [path for path in paths if path not in trials]),
                ("recogniser", Rank.ORDINARY, trials),  # a look would hold up a monitor
            ):
                if own:
                    whose = f"{name} {index + 1}" if len(self.feeds) > 1 else name
                    self._start_monitor(self.feeds[index], tuple(own), whose, rank)
        recorder = self._start_recorder()
        for monitor in self.monitors:
            monitor.bundles = processes.opened(monitor.worker)[0]
        processes.opened(recorder)

    @property
    def watches(self) -> bool:
        """True where a grasp is watched."""
        return any(monitor.watches for monitor in self.monitors)

    @property
    def given_up(self) -> frozenset[str]:
        """Names of monitors and recognisers whose process is not started again."""
        ended = [monitor for monitor in self.monitors if monitor.worker.given_up]
        return frozenset(entry["who"] for monitor in ended for entry in monitor.bundles)

    def view_config(self) -> ViewConfig:
        """Return what a page needs to see this station."""
        return ViewConfig(
            sources=tuple(
                PageSeen(
                    url=feed.url,
                    ring=feed.ring,
                    sensor=feed.sensor,
                    cameras=feed.cameras,
                    calibration=self._config.calibration if feed is self._calibrated else None,
                )
                for feed in self.feeds
            ),
            decisions=tuple(monitor.decisions for monitor in self.monitors),
            status=self.status,
            requests=self.requests,
            beats=self._processes.beats_name,
            stall_s=self._config.interlock.stall_s,
            watchers=tuple(who for monitor in self.monitors for who in monitor.watchers),
            recognisers=tuple(
                (entry["who"], entry["target"])
                for monitor in self.monitors
                for entry in monitor.bundles
                if entry["kind"] == "answer"
            ),
        )

    def _calibrate(self, path: Path | None) -> Feed | None:
        """Return the source that a calibration is of.

        Raises:
            BadInput: It is of none of them.
        """
        if path is None:
            return None
        calibration = read_calibration(path)
        arrays = [feed for feed in self.feeds if feed.sensor.channels]
        if not arrays:
            raise BadInput("an array beside a calibration", "tactile cameras only", "leave it out")
        for feed in arrays[:-1]:
            with contextlib.suppress(BadInput):
                calibration.check_fits(feed.sensor, feed.url)
                return feed
        calibration.check_fits(arrays[-1].sensor, arrays[-1].url)
        return arrays[-1]

    def send_to(self, name: str) -> RingWriter | None:
        """Return the ring of orders of a source's or a monitor's process."""
        ends = [(monitor.worker, monitor.to) for monitor in self.monitors]
        ends += [(feed.worker, feed.to) for feed in self.feeds]
        return next((to for worker, to in ends if worker.name == name), None)

    def decides(self, worker: Worker) -> bool:
        """Return whether a process runs bundles: it holds no file that it would leave half."""
        return any(monitor.worker is worker for monitor in self.monitors)

    def watchers_of(self, worker: Worker) -> list[str]:
        """Return the names of the grasp monitors in a process."""
        return [
            who for monitor in self.monitors if monitor.worker is worker for who in monitor.watchers
        ]

    def watchers_by_cameras(self) -> dict[str, tuple[str, ...]]:
        """Return the grasp monitors of each source, by its cameras as a recording names them."""
        cameras = iter(apart([camera for feed in self.feeds for camera in feed.cameras]))
        found = {}
        for feed in self.feeds:
            names = [next(cameras).name for _ in feed.cameras]
            watchers = [who for m in self.monitors if m.feed is feed for who in m.watchers]
            if watchers:
                found[" + ".join(names)] = tuple(watchers)
        return found

    def _start_feed(self, url: str, number: int) -> None:
        ring, orders = self.ring(_RING_BYTES), self.ring()
        name = f"source {number + 1}" if len(self._config.sources) > 1 else "source"
        # A file's bad bytes stay, and its beginning is not what the monitors saw last.
        once = is_replay(url)

        def job(place: Place) -> Acquisition:
            return Acquisition(place=place, url=url, ring=ring, orders=orders, once=once)

        to = self._stack.enter_context(RingWriter(orders))
        worker = self._processes.add(name, acquire, job, once=once)
        self.feeds.append(Feed(url, ring, to, worker))

    def _assign(self) -> dict[int, tuple[Path, ...]]:
        """Return the bundles of each source: each bundle goes to the first that it fits.

        Raises:
            BadBundle: It fits none.
        """
        chosen: dict[int, tuple[Path, ...]] = {}
        for path in self._config.bundles:
            why = [
                misfit(path, feed.sensor, feed.cameras, self._config.trust) for feed in self.feeds
            ]
            fitting = [index for index, refusal in enumerate(why) if refusal is None]
            if not fitting:
                raise next(refusal for refusal in why if refusal is not None)
            # Named twice, it watches two sources.
            index = min(fitting, key=lambda i: chosen.get(i, ()).count(path))
            chosen[index] = (*chosen.get(index, ()), path)
        self.unwatched = tuple(
            feed.url
            for index, feed in enumerate(self.feeds)
            if index not in chosen and any(not camera.scene for camera in feed.cameras)
        )
        return chosen

    def _start_monitor(self, feed: Feed, paths: tuple[Path, ...], name: str, rank: Rank) -> None:
        decisions, orders = self.ring(), self.ring()

        def job(place: Place) -> Inference:
            return Inference(
                place=place, bundles=paths,
                checksums=tuple(self._checksums[path] for path in paths),
                sensor=feed.sensor, cameras=feed.cameras,
                ring=feed.ring, source_row=feed.worker.row, decisions=decisions, rank=rank,
                last_step_s=LOOK_S if any(map(is_trial_bundle, paths)) else 0.0,
                least_confidence=self._config.least_confidence, orders=orders,
                drill=self._config.drill, trust=self._config.trust,
                device=self._config.device, levels=dict(self.levels),
            )  # fmt: skip

        heard = self._stack.enter_context(RingReader(decisions))
        to = self._stack.enter_context(RingWriter(orders))
        self.monitors.append(
            MonitorLink(self._processes.add(name, infer, job), decisions, heard, to, feed)
        )

    def _start_recorder(self) -> Worker:
        orders, news = self.ring(), self.ring()
        self.to_recorder = self._stack.enter_context(RingWriter(orders))
        self.news = self._stack.enter_context(RingReader(news))
        sources, self.not_recorded = choose_recorded(
            [(f.ring, f.worker.row, f.sensor, f.cameras) for f in self.feeds]
        )

        def job(place: Place) -> Recording:
            return Recording(
                place=place, sources=sources, orders=orders, news=news,
                largest_bytes=self._config.disk_bytes,
            )  # fmt: skip

        return self._processes.add(RECORDER, record, job, ends_itself=True)

    def ring(self, size: int = _NOTE_BYTES) -> str:
        """Make a ring of `size` bytes that is closed with the station, and return its name."""
        return self._stack.enter_context(Ring(size)).name


def _check_whole(url: str) -> None:
    """Refuse a folder: its recordings are replayed one after another, and a station has one source.

    Raises:
        BadSource: The address is a folder's.
        BadRecording: It is, and no recording is in it.
    """
    files = recordings_of(url)
    if files != [url]:
        raise BadSource(
            "one recording where several processes run",
            f"a folder of {number_of(len(files), 'recording')}",
            f"name one, as in {files[0].removeprefix('replay://').partition('?')[0]}, or run "
            f"{_ALONE}",
        )


def _check_pace(url: str) -> None:
    """Refuse a source that runs faster or slower than the world: its stamps are not now.

    Raises:
        BadSource: Its address asks for another speed than 1.
    """
    asked = options_of(url).get("speed", "1")
    pace = math.inf
    with contextlib.suppress(ValueError):  # max, or what the source itself refuses
        pace = float(asked)
    if pace != 1.0:
        raise BadSource(
            "speed=1 where several processes run", f"speed={asked}",
            f"leave it out, or run {_ALONE}",
        )  # fmt: skip
