"""`taxel export lerobot`: a LeRobot data set."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import tyro

from taxel.cli.printing import counted, print_json, say
from taxel.cli.recordings.export.need import depth_cameras, depth_line, need_packages
from taxel.errors import BadInput
from taxel.plain_text import number_of, visible
from taxel.recordings.reader import list_recordings


@dataclass(frozen=True)
class Lerobot:
    """Write recordings as a LeRobot data set, version 3.0, without LeRobot.

    observation.state and observation.tactile: touch at each frame, and the window of scans up to
    it with validity. Images stay JPEG: LeRobot's video codecs would change what taxel measures in
    gel images by 0.2 to 0.4 standard deviations. Labels become tasks; labels and groups are
    columns of the episodes too. LeRobot's time is frame / fps; the exact times are columns of
    their own. Depth is left out. A simulator's ground truth is written as truth.state and
    truth.window instead, so that no policy takes it as an observation.
    """

    recordings: tyro.conf.Positional[Path]
    """A recording, or a folder of them."""
    output: Path
    """Folder to create."""
    fps: int | None = None
    """Frames a second, a whole number; by default the first camera's nominal rate, without
    cameras about 25."""
    rows: int | None = None
    """Scans in the window of each frame; by default a tenth more than fit between two frames."""
    episodes: Literal["recording", "mark"] = "recording"
    """What an episode is: a whole recording, or each labelled interval in it."""
    overwrite: bool = False
    """Replace an older folder of the same kind."""
    json: bool = False
    """Print what was written as JSON."""

    def _check(self) -> None:
        for name, value in (("--fps", self.fps), ("--rows", self.rows)):
            if value is not None and value < 1:
                raise BadInput(f"{name} above 0", f"{value}", "give a whole number above 0")

    def run(self) -> None:
        """Write the data set, whole or not at all."""
        self._check()
        need_packages("pyarrow", "cv2", purpose="LeRobot data sets")
        from taxel.exchange.lerobot_write import write_lerobot
        from taxel.windows.pairs import LARGEST_SKEW_S

        paths = list_recordings(self.recordings)
        left_out = depth_cameras(paths)
        with counted("exporting", len(paths)) as progress:
            written = write_lerobot(
                paths, self.output, fps=self.fps, rows=self.rows, cut=self.episodes,
                overwrite=self.overwrite,
                progress=progress,
            )  # fmt: skip
        if self.json:
            print_json({"output": str(self.output), **written.as_dict(), "left_out": left_out})
            return
        each = number_of(written.frames, "frame") + (
            f" of {number_of(written.rows, 'scan')}" if written.rows else ""
        )
        say(
            f"{self.output}: {number_of(written.episodes, 'episode')}, {each}, {written.fps} "
            "frames/s"
        )
        say(f"tasks: {', '.join(map(repr, written.tasks[:6]))}{' …' if written.tasks[6:] else ''}")
        say(
            f"frame / fps differs from the time of a frame by up to {1000 * written.drift_s:.3g} ms"
        )
        if written.apart_s > LARGEST_SKEW_S:
            say(
                f"warning: the images of a frame are up to {written.apart_s:.3g} s apart, as where "
                "a camera fell silent; their times are in the columns taxel.frame_s.NAME",
                style="yellow",
            )
        if written.truth:
            channels = ", ".join(written.truth)
            say(f"ground truth of the simulator, under truth and not observation: {channels}")
        if left_out:
            say(depth_line(left_out))
        if names := written.recordings_left_out:
            lack = (
                "labelled interval that holds a frame" if self.episodes == "mark"
                else "scan, or no image of a camera"
            )  # fmt: skip
            some = ", ".join(map(visible, names[:6])) + (" …" if names[6:] else "")
            say(f"left out {number_of(len(names), 'recording')} with no {lack}: {some}")
        if marks := written.marks_left_out:
            some = ", ".join(map(visible, marks[:6])) + (" …" if marks[6:] else "")
            say(f"left out {number_of(len(marks), 'labelled interval')} without a frame: {some}")
        if written.scans_left_out:
            say(f"{number_of(written.scans_left_out, 'scan')} in no window; give more with --rows")
        if written.images_left_out:
            say(
                f"{number_of(written.images_left_out, 'image')} without a frame of the first camera"
            )
