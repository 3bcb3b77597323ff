"""The image network as 8-bit C for the ATmega2560."""
