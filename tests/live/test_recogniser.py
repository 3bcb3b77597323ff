"""Claims about the live path's edges: what it refuses, and when it says that it does not know."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from taxel.bundles.contract import Contract, following
from taxel.bundles.reader import Bundle, read_bundle
from taxel.bundles.writer import write_bundle
from taxel.decisions.recognition import UNKNOWN, RecogniseConfig
from taxel.decisions.unknown import Density, Unknown
from taxel.errors import BadBundle, BadInput
from taxel.live.recogniser import Recogniser
from taxel.live.session import run_session
from taxel.models.cnn2d import Cnn2d
from taxel.signals import Mark, Samples, SensorInfo, Validity
from taxel.training.loop import new_network
from taxel.windows.config import WindowConfig
from taxel.windows.scaling import fit_scaling

STEPS, CHANNELS = 6, 3
SENSOR = SensorInfo(
    name="t", channels=("a", "b", "c"), units=("V",) * CHANNELS, rate_hz=100.0, full_scale=3.3
)
ANY = RecogniseConfig(least_confidence=0.0)


def touch(n: int, start: int = 0) -> Samples:
    values = np.random.default_rng(start).random((n, CHANNELS)) * 3.0
    return Samples.from_values(values, (start + np.arange(n)) / 100.0, full_scale=3.3)


def bundle(
    folder: Path,
    window: WindowConfig,
    channels: tuple[str, ...] = ("a", "b", "c"),
    unknown: Unknown | None = None,
    rate_hz: float = 100.0,
):
    width = len(channels)
    values = touch(STEPS * 10).values.reshape(10, STEPS, CHANNELS)[:, :, :width].copy()
    mask = np.ones((10, STEPS), bool)
    contract = Contract(
        target="shape",
        classes=("cube", "sphere"),
        window=window,
        scaling=fit_scaling("full-scale", values, mask, 3.3),
        channels=channels,
        units=("V",) * width,
        rate_hz=rate_hz,
        model="cnn2d",
        parameters=1,
        data_digest="0" * 64,
        accuracy={},
        software="taxel test",
        parity=None,
        unknown=unknown,
    )
    network = new_network(lambda: Cnn2d(STEPS, width, 2), 0)
    write_bundle(folder / "b.taxel", (network,), contract, values, mask)
    return read_bundle(folder / "b.taxel")


@pytest.fixture
def plain(tmp_path: Path) -> Bundle:
    return bundle(tmp_path, WindowConfig(steps=STEPS, stride=STEPS))


def test_recordings_of_a_single_scan_have_no_rate_and_are_recognised(tmp_path: Path):
    """One reading a grasp: a window of one row is answered, and rehearsing it changes nothing."""
    window = WindowConfig(steps=STEPS, stride=STEPS, grid_hz=None, gate=None)
    recogniser = Recogniser(bundle(tmp_path, window, rate_hz=0.0), replace(SENSOR, rate_hz=0.0))
    for start in range(STEPS):
        assert len(recogniser.push(touch(1, start))) == int(start == STEPS - 1)
        recogniser.warm()


@pytest.mark.parametrize(
    "other",
    [
        replace(SENSOR, channels=("a", "b"), units=("V", "V")),
        replace(SENSOR, units=("V", "V", "count")),
    ],
    ids=["fewer channels", "another unit"],
)
def test_a_sensor_that_the_bundle_was_not_made_for_is_refused(plain: Bundle, other: SensorInfo):
    with pytest.raises(BadBundle, match="3 channels in V") as caught:
        Recogniser(plain, other)
    assert "\n" not in str(caught.value)


def test_another_rate_is_refused_where_scans_are_rows(tmp_path: Path):
    """Six scans at 1 kHz are not the 60 ms that the bundle was trained on; a grid makes them so."""
    fast = replace(SENSOR, rate_hz=1000.0)
    own = bundle(tmp_path, WindowConfig(steps=STEPS, stride=STEPS, grid_hz=None))
    Recogniser(own, replace(SENSOR, rate_hz=95.0))
    with pytest.raises(BadBundle, match="1000 from 't'"):
        Recogniser(own, fast)
    Recogniser(bundle(tmp_path, WindowConfig(steps=STEPS, stride=STEPS)), fast)


@pytest.mark.parametrize("names", [("c", "b", "a"), ("a", "b", "x")])
def test_channels_of_another_order_or_name_are_refused_with_both(
    plain: Bundle, names: tuple[str, ...]
):
    """A finger's values in another finger's column would be told as touch that never was."""
    with pytest.raises(BadBundle, match=f"a, b, c, in this order; got {', '.join(names)} from 't'"):
        Recogniser(plain, replace(SENSOR, channels=names))


def test_named_channels_are_found_wherever_they_stand(tmp_path: Path):
    """A bundle of channels c and a takes these two from any array that has them."""
    window = WindowConfig(steps=STEPS, stride=STEPS, channels=("c", "a"))
    made = bundle(tmp_path, window, channels=("c", "a"))
    samples = touch(STEPS)
    turned = replace(SENSOR, channels=("c", "b", "a"))
    (here,) = Recogniser(made, SENSOR, ANY).push(samples)
    (there,) = Recogniser(made, turned, ANY).push(samples.only([2, 1, 0]))
    np.testing.assert_array_equal(here.window.values, there.window.values)
    np.testing.assert_array_equal(here.window.values[0], samples.values[:, [2, 0]])
    with pytest.raises(BadBundle):
        Recogniser(made, replace(SENSOR, channels=("x", "b", "a")))


def test_a_missing_value_makes_its_window_unknown_and_no_other(plain: Bundle):
    samples = touch(3 * STEPS)
    samples.validity[STEPS + 2, 1] = Validity.MISSING
    answers = Recogniser(plain, SENSOR, ANY).push(samples)
    labels = [answer.decision.label for answer in answers]
    assert labels[1] == UNKNOWN
    assert UNKNOWN not in (labels[0], labels[2])
    assert "missing" in answers[1].decision.reason


def test_a_sensor_that_is_gone_is_unknown_and_the_outage_is_in_the_summary(tmp_path: Path):
    """Twenty windows of 60 ms, of which the sixth to the fifteenth hold nothing."""
    made = bundle(tmp_path, WindowConfig(steps=STEPS, stride=STEPS, max_gap_s=0.2))
    samples = touch(20 * STEPS)
    samples.validity[5 * STEPS : 15 * STEPS] = Validity.MISSING
    seen: list[str] = []
    parts = [(samples[first : first + STEPS], []) for first in range(0, 20 * STEPS, STEPS)]
    (tally,) = run_session(
        Given(parts), [Recogniser(made, SENSOR, ANY)],  # type: ignore[arg-type]
        show=lambda _, tallies: seen.append(tallies[0].grasp_answer[0]),
    )  # fmt: skip
    # The last good row is at 0.29 s: more than 0.2 s later nothing is known.
    assert [label == UNKNOWN for label in seen] == 8 * [False] + 7 * [True] + 5 * [False]
    (outage,) = tally.summary()["outages"]
    assert (outage["start_s"], outage["end_s"]) == (pytest.approx(0.30), pytest.approx(0.90))
    assert outage["text"] == "usable values again, after 0.6 s"


def test_rows_of_another_rate_than_in_training_are_in_the_summary(tmp_path: Path):
    """Where rows are taken as they come: on a grid they are brought to its rate."""
    slow = Samples.from_values(touch(600).values, np.arange(600) / 50.0, full_scale=3.3)
    parts = [(slow[first : first + 20], []) for first in range(0, 600, 20)]
    for grid, count in ((None, 1), (100.0, 0)):
        made = bundle(tmp_path, WindowConfig(steps=STEPS, stride=STEPS, grid_hz=grid))
        (tally,) = run_session(Given(list(parts)), [Recogniser(made, SENSOR, ANY)])  # type: ignore[arg-type]
        assert len(tally.summary()["rate_changes"]) == count


@pytest.mark.parametrize(
    ("gate", "known", "most"), [(None, 4, 4), (None, 400, 16), (None, 0, 16), (1.0, 4, None)]
)
def test_how_many_windows_are_joined(gate: float | None, known: int, most: int | None, plain):
    window = replace(plain.contract.window, gate=gate)
    contract = replace(plain.contract, window=window, trial_windows=known)
    assert contract.most_windows == most


def test_a_channel_at_the_rail_is_unknown(plain: Bundle):
    samples = touch(STEPS)
    values = samples.values.copy()
    values[:, 2] = 3.3
    railed = Samples.from_values(values, samples.fitted_s, full_scale=3.3)
    (answer,) = Recogniser(plain, SENSOR, ANY).push(railed)
    assert answer.decision.label == UNKNOWN
    assert "limit" in answer.decision.reason


def test_a_doubtful_answer_is_unknown_and_its_probabilities_are_kept(plain: Bundle):
    (answer,) = Recogniser(plain, SENSOR, RecogniseConfig(least_confidence=1.0)).push(touch(STEPS))
    assert answer.decision.label == UNKNOWN
    assert answer.decision.probabilities.sum() == pytest.approx(1.0)
    assert answer.decision.end_s - answer.decision.start_s == pytest.approx((STEPS - 1) / 100)


class Given:
    """A source that gives what it was given, read by read."""

    def __init__(self, parts: list[tuple[Samples, list[Mark]]]) -> None:
        self._parts = parts
        self._done: list[Mark] = []
        self.info = SENSOR

    @property
    def ended(self) -> bool:
        return not self._parts

    def read(self, timeout_s: float = 0.1) -> Samples:
        samples, marks = self._parts.pop(0)
        self._done += marks
        return samples

    def marks(self) -> list[Mark]:
        done, self._done = self._done, []
        return done


def test_only_windows_inside_a_mark_are_counted_against_it(plain: Bundle):
    """Three windows; the mark holds the second, and half of the third."""
    mark = Mark(start_s=0.05, end_s=0.14, labels={"shape": "cube"})
    other = Mark(start_s=0.0, end_s=9.0, labels={"material": "glass"})
    source = Given([(touch(3 * STEPS), [mark, other])])
    (tally,) = run_session(source, [Recogniser(plain, SENSOR, ANY)])  # type: ignore[arg-type]
    assert (tally.windows, tally.marked, tally.grasps) == (3, 1, 1)


def test_a_source_that_falls_silent_or_gives_nothing_is_no_error(plain: Bundle):
    none = Samples.empty(CHANNELS)
    source = Given([(none, []), (touch(STEPS), []), (none, []), (none, [])])
    (tally,) = run_session(source, [Recogniser(plain, SENSOR, ANY)], seconds=9.0)  # type: ignore[arg-type]
    assert tally.windows == 1
    (silent,) = run_session(Given([(none, [])]), [Recogniser(plain, SENSOR)])  # type: ignore[arg-type]
    assert silent.windows == 0
    assert silent.summary()["answers"] == {}


def test_memory_does_not_grow_with_the_stream(plain: Bundle):
    """Ten thousand latencies and two thousand answers are kept, however many there were."""
    from taxel.live import session

    recogniser = Recogniser(plain, SENSOR, ANY)
    (answer,) = recogniser.push(touch(STEPS))
    (tally,) = run_session(Given([]), [recogniser])  # type: ignore[arg-type]
    for _ in range(session._KEPT_LATENCIES + 500):
        tally.add(answer)
    assert len(tally.latencies_s) == session._KEPT_LATENCIES
    assert len(tally._waiting) == session._KEPT_ANSWERS
    assert tally.windows == session._KEPT_LATENCIES + 500


@pytest.mark.parametrize("window", [
    WindowConfig(steps=STEPS, stride=STEPS),
    WindowConfig(steps=STEPS, stride=2, grid_hz=50.0, gate=0.5),
    WindowConfig(steps=STEPS, stride=STEPS, gate=1.0, layout="A"),
])  # fmt: skip
def test_rehearsing_changes_no_answer(tmp_path: Path, window: WindowConfig) -> None:
    """A recogniser that rehearses after every scan answers as one that never does."""
    made = bundle(tmp_path, window)
    plain, eager = (Recogniser(made, SENSOR, ANY) for _ in range(2))
    eager.warm()  # nothing was seen yet: nothing to rehearse
    samples = touch(90)
    for row in range(90):
        expected = plain.push(samples[row : row + 1])
        found = eager.push(samples[row : row + 1])
        eager.warm()
        assert [a.decision.start_s for a in found] == [a.decision.start_s for a in expected]
        for answer, other in zip(found, expected, strict=True):
            np.testing.assert_array_equal(answer.window.values, other.window.values)
            np.testing.assert_array_equal(
                answer.decision.probabilities, other.decision.probabilities
            )


def test_near_holds_when_one_row_is_missing(plain: Bundle) -> None:
    """The live loop stays awake for a window's last row only."""
    recogniser = Recogniser(plain, SENSOR, ANY)
    near = []
    for row in range(2 * STEPS):
        recogniser.push(touch(1, start=row))
        near.append(recogniser.near)
    assert near == [False] * (STEPS - 2) + [True, False] + [False] * (STEPS - 2) + [True, False]


