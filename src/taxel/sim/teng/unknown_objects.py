"""Objects that no default data set holds: an elongated prism, and a rubber composite.

The TENG thesis shows its hand these two after training (section 4.3). They stand apart from
`constants`, whose values are frozen under a version, so that the sets made from
those stay as they are (docs/decisions/0027). Knows nothing about arrays.
"""

from __future__ import annotations

UNKNOWN_SHAPES = ("prism",)
"""Elongated prism. Source: TENG thesis, section 4.3."""
UNKNOWN_MATERIALS = ("rubber",)
"""Rubber composite. Source: TENG thesis, section 4.3."""

RELATIVE_CHARGE = {"rubber": 0.5}
"""Charge against Ecoflex, relative to aluminium's: rubbers stand between plastics and silicone
in the triboelectric series, on the same side of Ecoflex as the rest; the filler of a composite
lifts it so far that a firm grasp passes the gate, as the thesis's did. Our choice, 0027."""
RELATIVE_RISE = {"rubber": 2.0}
"""Time to full contact, relative to aluminium's: rubber gives way and creeps, so that its
contact grows for longer than a plastic's 1.5. Our choice, docs/decisions/0027."""
PRISM_HALF_ANGLE_RAD = 1.0471975511965976
"""Half of the angle that one face of a three-sided prism spans seen from its axis, 60°."""
