"""Where samples come from: simulators, replays and, later, boards and cameras."""
