"""A new day: three touches of a known object bring a recogniser to the session's level."""

import tempfile
from dataclasses import replace
from pathlib import Path

from taxel.bundles.files import bundle_at_level
from taxel.bundles.levels import measure_level
from taxel.bundles.reader import read_bundle
from taxel.recordings.whole import write_whole
from taxel.sources.simulated.data_sets import write_sessions
from taxel.sources.simulated.teng_options import checked_config
from taxel.training.final import train_bundle
from taxel.training.recipes import find_recipe
from taxel.windows.dataset import load_dataset


def main() -> None:
    with tempfile.TemporaryDirectory() as scratch:
        place = Path(scratch)
        days = {"past": checked_config(scans_per_class=60_000, rate_hz=100.0),
                "today": checked_config(scans_per_class=9_000, rate_hz=100.0, sessions=1, seed=7,
                                        humidity_pct=(33.0, 33.0))}  # fmt: skip
        for name, config in days.items():
            write_sessions(place / name, config, lambda _: None)
        recipe = replace(find_recipe("teng-referenced"), target="material")
        train_bundle(place / "past", recipe, place / "hand.taxel")
        plain = load_dataset(place / "today", replace(recipe.window, reference=None))
        wanted = plain.class_numbers("material")
        for what in ("as it was trained", "after three touches"):
            bundle = read_bundle(place / "hand.taxel")
            found = bundle.probabilities(plain.windows.values, plain.windows.mask).argmax(axis=1)
            print(f"{what}: {(found == wanted).mean():.3f} of today's windows predicted correctly")
            level = measure_level(place / "today", bundle.contract, count=3).level
            write_whole(place / "hand.taxel", bundle_at_level(place / "hand.taxel", level)[1])


if __name__ == "__main__":
    main()
