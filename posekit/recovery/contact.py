"""How far bodies may overlap where noise has put joints some centimetres off."""

from __future__ import annotations

from typing import Final

CONTACT_METRES: Final = 0.03
"""Metres by which bodies may come nearer than they should, before refinement and after it: depths are off by as much,
and refinement knows nothing of bodies."""


def contact_under_noise(asked: float) -> float:
    """Return the margin (m) that bodies must keep under noise; negative allows penetration, as in `asked`."""
    return asked - CONTACT_METRES
