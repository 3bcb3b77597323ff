"""Tables, figures, pages and the terminal."""
