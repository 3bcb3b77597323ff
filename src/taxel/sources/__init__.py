"""Where samples come from: simulators, replays, sensor boards and cameras."""
