"""Claims about samples and sensors: their shapes are enforced, their flags say what they say."""

import numpy as np
import pytest

from taxel.signals import UNUSABLE, Samples, SensorInfo, Validity, flag_values

INFO = SensorInfo(name="t", channels=("a", "b", "c"), units=("V", "V", "deg"), rate_hz=100.0)


def samples(n: int = 5, channels: int = 3) -> Samples:
    return Samples.from_values(np.arange(n * channels, dtype=float).reshape(n, channels),
                               np.arange(n) / 100.0)  # fmt: skip


@pytest.mark.parametrize("name", ["counter", "device_s", "arrival_s", "fitted_s", "validity"])
def test_arrays_of_other_lengths_are_refused(name: str):
    whole = samples()
    parts = {key: getattr(whole, key) for key in Samples.__slots__}
    parts[name] = parts[name][:-1]
    with pytest.raises(ValueError, match=name):
        Samples(**parts)


def test_from_values_takes_any_number_kind_and_counts_rows():
    made = Samples.from_values(np.array([[1, 2], [3, 4]]), np.array([0.0, 0.5]))
    assert made.values.dtype == np.float32
    np.testing.assert_array_equal(made.counter, [0, 1])
    np.testing.assert_array_equal(made.fitted_s, made.arrival_s)
    assert made.usable.all()


def test_what_is_not_finite_is_flagged_and_not_usable():
    values = np.array([[0.0, np.nan], [np.inf, -np.inf]])
    made = Samples.from_values(values, np.zeros(2), full_scale=3.3)
    assert ((made.validity & Validity.NOT_FINITE) > 0).tolist() == [[False, True], [True, True]]
    assert made.usable.tolist() == [[True, False], [False, False]]


def test_a_saturated_value_is_flagged_and_still_usable():
    """It says "at least": a channel at the rail is not a missing one."""
    full = np.float32(3.3)
    flags = flag_values(np.array([[full, np.nextafter(full, np.float32(0))]], np.float32), 3.3)
    assert flags.tolist() == [[Validity.SATURATED, Validity.GOOD]]
    assert not Validity.SATURATED & UNUSABLE
    assert flag_values(np.array([[9.0]], np.float32), None).tolist() == [[0]]


@pytest.mark.parametrize(
    "flag", [Validity.MISSING, Validity.STALE, Validity.RECONNECTING, Validity.NOT_FINITE]
)
def test_every_other_flag_makes_a_value_unusable(flag: Validity):
    whole = samples()
    whole.validity[2, 1] = flag | Validity.SATURATED
    assert np.argwhere(~whole.usable).tolist() == [[2, 1]]


def test_cutting_and_joining_give_the_whole_again():
    whole = samples(7)
    again = Samples.join([whole[:3], whole[3:3], whole[3:]])
    for name in Samples.__slots__:
        np.testing.assert_array_equal(getattr(again, name), getattr(whole, name))
    np.testing.assert_array_equal(whole[whole.counter > 4].values, whole.values[5:])
    np.testing.assert_array_equal(whole[np.array([6, 0])].counter, [6, 0])


def test_channels_are_picked_in_the_order_asked_for():
    some = INFO.only(("c", "a"))
    assert (some.channels, some.units, some.rate_hz) == (("c", "a"), ("deg", "V"), 100.0)
    picked = samples().only(INFO.indices(("c", "a")))
    np.testing.assert_array_equal(picked.values[0], [2.0, 0.0])
    assert INFO.only(None) is INFO


def test_a_channel_that_is_not_there_is_named():
    with pytest.raises(ValueError, match="thumb"):
        INFO.only(("a", "thumb"))


def test_a_channel_without_a_unit_is_refused():
    with pytest.raises(ValueError, match="one unit a channel"):
        SensorInfo(name="t", channels=("a", "b"), units=("V",), rate_hz=1.0)


def test_no_scans_have_channels_all_the_same():
    none = Samples.empty(4)
    assert (len(none), none.values.shape, none.usable.shape) == (0, (0, 4), (0, 4))


@pytest.mark.parametrize("shape", [(5,), (1, 5, 3)])
def test_values_of_another_number_of_axes_are_refused(shape: tuple[int, ...]):
    """One channel is a column of its own; a row too few or many is said as shapes."""
    with pytest.raises(ValueError, match=r"needed values of shape \(n, channels\)"):
        Samples.from_values(np.zeros(shape), np.zeros(5))


def test_masked_values_are_not_usable():
    """A masked value is a missing one: what stands beneath the mask is nobody's measurement."""
    masked = np.ma.masked_array(np.arange(4).reshape(2, 2), [[False, True], [False, False]])

    scans = Samples.from_values(masked, np.arange(2.0))

    assert scans.usable.tolist() == [[True, False], [True, True]]


@pytest.mark.parametrize("unit", ["datetime64[ns]", "timedelta64[s]"])
def test_dates_are_no_seconds(unit: str):
    """NumPy would take their nanoseconds for seconds."""
    with pytest.raises(ValueError, match="needed time_s as seconds"):
        Samples.from_values(np.zeros((2, 1)), np.arange(2).astype(unit))


@pytest.mark.parametrize("channels", [(), (1, 2)])
def test_only_runs_of_the_same_channels_are_joined(channels: tuple[int, ...]):
    with pytest.raises(ValueError, match="needed runs of the same channels"):
        Samples.join(samples(channels=number) for number in channels)
