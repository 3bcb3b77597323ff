"""How well novel touch and known touch are told apart."""
