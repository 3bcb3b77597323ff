"""What verbs print with --json, as files that a report takes."""

from typing import Any

SWEEP = [
    {"fault": "noise", "level": 20.0, "unit": "dB", "accuracy": 0.8, "low": 0.7, "high": 0.9},
    {"fault": "noise", "level": 0.0, "unit": "dB", "accuracy": 0.5, "low": 0.4, "high": 0.6},
]


def transition_tables() -> dict[str, Any]:
    """What `taxel reproduce transition-tables --json` prints, for one model."""
    scores = {"accuracy": 0.97, "interval": [0.95, 0.98], "balanced": 0.96, "auc": 0.99,
              "windows": 100}  # fmt: skip
    rows = [
        {
            "plan": {"tables": tables, "model": "densenet121+lstm", "frames": frames,
                     "published": published},
            "weights": "file:w",
            "parameters": 8126801,
            "published_ms": 31.84,
            "published_mb": 62.72,
            "size_mb": 31.0,
            "single": scores,
            "every_cup": scores if frames == 8 else None,
            "training_s": 1.0,
        }
        for tables, frames, published in (([1, 2, 3], 8, 98.9), ([3], 4, 94.03))
    ]  # fmt: skip
    return {
        "rule": "change",
        "unstable": 0.5,
        "rows": rows,
        "baselines": [{"name": "difference of pixels", "single": scores, "every_cup": scores}],
        "steps": [{"model": "densenet121+lstm", "frames": 8, "engine": "ort", "threads": 1,
                   "stream_ms": 21.5, "window_ms": 90.0}],
    }  # fmt: skip
