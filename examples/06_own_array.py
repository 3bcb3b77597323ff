"""An array of one's own: CSV files and a table in, a recording and windows out."""

import tempfile
from pathlib import Path

import numpy as np

from taxel.recordings.imports.importing import import_table
from taxel.windows.config import WindowConfig
from taxel.windows.dataset import load_dataset

TABLE = """file,label:object,group:session,channels,time,sensor
cup_1.csv,cup,day1,left[N] right[N],ms[ms],pads
cup_2.csv,cup,day2,left[N] right[N],ms[ms],pads
egg_1.csv,egg,day1,left[N] right[N],ms[ms],pads
egg_2.csv,egg,day2,left[N] right[N],ms[ms],pads
"""
rng = np.random.default_rng(0)

with tempfile.TemporaryDirectory() as name:
    folder = Path(name)
    (folder / "table.csv").write_text(TABLE)
    for file, force_n in (("cup_1", 4), ("cup_2", 4.2), ("egg_1", 1), ("egg_2", 0.9)):
        rows = ["ms,left,right"]
        for row in range(200):
            left, right = force_n + rng.normal(0, 0.2, 2)
            rows.append(f"{10 * row},{left:.3f},{right:.3f}")
        (folder / f"{file}.csv").write_text("\n".join(rows))
    import_table(folder / "table.csv", folder / "recordings")
    window = WindowConfig(steps=50, stride=50, grid_hz=None)
    data = load_dataset(folder / "recordings", window, target="object")

print(f"{len(data)} windows of {data.windows.values.shape[1:]} in {len(data.trials)} trials")
for label in data.classes("object"):
    own = data.class_numbers("object") == data.classes("object").index(label)
    print(f"{label}: mean {data.windows.values[own].mean():.2f} {data.sensor.units[0]}")
