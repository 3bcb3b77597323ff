"""`taxel export ros2`: bags for ROS 2, one a recording."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import tyro

from taxel.cli.printing import counted, print_json, say
from taxel.cli.recordings.export.need import need_packages
from taxel.recordings.reader import list_recordings


@dataclass(frozen=True)
class Ros2:
    """Write a ROS 2 bag for each recording, and the package that defines the touch message.

    Images are sensor_msgs/CompressedImage, marks and slip std_msgs/String with JSON, touch is
    taxel_msgs/TactileState: header, names, units, values, validity. Build the folder taxel_msgs
    with colcon, and "ros2 bag play" plays all topics; without it, all but touch.
    """

    recordings: tyro.conf.Positional[Path]
    """A recording, or a folder of them."""
    output: Path
    """Folder to create."""
    overwrite: bool = False
    """Replace an older folder of the same kind."""
    json: bool = False
    """Print what was written as JSON."""

    def run(self) -> None:
        """Write the bags, all or none."""
        need_packages("mcap", purpose="bags")
        from taxel.exchange.ros2_bag import write_bags

        paths = list_recordings(self.recordings)
        with counted("exporting", len(paths)) as progress:
            found = write_bags(paths, self.output, overwrite=self.overwrite, progress=progress)
        if self.json:
            print_json({"output": str(self.output), "bags": found})
            return
        for name, topics in found.items():
            held = ", ".join(f"{count} on {topic}" for topic, count in topics.items())
            say(f"{self.output / name}: {held or 'nothing'}")
