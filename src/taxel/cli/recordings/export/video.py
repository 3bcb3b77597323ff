"""`taxel export video`: a video a camera."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import tyro

from taxel.cli.printing import counted, print_json, say
from taxel.cli.recordings.export.need import depth_cameras, depth_line, need_packages
from taxel.plain_text import number_of
from taxel.recordings.reader import list_recordings


@dataclass(frozen=True)
class Video:
    """Write a video for each camera of each recording, with the times of its frames.

    mjpeg (.mkv) keeps the camera's own JPEG byte by byte. h264 (.mp4) plays in every browser, but
    use it for viewing only: it changes what taxel measures in gel images by 0.4 standard
    deviations. Depth is left out.
    """

    recordings: tyro.conf.Positional[Path]
    """A recording, or a folder of them."""
    output: Path
    """Folder to create."""
    codec: Literal["mjpeg", "h264"] = "mjpeg"
    """How frames are kept: as they came, or coded again for browsers."""
    overwrite: bool = False
    """Replace an older folder of the same kind."""
    json: bool = False
    """Print what was written as JSON."""

    def run(self) -> None:
        """Write the videos, all or none."""
        need_packages("av", "cv2", purpose="videos")
        from taxel.exchange.video_files import write_videos

        paths = list_recordings(self.recordings)
        left_out = depth_cameras(paths)
        with counted("exporting", len(paths)) as progress:
            found = write_videos(
                paths, self.output, codec=self.codec, overwrite=self.overwrite, progress=progress
            )
        if self.json:
            print_json({"output": str(self.output), "videos": found, "left_out": left_out})
            return
        for name, count in found.items():
            frames = (
                number_of(count, "frame") if count else "not written, as the camera gave no image"
            )
            say(f"{self.output / name}: {frames}")
        if left_out:
            say(depth_line(left_out))
