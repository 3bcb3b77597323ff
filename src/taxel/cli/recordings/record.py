"""`taxel record`: write what a source delivers to a recording."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import tyro

from taxel.cli.options.page_address import PageAddress
from taxel.cli.options.pairs import Pairs, parse_pairs
from taxel.cli.options.rules import Only
from taxel.cli.printing import print_json, say
from taxel.cli.recordings.recording import ledger_line, record_source, stop_signals
from taxel.errors import BadInput
from taxel.recordings.part_file import check_output


@dataclass(frozen=True)
class Record:
    """Record a source to an MCAP file; Ctrl-C or SIGTERM ends it properly.

    While it runs, the file is called FILE.part; if the recorder is killed, all but the last
    0.1 s can be saved from it.
    """

    source: tyro.conf.Positional[str]
    """Address of the source, such as sim://teng or serial:///dev/ttyUSB0."""
    output: Path
    """The recording to write, ending in .mcap."""
    seconds: float
    """How long to record, seconds of the source's time."""
    label: Pairs = ()
    """Labels of the whole recording, which a model may learn, as in shape=sphere material=glass."""
    group: Pairs = ()
    """Groups of the recording, which a split must keep together, as in session=3 object=cup."""
    plan: Path | None = None
    """A plan of trials (.csv): --output is then a folder, each trial a recording of --seconds that
    begins once the grasp has settled. The same command continues an interrupted plan."""
    tare: bool = False
    """With --plan: first record the untouched gels, to tare/ in the folder."""
    gripper: str | None = None
    """With --plan: address of a gripper that closes with each trial's group:force_n."""
    ask: bool = True
    """With --plan: wait for a key before each trial; a simulated pair never waits."""
    page: PageAddress = None
    """With --plan: show the next trial and what to do on a page; its address is printed. It listens
    on 127.0.0.1 at a free port, or where HOST:PORT says; any host but this machine's own address is
    open to the network."""
    overwrite: bool = False
    """Replace an existing recording."""
    json: bool = False
    """Print the counts (scans; lost, unusable and saturated values) as JSON."""

    RULES: ClassVar = (
        Only(("tare", "gripper", "ask", "page"), "--plan", lambda o: o.plan is not None),
        Only(("tare", "ask"), "real cameras", lambda o: not o.source.startswith("sim://")),
        Only(("label", "group", "overwrite"), "no --plan", lambda o: o.plan is None),
    )

    def run(self) -> None:
        """Record, then print what was recorded and what was lost."""
        from taxel.sources.contract import board_ledgers
        from taxel.sources.opening import open_source, refuse_replayed

        if not self.seconds > 0:
            raise BadInput("--seconds above 0", f"{self.seconds:g}", "name a duration")
        if self.plan is not None:
            self._record_plan(self.plan)
            return
        labels = parse_pairs(self.label, "--label")
        groups = parse_pairs(self.group, "--group")
        check_output(self.output, self.overwrite)
        refuse_replayed(self.output, (self.source,))
        with stop_signals() as stopped, open_source(self.source) as source:
            ledger = record_source(
                source,
                self.output,
                self.seconds,
                labels=labels,
                groups=groups,
                overwrite=self.overwrite,
                stopped=stopped,
            )
            boards = board_ledgers(source)
        if self.json:
            print_json(ledger | ({"boards": boards} if boards else {}), indent=None)
            return
        say(ledger_line(ledger))
        for board in boards:
            if board["losses"]:
                say(f"  {board['path']}: {board['losses']}")

    def _record_plan(self, plan: Path) -> None:
        """Record trial after trial of a plan."""
        from taxel.cli.recordings.record_plan import PlanRecording, record_plan

        options = PlanRecording(
            source=self.source, plan=plan, output=self.output, seconds=self.seconds,
            tare=self.tare, gripper=self.gripper, ask=self.ask, page=self.page, json=self.json,
        )  # fmt: skip
        with stop_signals() as stopped:
            record_plan(options, stopped)
