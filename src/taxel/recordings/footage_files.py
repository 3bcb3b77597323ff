"""Files of videos and images, known by their names, and what a person is to do with them.

Knows nothing about tables or pixels.
"""

from __future__ import annotations

from pathlib import Path

IMAGES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")
"""Endings of images: those of a folder, or one that is a trial by itself."""
VIDEOS = (".avi", ".mp4", ".m4v", ".mov", ".mkv", ".webm", ".mpg", ".mpeg")
"""Endings by which a video is known where a table or a recording belongs."""
NAME_THEM = (
    "name them in a table trials.csv: first line camera:NAME,label:NAME, then a line for each "
    "trial with its video, image or folder, and its label"
)
"""What to do with videos and images that no table names yet, in messages."""
IMPORT_THEM = f"{NAME_THEM}, and import it: taxel import trials.csv --output recordings"
"""The same where only recordings are of use."""


def is_footage(path: Path) -> bool:
    """Return whether a file is a video or an image, or a folder or its folders hold some."""
    return any(
        file.suffix.lower() in (*IMAGES, *VIDEOS)
        for file in (path, *path.glob("*"), *path.glob("*/*"))
    )
