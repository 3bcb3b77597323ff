"""Sensor boards on serial ports."""
