"""How well novel touch is distinguished from known touch."""
