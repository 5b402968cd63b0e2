"""Options of `posekit.open`: facts that a file does not state, given by its user, and remarks on what was read."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True, kw_only=True)
class Options:
    """Facts about a file that its user gives; an empty field is found in the file or from its values.

    Attributes
    ----------
    layout : str
        Name of a layout, or path of the user's own TOML file.
    unit : str
        Unit of the file's lengths: "m", "cm", "mm" or "in".
    up : str
        Axis that points away from the ground: "+x", "-x", "+y", "-y", "+z" or "-z".
    rate : float or None
        Frames a second of a file that has no times.
    urdf : str
        Name or path of the robot of a table of configurations.
    person : int or None
        Person of a file of several people, from 0.
    notes, warnings : list of str
        Readers add the assumptions that they make, and the contradictions that a user must see.
    """

    layout: str = ""
    unit: str = ""
    up: str = ""
    rate: float | None = None
    urdf: str = ""
    person: int | None = None
    notes: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)

    def note(self, assumption: str) -> None:
        """Add an assumption."""
        self.notes.append(assumption)

    def warn(self, contradiction: str) -> None:
        """Add a contradiction."""
        self.warnings.append(contradiction)