def strict() -> Unknown:
    """Known touch lies about 1 V and hardly moves; touch() gives 0 to 3 V."""
    density = Density(
        label="shape",
        projection=np.eye(3 * CHANNELS, 1),
        centres=np.zeros((1, 1)),
        log_share=np.zeros(1),
        windows=np.linspace(0.0, 1e-3, 99),
        contacts={1: np.linspace(0.0, 1e-3, 99)},
    )
    ones = np.ones(CHANNELS)
    least = np.full((2, CHANNELS), 1e-3)
    return Unknown(
        rejected=0.05, lag=1, level=ones / 3.3, wander=0.01 * ones, least=least,
        densities=(density,),
    )  # fmt: skip


def test_touch_unlike_anything_learned_is_unknown_live(tmp_path: Path):
    made = bundle(tmp_path, WindowConfig(steps=STEPS, stride=STEPS), unknown=strict())
    unusual = touch(STEPS)
    usual = Samples.from_values(np.ones((STEPS, CHANNELS)), unusual.fitted_s + 1.0, full_scale=3.3)
    recogniser = Recogniser(made, SENSOR, ANY)
    answers = recogniser.push(unusual) + recogniser.push(usual)
    assert [answer.decision.label == UNKNOWN for answer in answers] == [True, False]
    assert answers[0].decision.reason == "novel touch (p = 0.01)"


