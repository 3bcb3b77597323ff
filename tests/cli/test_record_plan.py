"""`taxel record --plan`: trials of the camera pair, told, checked, repeated and gone on with."""

import json
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
import pytest
import tyro

from taxel.actions import guided_trials
from taxel.actions.guided_trials import NotHeld, NotSettled, record_trial
from taxel.cli.recordings import record_plan
from taxel.cli.recordings.record import Record
from taxel.clock import ManualClock
from taxel.errors import BadInput
from taxel.frame_codec import encode_jpeg
from taxel.recordings.manifest import NO_ARRAY
from taxel.recordings.reader import iterate_frames, read_manifest, read_recording
from taxel.recordings.trial_plan import PlannedTrial, read_plan
from taxel.signals import CameraInfo, Frame, Mark, Samples, SensorInfo
from taxel.sim.pour.cup_pour import CupPourConfig, list_runs
from taxel.sources.simulated.pour_sets import groups_of
from taxel.views.page.plan_link import PlanLink

PLANS = Path(__file__).parents[2] / "plans"
CUP = PlannedTrial(number=1, labels={"person": "a"}, groups={"cup": "mug", "force_n": "25"})
SHORT = """group:cup,group:position,group:force_n
00,upper,15
03,lower,50
"""


class Gels:
    """Two cameras at 20 images a second whose pictures move until a moment, then stand still."""

    def __init__(self, still_after_s: float = 0.0, lasts_s: float = 30.0) -> None:
        self.cameras = tuple(
            CameraInfo(name=name, width=32, height=24, rate_hz=20.0) for name in ("left", "right")
        )
        self._still_after_s, self._lasts_s, self._count = still_after_s, lasts_s, 0
        self._given: list[Frame] = []
        self.closed = False

    @property
    def info(self) -> SensorInfo:
        return NO_ARRAY

    @property
    def ended(self) -> bool:
        return self._count / 20.0 >= self._lasts_s

    def read(self, timeout_s: float = 0.1) -> Samples:
        del timeout_s
        time_s = self._count / 20.0
        self._count += 1
        edge = 4 + self._count % 16 if time_s < self._still_after_s else 10
        image = np.full((24, 32, 3), 90, np.uint8)
        image[:, edge:] = 160
        jpeg = encode_jpeg(image)
        self._given = [
            Frame(camera=n, jpeg=jpeg, counter=self._count, device_s=time_s, arrival_s=time_s,
                  fitted_s=time_s)
            for n in range(2)
        ]  # fmt: skip
        return Samples.empty(0)

    def frames(self) -> list[Frame]:
        given, self._given = self._given, []
        return given

    def marks(self) -> list[Mark]:
        return []

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.closed = True


def test_the_recording_begins_where_the_images_have_stood_still(tmp_path: Path):
    messages: list[str] = []
    path = tmp_path / CUP.file_name
    found = record_trial(Gels(still_after_s=1.5), CUP, path, 2.0, messages.append)

    times = [frame.fitted_s for frame in iterate_frames(path)]
    assert found is not None
    assert found.settled_after_s >= 1.3
    assert min(times) == pytest.approx(found.settled_after_s)
    assert max(times) - min(times) == pytest.approx(2.0, abs=0.051)
    assert messages[0].startswith("not settled: the left camera's image changed by")
    assert messages[-1] == "settled: pour now, 2 s are recorded"
    assert read_manifest(path).groups["cup"] == "mug"
    assert read_manifest(path).labels == {"person": "a"}


def test_a_grasp_that_never_settles_is_refused_in_words_and_not_recorded(tmp_path: Path):
    with pytest.raises(NotSettled, match=r"still before the pour.*changed by .* % \(at most 1.5 %"):
        record_trial(Gels(still_after_s=99.0), CUP, tmp_path / CUP.file_name, 2.0)

    assert list(tmp_path.iterdir()) == []


def test_cameras_that_end_too_soon_leave_nothing(tmp_path: Path):
    with pytest.raises(BadInput, match="the end after"):
        record_trial(Gels(lasts_s=1.0), CUP, tmp_path / CUP.file_name, 2.0)

    assert list(tmp_path.iterdir()) == []


