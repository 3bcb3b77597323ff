"""Constants of the gel that shears as a layer does: version 2 of the tactile cameras' optics.

They were committed alone, before anything was measured or learned on images made with them
(docs/decisions/0037), and are frozen under their version by a test. Knows no code.
"""

from __future__ import annotations

GEL_VERSION = "2"
"""Recorded with every run made with these constants."""
LAYER_MM = 4.5
"""Thickness of the gel, bonded to a rigid window. Source: FEATS, as in `cup_pour`."""
POISSON = 0.49
"""Poisson's ratio of a silicone gel. Source: our choice; nearly incompressible."""
CELLS = 13
"""Cells along each axis of the contact; 137 lie inside its ellipse. Source: our choice, the
finest that costs less than a third of an image."""
FIELD_MM = 14.0
"""Reach of the displacement field from the contact's middle, millimetres. Source: our choice;
half an image's diagonal is 13 mm, and beyond 8 mm from the rim nothing moves."""
SIZE_STEP = 0.02
"""Relative steps in which the contact's half axes are taken. Source: our choice."""
TOLERANCE_MM = 2e-4
"""At which the friction solver ends, millimetres. Source: our choice; stick is then right to
0.5 µm RMS, a seventh of what poses from images reach."""
MOST_ITERATIONS = 60
"""Of the friction solver, a moment. Source: our choice."""
HANG_STEPS = 4
"""Steps in which the empty cup's load comes on, before time zero. Source: our choice."""
