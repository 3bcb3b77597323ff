"""From samples to windows: grid, gate, cutting, scaling."""
