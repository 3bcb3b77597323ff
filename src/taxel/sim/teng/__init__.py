"""The TENG hand: contact, charge, converter; pure physics."""
