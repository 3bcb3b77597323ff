"""How well novel touch is told from known touch."""
