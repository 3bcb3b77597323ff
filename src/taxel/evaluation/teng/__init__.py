"""Table 4.1 of the TENG thesis, and beside it: models, cleaning, time, the gap between splits."""
