"""The warning of `taxel live` where verdicts are on camera trials that the bundle was trained on.

Knows nothing about verdicts or screens.
"""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from taxel.errors import TaxelError

if TYPE_CHECKING:
    from taxel.bundles.trials import TrialContract
    from taxel.live.station.station import Station
    from taxel.windows.camera_trials import CameraTrial


def trained_on_warning(contract: TrialContract, source: str) -> str | None:
    """Return a warning where some of a source's trials were trained on, or nobody knows.

    A recording that is no single trial, as one of several grasps, was not.

    Args:
        contract: The bundle's.
        source: Address of the source, or a table of trials; no other than a replay is warned of.
    """
    from taxel.evaluation.camera_trials.learned_trials import trained_on
    from taxel.sources.opening import replayed_files
    from taxel.views.tables.trained_on import trained_on_line, unchecked_line
    from taxel.windows.camera_trials import read_camera_trials

    try:
        files = [Path(source)] if is_table(Path(source)) else replayed_files(source)
        if not files:
            return None
        trials: list[CameraTrial] = []
        for file in files:
            with suppress(TaxelError):
                trials += read_camera_trials(file)
        found = trained_on(contract, trials)
    except (TaxelError, OSError) as error:  # the run is over: its summary is not to be lost
        return unchecked_line("trials", error)
    return trained_on_line(found, "trials", known=bool(contract.learned))


def warn_of_training(station: Station, answers: list[dict[str, Any]]) -> None:
    """Add to what a station's recognisers of camera trials had right the warning, or None.

    Args:
        station: It is over.
        answers: As `Answers.summary` gives them.
    """
    sources = {
        entry["who"]: monitor.feed.url
        for monitor in station.wiring.monitors
        for entry in monitor.bundles
    }
    for answer in answers:
        if "trials" not in answer:
            continue
        from taxel.bundles.trials import read_trial_contract  # needs cameras' extra
        from taxel.views.tables.trained_on import unchecked_line

        answer["warning"] = None
        if not answer["marked"]:
            continue
        try:
            contract = read_trial_contract(Path(answer["bundle"]), station.config.trust)
        except (TaxelError, OSError) as error:  # by now the bundle may be gone
            answer["warning"] = unchecked_line("trials", error)
        else:
            answer["warning"] = trained_on_warning(contract, sources[answer["who"]])


def is_table(path: Path) -> bool:
    """Return whether a source is a table of trials."""
    from taxel.windows.camera_trials import TABLES

    return path.suffix.lower() in TABLES and path.is_file()
