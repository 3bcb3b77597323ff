"""Results as tables and notes in the terminal."""
