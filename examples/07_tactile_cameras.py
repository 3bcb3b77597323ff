"""Two tactile cameras on a cup that slips: what the gel shows, beside what truly happened."""

import tempfile
from pathlib import Path

import numpy as np

from taxel.frame_codec import decode_jpeg
from taxel.gel.slip_features import SLIP_FEATURES, SlipFeatures
from taxel.sim.pour.cup_pour import CupPourConfig, list_runs
from taxel.sources.simulated.pour_sets import CAMERA_HZ, write_run
from taxel.training.frames.labels import truth_of
from taxel.windows.camera_recordings import frame_sets, read_camera_recordings
from taxel.windows.rest import SETTLE

config = CupPourConfig(cups=1, positions=("upper",), forces_n=(15.0,), duration_s=6.0, still=0.0)

with tempfile.TemporaryDirectory() as name:
    write_run(Path(name), list_runs(config)[0], config, CAMERA_HZ)
    (pour,) = read_camera_recordings(Path(name))
    truth_um = truth_of(pour)[:, 0]
    pairs = [found.frames for found in frame_sets(pour.path, cameras=2)]

images = [[decode_jpeg(frame.jpeg, None) for frame in pair] for pair in pairs]
gels = [SlipFeatures([pair[camera] for pair in images[SETTLE]]) for camera in (0, 1)]
column = SLIP_FEATURES.index("slip")

print("time   slip seen (left, right)   true slip")
for index, pair in enumerate(images[SETTLE.stop :], start=SETTLE.stop):
    seen_px = np.array([gel.push(image)[column] for gel, image in zip(gels, pair, strict=True)])
    if index % 30 == 0:
        time_s, (left, right) = pour.time_s[index] - pour.time_s[0], seen_px
        print(f"{time_s:4.1f} s {left:8.2f} px {right:8.2f} px {truth_um[index]:10.0f} µm")
