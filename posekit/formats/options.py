"""Options of `posekit.open`: facts about a file that its user states, and notes and warnings of the readers."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from posekit.errors import refusal, shown
from posekit.geometry import UNIT_WORDS, UP_AXES, UP_WORDS
from posekit.settings import number


@dataclass(frozen=True, kw_only=True)
class Options:
    """Facts about a file that its user states; facts that are not stated are found in the file.

    Words such as ``"meters"`` for the unit and ``"Y"`` or ``"y-up"`` for the axis are accepted. The rate may be a text
    such as ``"30 Hz"``.

    Attributes
    ----------
    layout : str
        Name of a layout, or path of a TOML file with a layout.
    unit : str
        Unit of the file's lengths: "m", "cm", "mm" or "in".
    up : str
        Axis that points away from the ground: "+x", "-x", "+y", "-y", "+z" or "-z".
    rate : float or None
        Frames per second of a file without times.
    urdf : str
        Name or path of the robot whose configurations a table contains.
    person : int or None
        Index of the person in a file of several people, from 0.
    notes, warnings : list of str
        Assumptions of the readers, and contradictions in the file.

    Raises
    ------
    InputError
        If the unit, the axis or the rate is invalid.
    """

    layout: str = ""
    unit: str = ""
    up: str = ""
    rate: float | None = None
    urdf: str = ""
    person: int | None = None
    notes: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        axes = f"one of {', '.join(UP_AXES)}"
        for name, words, expected in (("unit", UNIT_WORDS, "m, cm, mm or in"), ("up", UP_WORDS, axes)):
            given = getattr(self, name)
            if given and str(given).lower() not in words:
                raise refusal("", name, shown(given), expected, "state one of them")
            object.__setattr__(self, name, words.get(str(given).lower(), ""))
        if self.rate is not None:
            rate = number(self.rate, "rate", "frames per second, above 0", "state another")
            if rate <= 0:
                raise refusal("", "rate", shown(self.rate), "frames per second, above 0", "state another")
            object.__setattr__(self, "rate", rate)

    def note(self, assumption: str) -> None:
        """Add an assumption to the notes."""
        self.notes.append(assumption)

    def warn(self, contradiction: str) -> None:
        """Add a contradiction to the warnings."""
        self.warnings.append(contradiction)


def facts_of(**given: Any) -> dict[str, Any]:
    """Return the given facts that are not None, checked and normalized as in `Options`."""
    stated = {name: fact for name, fact in given.items() if fact is not None}
    options = Options(**stated)
    return {name: getattr(options, name) for name in stated}