def record(plan: Path, output: Path, source: str = "sim://cup-pour?speed=max", *more: str) -> None:
    words = [source, "--plan", str(plan), "--output", str(output), "--seconds", "1", "--json"]
    tyro.cli(Record, args=[*words, *more]).run()


@pytest.fixture
def plan(tmp_path: Path) -> Path:
    path = tmp_path / "plan.csv"
    path.write_text(SHORT, encoding="utf-8")
    return path


def test_the_simulated_pair_records_a_plan_and_goes_on_where_it_was_broken_off(
    plan: Path,
    tmp_path: Path,
    unplugged: Callable[..., None],
    capsys: pytest.CaptureFixture[str],
):
    output = tmp_path / "pours"
    unplugged(guided_trials, "record_trial")
    with pytest.raises(OSError, match="unplugged"):
        record(plan, output)
    first = (output / "trial-001.mcap").stat().st_mtime_ns
    capsys.readouterr()
    record(plan, output)
    printed = json.loads(capsys.readouterr().out)

    assert (printed["trials"], printed["recorded"], len(printed["now"])) == (2, 2, 1)
    assert (output / "trial-001.mcap").stat().st_mtime_ns == first
    last = read_recording(output / "trial-002.mcap")
    assert dict(last.manifest.groups) == {
        "cup": "03", "position": "lower", "force_n": "50", "trial_number": "2",
    }  # fmt: skip
    assert len(last.samples) == 60
    assert len(last.marks) == 1


def test_the_papers_plan_is_its_sixty_videos():
    """Five cups, three parts of the handle, four forces, each once; as the simulator's own set."""
    trials = read_plan(PLANS / "grasp-paper-60.csv")
    own = [{key: groups_of(run)[key] for key in ("cup", "position", "force_n")}
           for run in list_runs(CupPourConfig())]  # fmt: skip

    assert len(trials) == 60
    assert [{k: v for k, v in t.groups.items() if k != "trial_number"} for t in trials] == own


