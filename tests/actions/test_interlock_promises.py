"""Whatever an interlock hears, in any order and at any time: what it promises holds."""

import math

from hypothesis import given
from hypothesis import strategies as st
from interlock_rig import (
    CONFIG,
    GRIP,
    HAND,
    HOLDING,
    RAISED,
    STOP,
    STOPPED,
)

from taxel.actions.interlock import Interlock

ANY = st.floats(allow_nan=True, allow_infinity=True)
TIMES = st.one_of(st.floats(0.0, 0.3), ANY)
EVENTS = st.one_of(
    st.tuples(
        st.just("decision"),
        st.sampled_from(["STABLE", "WARNING", "UNSTABLE", "UNKNOWN", "", "stable"]),
        st.one_of(st.none(), ANY),
    ),
    st.tuples(st.just("beat"), st.none(), st.none()),
    st.tuples(st.just("device"), st.booleans(), st.none()),
    st.tuples(st.just("current"), st.one_of(st.floats(0, 1000), ANY), st.none()),
    st.tuples(st.just("fault"), st.sampled_from(["a", "b"]), st.none()),
    st.tuples(st.just("fault_gone"), st.sampled_from(["a", "b"]), st.none()),
    st.tuples(st.just("release"), st.one_of(st.floats(0, 50), ANY), st.none()),
    st.tuples(st.just("arm"), st.none(), st.none()),
    st.tuples(st.just("disarm"), st.none(), st.none()),
    st.tuples(st.just("well"), st.none(), st.none()),
)


@given(st.lists(st.tuples(EVENTS, TIMES), max_size=80), st.booleans())
def test_whatever_comes_the_promises_hold(
    events: list[tuple[tuple[str, object, object], float]], hand: bool
) -> None:
    config = HAND if hand else CONFIG
    lock = Interlock(config)
    now, last_beat, last_kind_stopped = 100.0, -math.inf, False
    last_force, last_tick = config.min_n, now
    for (kind, one, two), step in events:
        now = now + step if math.isfinite(step) and 0 <= step < 1 else now
        stamp = now if math.isfinite(step) else step
        armed_by_hand = False
        released = False
        match kind:
            case "decision":
                lock.decision(str(one), stamp, two)  # type: ignore[arg-type]
            case "beat":
                lock.beat(stamp)
                last_beat = stamp if math.isfinite(stamp) else last_beat
            case "device":
                lock.device(bool(one), stamp)
            case "current":
                lock.contact_current(one, stamp)  # type: ignore[arg-type]
            case "fault":
                lock.fault(str(one), stamp)
            case "fault_gone":
                lock.fault_gone(str(one))
            case "release":
                doubt = lock.state in (RAISED, HOLDING, STOPPED)
                released = lock.release(one)  # type: ignore[arg-type]
                assert not (doubt and lock.force_n < last_force)
            case "arm":
                armed_by_hand = lock.arm(stamp) == ()
            case "disarm":
                lock.disarm(stamp)
            case "well":
                lock.beat(now)
                last_beat = now
                lock.device(True, now)
                lock.contact_current(0.0, now)
        order = lock.tick(now)
        if order.kind is GRIP:
            assert config.min_n <= order.force_n <= config.max_n
            assert lock.state is RAISED
            assert now - last_beat <= config.watchdog_s + 1e-6
            assert not last_kind_stopped or armed_by_hand
            assert now - last_tick <= config.stall_s + 1e-6 or armed_by_hand
        if not released:
            assert lock.force_n <= last_force + config.slew_n_s * config.step_s + 1e-9
            assert lock.force_n >= last_force
        if lock.armed:
            assert now - last_beat <= config.watchdog_s + 1e-6
        if last_kind_stopped and not armed_by_hand:
            assert order.kind is STOP
        last_force, last_tick = lock.force_n, now
        last_kind_stopped = order.kind is STOP