def test_a_missing_value_is_not_reported_as_novel(tmp_path: Path):
    made = bundle(tmp_path, WindowConfig(steps=STEPS, stride=STEPS), unknown=strict())
    samples = touch(STEPS)
    values = samples.values.copy()
    values[2, 1] = np.nan
    bad = Samples.from_values(values, samples.fitted_s, full_scale=3.3)
    (answer,) = Recogniser(made, SENSOR, ANY).push(bad)
    assert answer.decision.label == UNKNOWN
    assert "unlike" not in answer.decision.reason


def test_a_session_ends_within_the_block_that_a_read_gives(plain: Bundle):
    """Four windows at once, of which two lie within the time; the second grasp is not finished."""
    spans = [(0.0, 0.11), (0.12, 0.23)]
    marks = [Mark(start_s=start, end_s=end, labels={"shape": "cube"}) for start, end in spans]
    source = Given([(touch(4 * STEPS), marks)])
    (tally,) = run_session(source, [Recogniser(plain, SENSOR, ANY)], seconds=0.15)  # type: ignore[arg-type]
    assert (tally.windows, tally.marked, tally.grasps) == (2, 2, 1)


def test_a_gate_that_follows_reports_each_move_live_and_in_the_summary(tmp_path: Path):
    """A bundle states it; a channel that comes to rest 0.4 V higher moves its own gate alone."""
    follows = WindowConfig(
        steps=STEPS, stride=STEPS, grid_hz=None, gate=1.0, gate_follow_s=20.0, max_gap_s=9.0
    )
    values = np.random.default_rng(0).normal([0.0, 0.4, 0.0], 0.005, (3000, CHANNELS))
    given = Samples.from_values(values, np.arange(3000) / 100.0, full_scale=3.3)
    source = Given([(given[first : first + 250], []) for first in range(0, 3000, 250)])
    recogniser = Recogniser(bundle(tmp_path, follows), SENSOR, ANY)
    (tally,) = run_session(source, [recogniser])  # type: ignore[arg-type]
    (move,) = tally.summary()["gate_moves"]
    assert (move["channel"], move["before"]) == ("b", 1.0)
    assert move["after"] == pytest.approx(1.4, abs=0.01)
    assert tally.windows == 0


def test_a_gate_is_made_to_follow_only_where_there_is_one(tmp_path: Path):
    contract = bundle(tmp_path, WindowConfig(steps=STEPS, stride=STEPS, gate=1.0)).contract
    assert following(contract, 30.0).window.gate_follow_s == 30.0
    without = replace(contract, window=WindowConfig(steps=STEPS, stride=STEPS))
    for gate, follow_s in ((without, 30.0), (contract, 0.0)):
        with pytest.raises(BadInput, match="gate above 0 to follow"):
            following(gate, follow_s)