class Typed:
    """Keys typed at the questions, one a question, and what was typed before each of them."""

    def __init__(self, keys: str, early: str = "") -> None:
        self._keys, self._early = list(keys), early

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing to give back."""

    def forget(self) -> bool:
        early, self._early = self._early, ""
        return "q" in early

    def typed(self) -> str:
        early, self._early = self._early, ""
        return early or (self._keys.pop(0) if self._keys else "q")


@pytest.mark.parametrize(
    ("keys", "recorded", "times"),
    [
        ("\n\n", [1, 2], [1, 2]),
        ("\nr\n\n", [1, 2], [1, 1, 2]),
        ("\nd\n", [2], [1, 2]),
        ("\nq", [1], [1]),
        ("drq", [], []),
        ("\nddq", [], [1]),
        ("\nrrq", [], [1]),
    ],
)
def test_a_key_repeats_or_discards_the_last_trial_or_ends(
    keys: str, recorded: list[int], times: list[int], plan: Path, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
):  # fmt: skip
    made = asked(Typed(keys), monkeypatch)
    record(plan, tmp_path / "pours", "camera:///dev/a,/dev/b")

    assert made == times
    files = sorted(path.name for path in (tmp_path / "pours").glob("*.mcap"))
    assert files == [f"trial-00{number}.mcap" for number in recorded]


def test_a_discarded_trial_is_not_counted_as_done_on_the_page(
    plan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    shown: list[tuple[str, int]] = []
    show = PlanLink.show

    def note(board: PlanLink, word: str, *why: str, **values: Any) -> None:
        show(board, word, *why, **values)
        shown.append((word, board.snapshot()["plan"]["done"]))

    monkeypatch.setattr(PlanLink, "show", note)
    asked(Typed("\nd\n"), monkeypatch)
    record(plan, tmp_path / "pours", "camera:///dev/a,/dev/b")
    assert [done for word, done in shown if word == "GET READY"] == [0, 1, 0]
    assert shown[-1] == ("DONE", 1)


@pytest.mark.parametrize(("keys", "times"), [("\ndrq", [1]), ("\nd\nq", [1, 1])])
def test_where_a_grasp_is_made_again_nothing_is_discarded(
    keys: str, times: list[int], plan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
):  # fmt: skip
    made = asked(Typed(keys), monkeypatch, still_after_s=99.0)
    record(plan, tmp_path / "pours", "camera:///dev/a,/dev/b")

    assert made == times
    assert "no last trial to discard now; Enter: ready" in capsys.readouterr().err


def asked(keys: Typed, monkeypatch: pytest.MonkeyPatch, still_after_s: float = 0.0) -> list[int]:
    """Let a person answer with keys; return the numbers of the trials that are then made."""
    made: list[int] = []

    def quick(source: Gels, trial: PlannedTrial, path: Path, *rest: object) -> object:
        made.append(trial.number)
        return record_trial(source, trial, path, 1.0)

    monkeypatch.setattr(guided_trials, "record_trial", quick)
    monkeypatch.setattr(record_plan, "open_source", lambda _: Gels(still_after_s))
    monkeypatch.setattr(record_plan, "Keys", lambda: keys)
    monkeypatch.setattr(record_plan, "SystemClock", ManualClock)
    monkeypatch.setattr(type(record_plan.console), "is_terminal", property(lambda _: True))
    return made


@pytest.mark.parametrize("early", ["\n", "\n\n", "d", "r", "\nq", "q"])
def test_a_key_typed_before_the_question_starts_nothing(
    early: str, plan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    made = asked(Typed("q", early), monkeypatch)
    record(plan, tmp_path / "pours", "camera:///dev/a,/dev/b")

    assert made == []


def test_the_gripper_is_set_to_each_trials_force(
    plan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """On the simulated gripper; a force that it does not have is refused, nothing kept."""
    monkeypatch.setattr(record_plan, "SystemClock", ManualClock)
    forces: list[float] = []
    real: Callable[..., float] = guided_trials.set_grip

    def noted(*args: object) -> float:
        forces.append(real(*args))
        return forces[-1]

    monkeypatch.setattr(guided_trials, "set_grip", noted)
    record(
        plan,
        tmp_path / "pours",
        "sim://cup-pour?speed=max",
        "--gripper",
        "sim://gripper?closing_s=0.05",
    )
    with pytest.raises(BadInput, match="a force of 8 to 40 N"):
        record(plan, tmp_path / "more", "sim://cup-pour?speed=max", "--gripper",
               "sim://gripper?max_force_n=40&closing_s=0.05")  # fmt: skip

    assert forces == [15.0, 50.0, 15.0]


def test_a_gripper_that_closes_on_nothing_records_nothing(
    plan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(record_plan, "SystemClock", ManualClock)
    with pytest.raises(NotHeld, match="got a gripper that closed on nothing"):
        record(plan, tmp_path / "pours", "sim://cup-pour?speed=max", "--gripper",
               "sim://gripper?width_mm=0")  # fmt: skip

    assert list(tmp_path.rglob("*.mcap")) == []


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["camera:///dev/a,/dev/b"], "a terminal"),
        (["sim://teng"], "an array, sim://teng; record an array without --plan, or .* collect"),
        (["serial:///dev/ttyACM0"], "tactile cameras"),
        (["sim://cup-pour", "--tare"], "real cameras"),
        (["sim://cup-pour", "--gripper", "sim://arm"], "a gripper's address"),
    ],
)
def test_what_a_plan_cannot_do_is_refused_in_one_line(
    words: list[str], message: str, plan: Path, tmp_path: Path
):
    with pytest.raises(BadInput, match=message):
        record(plan, tmp_path / "pours", *words)


def test_a_plan_that_names_no_cup_is_refused_for_the_simulated_pair(plan: Path, tmp_path: Path):
    plan.write_text("group:cup,group:force_n\nmug,25\n", encoding="utf-8")
    with pytest.raises(BadInput, match="no position"):
        record(plan, tmp_path / "pours")
