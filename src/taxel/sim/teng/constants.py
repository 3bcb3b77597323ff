"""Every constant of the TENG hand's simulator, with its source; frozen under a version.

A change of any value needs a new `SIM_VERSION` and a decision record: models
were judged against these numbers (docs/decisions/0005). Knows nothing about
arrays.
"""

from __future__ import annotations

SIM_VERSION = "1"

SHAPES = ("sphere", "cylinder", "rectangle")
"""Source: TENG thesis, section 4.1."""
MATERIALS = ("aluminium", "glass", "plastic")
"""Source: TENG thesis, section 4.2."""
FINGERS = ("index", "middle", "ring", "little")
"""Four fingers, no thumb. Source: thesis, section 3.3; the names are ours."""
PHALANGES = ("proximal", "middle", "distal")
"""Source: thesis, section 3.3."""
SENSORS = tuple(f"{finger}-{phalanx}" for finger in FINGERS for phalanx in PHALANGES)
"""Twelve, in the order of a window's columns."""

RELATIVE_CHARGE = {"aluminium": 1.0, "glass": 0.86, "plastic": 0.62}
"""Charge against Ecoflex, relative. Source: triboelectric series, unverified."""
HUMIDITY_DECAY = 0.0246
"""Loss of charge a percent of relative humidity. Source: Sci. Rep. 2020."""
HUMIDITY_REFERENCE = 45.0
"""Relative humidity at which the charges above hold, percent. Our choice."""
TEMPERATURE_LOSS = 0.004
"""Loss of charge a kelvin above 23 °C. Our choice."""
TEMPERATURE_REFERENCE = 23.0
"""°C. Source: the mission's reference condition."""
DUST_LOSS = 0.45
"""Share of charge lost on a pad fully covered with dust. Our choice."""
MOISTURE_LOSS = 0.6
"""Share of charge lost on a wet pad; its leakage rises alike. Our choice."""
FORCE_SCALE_N = 0.42
"""α of S = 1 − exp(−F/α), newtons: soft pads saturate early. Tuned, 0005."""

OPEN_VOLTAGE_V = 5.38
"""Voltage of aluminium pressed fully onto a sensor at once, volts: sets the share of scans
above 1.55 V. Tuned to the thesis's 31,000 of 160,000."""
TIME_CONSTANT_S = (0.12, 0.2)
"""R · C of a session, seconds: 0.1 to 0.5 s is needed for the share above. Source: design
study, docs/explanation/physics-teng."""
CAPACITANCE_PF = (150.0, 350.0)
"""Sensor and cable, picofarads; against the converter's 14 pF it sets the ghosts."""
HOLD_CAPACITANCE_PF = 14.0
"""Sample and hold of the AVR converter. Source: ATmega2560 datasheet."""
GROUNDED_GHOST = 0.002
"""Share of a neighbour that remains with grounded pins in between. Our choice."""
SECOND_SENSOR_GAIN = 0.06
"""The second sensor is nearly silent. Source: thesis, section 4.1."""
GAIN_DEVIATION = 0.12
"""Spread of a session's sensor gains, logarithmic. Source: design study,
docs/explanation/physics-teng."""
FIRST_SECOND_CORRELATION = 0.9
"""The first and second sensor are alike. Source: thesis, section 4.1."""

HUM_HZ = 50.0
HUM_V = (0.02, 0.2)
"""Mains hum of a session on one board, volts. Source: docs/explanation/physics-teng."""
HUM_GROUNDED = 0.15
"""Share of the hum that remains with grounded pins. Our choice."""
THIRD_HARMONIC = 0.3
"""Share of the hum. Our choice."""
NOISE_V = 0.012
"""Thermal and converter noise, volts. Our choice."""
BITS = 10
"""Source: ATmega2560 datasheet."""

CONTRAST = 0.21
"""How much of the geometry's pressure pattern reaches the pads; soft Ecoflex spreads the
rest evenly. Tuned, docs/decisions/0005."""
GRASP_DEVIATION = 0.006
"""Spread of a pad's share from grasp to grasp, logarithmic. Tuned, 0005."""
PRESSES = (4, 8)
"""Presses in one grasp: the hand closes, then grips again and again. Our choice."""
PERIOD_S = (0.4, 0.6)
"""From press to press, seconds. Our choice."""
HOLD_SHARE = (0.45, 0.6)
"""Share of the period in which the object is held. Our choice."""
RISE_S = (0.05, 0.1)
"""From first touch to full contact, seconds. Our choice."""
RELATIVE_RISE = {"aluminium": 1.0, "glass": 1.25, "plastic": 1.5}
"""Time to full contact, relative: our choice, docs/decisions/0005."""
FINGER_DELAY_S = 0.03
"""Spread of the fingers' delays, seconds. Our choice."""
REST_S = (0.9, 1.35)
"""Open hand between grasps, seconds. Our choice."""
MOVING_DEPTH = 0.25
"""Share by which a moving object's sliding modulates the contact. Our choice."""
MOVING_HZ = (2.0, 6.0)
"""Rate of that modulation, hertz. Our choice."""
CLOCK_PPM = 40.0
"""Largest error of a board's clock. Source: ceramic resonator's order; our choice."""
USB_DELAY_S = 0.002
"""Mean of the exponential part of a scan's delay to the host, seconds. Our choice."""
