"""An interlock whose world is well, and the names of its states and orders."""

from taxel.actions.interlock import Interlock, InterlockConfig, InterlockState, Order, OrderKind

DISARMED, READY, RAISED, HOLDING, STOPPED = InterlockState
NONE, GRIP, HOLD, STOP = OrderKind
CONFIG = InterlockConfig(min_n=10.0, max_n=40.0, slew_n_s=100.0)
HAND = InterlockConfig(min_n=0.0, max_n=1.0, contact_ma=300.0, contact_s=0.02, over_ma=900.0)


class Rig:
    """An interlock whose world is well, ticked every 10 ms."""

    def __init__(self, config: InterlockConfig = CONFIG) -> None:
        self.lock = Interlock(config)
        self.now = 100.0
        self.beating = True
        self.word: str | None = "STABLE"

    def step(self, word: str | None = None, n: int = 1) -> Order:
        """Hear everything, then tick; return the last order."""
        self.word = word or self.word
        for _ in range(n):
            self.now += 0.01
            self.hear()
            order = self.lock.tick(self.now)
        return order

    def hear(self) -> None:
        if self.beating:
            self.lock.beat(self.now)
        if self.word:
            self.lock.decision(self.word, self.now)
        self.lock.device(True, self.now)
        self.lock.contact_current(0.0, self.now)

    def armed(self) -> "Rig":
        self.hear()
        assert self.lock.arm(self.now) == ()
        return self

    def into(self, state: InterlockState) -> "Rig":
        if state is not DISARMED:
            self.armed()
        if state is STOPPED:
            self.lock.fault("a test", self.now)
            self.lock.fault_gone("a test")
        else:
            self.step({READY: "STABLE", RAISED: "WARNING", HOLDING: "UNKNOWN"}.get(state))
        assert self.lock.state is state
        return self
