"""One cup three times: without taxel, with a grip that follows touch, and at full force."""

from taxel.actions.grip_policy import GripPolicy
from taxel.bundles.grasp import read_grasp_bundle
from taxel.bundles.shipped import DEFAULT_WARNING, shipped_bundle
from taxel.live.closed_loop import (
    LoopConfig,
    MonitoredGrip,
    at_full_force,
    open_pour,
    replay_loop,
    run_loop,
)
from taxel.live.grasp_monitor import GraspMonitor
from taxel.sim.pour.cup_pour import CupPourConfig, list_runs

runs = list_runs(CupPourConfig(cups=1, first_cup=7001, forces_n=(15.0,), positions=("upper",)))
config = LoopConfig()
pour = open_pour(runs[0], config)
bundle = read_grasp_bundle(shipped_bundle(DEFAULT_WARNING))
grip = MonitoredGrip(GraspMonitor(bundle, pour.cameras), GripPolicy(runs[0].force_n))

for name, track in (
    ("without taxel", replay_loop(runs[0], config)),
    ("with taxel", run_loop(pour, grip, config)),
    ("at full force", at_full_force(runs[0], config)),
):
    end = "dropped" if track.dropped else "held"
    print(f"{name:<14} {end:<8} at most {track.slip_um:6.0f} µm, {track.force_n.mean():.0f} N")
