"""Everything that is asked of a validation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from posekit.display.short_repr import ShortRepr
from posekit.errors import InputError
from posekit.settings.judging import JudgingSettings
from posekit.settings.tolerance import EXACT_TOLERANCE, MEASURED_TOLERANCE

Bodies = Literal["auto", "urdf", "visual", "capsules"]
Lengths = Literal["model", "median", "each"]


@dataclass(frozen=True, kw_only=True)
class ValidateSettings(JudgingSettings, ShortRepr):
    """Everything that is asked of a validation, of the stick figure or of a robot.

    Parameters
    ----------
    checks : sequence of str, CheckSettings or check, optional
        Of a figure some of ``rigid-parts``, ``joint-range``, ``collision``, ``walking``, the first three unless told
        otherwise; of a robot some of ``reach``, ``rigid-parts``, ``joint-range``, ``collision``, ``balance``, the
        first four. Of motion checks over time, too (docs, "Checks over time"), those of the profile unless told
        otherwise.
    ranges : str or Ranges
        ``anatomical`` (the default), ``urdf``, ``table1``, the path of a TOML table, or loaded ranges. Of a robot its
        own limits unless the path of a table is given.
    rules : sequence of int
        Rules of walking, 1 to 5. By default 1 and 2.
    walkers : {"paper", "people", "paper-printed"}
        Whose thresholds those have: by the paper's word, as real walkers keep them, or as printed.
    rigid_tolerance : float, optional
        Metres by which distances inside rigid parts, the lengths of the limbs, and the fit of a robot may be off. By
        default 0.03, of a figure more where a spine bends and where noise was measured (docs, "Validate").
    angle_tolerance : float, optional
        Degrees by which the direction of a segment may be off, or a robot's joint outside its limits. By default of a
        figure's postures 2, or what their measuring noise asks for where that is more; of all else 0.001.
    contact_margin : float
        Metres that bodies must keep from each other; negative allows penetration. By default 0. Of a figure's postures
        it is loosened by measuring noise.
    noise : float, optional
        Standard deviation of measured coordinates, metres, by which tolerances that are not given are widened. By
        default it is estimated from the limbs' lengths over time (`posekit.body.measured`).
    lengths : {"model", "median", "each"}, optional
        Whose segment lengths the model has: its own, the medians of the postures (the default), or each posture's own
        (robots alone, slow).
    strict : bool
        Whether postures are judged as those of the model itself: with its lengths, 3 cm and 0.001 degrees, and no
        noise, where these are not given. By default they are judged as those of people who were measured.
    joint_map : str or JointMap, optional
        Which frames of a robot stand for the joints; found by their names where not given.
    bodies : {"auto", "urdf", "visual", "capsules"}
        What collides, of a robot: its collision bodies, its visual bodies, or capsules that are made up; ``auto``
        makes them up where no two collision bodies can touch.
    srdf : str or path, optional
        The robot's SRDF, which says which pairs of bodies are not checked.
    package_dirs : sequence of path
        Where the packages of the robot's meshes are.
    untrusted : bool, optional
        Whether the URDF is first loaded in a child process with limits; by default what is not built in is.
    up : array (3,)
        Against gravity, in the frame of the postures: for ``balance``. By default z.
    profile : str
        Checks over time and their thresholds: ``posekit`` (the default), ``phuma``, or the path of a TOML table.
    ground : float, optional
        Metres of the ground along the axis that points up; estimated from each clip where not given.

    Raises
    ------
    InputError
        Where one of them is impossible, whatever is judged.
    """

    rigid_tolerance: float | None = None
    angle_tolerance: float | None = None
    noise: float | None = None
    lengths: Lengths | None = None
    strict: bool = False
    joint_map: Any = None
    bodies: Bodies = "auto"
    srdf: str | Path | None = None
    package_dirs: Sequence[str | Path] = ()
    untrusted: bool | None = None
    up: ArrayLike = (0.0, 0.0, 1.0)
    profile: str = "posekit"
    ground: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        for what, value in (
            ("rigid tolerance", self.rigid_tolerance),
            ("angle tolerance", self.angle_tolerance),
            ("noise", self.noise),
        ):
            if value is not None and not (math.isfinite(value) and value >= 0):
                raise InputError(f"the {what} is {value!r}; expected zero or a positive, finite number")
        for option, given, known in (
            ("--lengths", self.lengths, (None, *get_args(Lengths))),
            ("--bodies", self.bodies, get_args(Bodies)),
        ):
            if given not in known:
                expected = ", ".join(one for one in known if one is not None)
                raise InputError(f"{option}: {given!r}; expected one of {expected}")
        if self.ground is not None and not math.isfinite(self.ground):
            raise InputError(f"the ground is at {self.ground!r} m; expected a finite height")
        up = np.asarray(self.up, dtype=np.float64)
        if up.shape != (3,) or not np.isfinite(up).all() or not np.linalg.norm(up) > 0:
            raise InputError(f"up is {self.up!r}; expected a direction, three finite numbers")
        object.__setattr__(self, "up", tuple(up.tolist()))
        object.__setattr__(self, "package_dirs", tuple(self.package_dirs))

    @property
    def rigid(self) -> float:
        """The rigid tolerance, metres, without noise."""
        return RIGID_TOLERANCE if self.rigid_tolerance is None else self.rigid_tolerance

    @property
    def angle(self) -> float:
        """The angle tolerance, degrees, of what was not measured: of configurations, and of robots."""
        return EXACT_TOLERANCE.angle if self.angle_tolerance is None else self.angle_tolerance

    def told(self) -> dict[str, Any]:
        """Say what decided verdicts as a report does: in the words of the command line."""
        return {
            "ranges": self.ranges if isinstance(self.ranges, str) else self.ranges.name,
            "rules": ",".join(map(str, self.rules)),
            "walkers": self.walkers,
            "strict": self.strict,
            "rigid_tolerance": f"{100 * self.rigid:g}cm",
            "angle_tolerance": self.angle,
            "contact_margin": f"{100 * self.contact_margin:g}cm",
        }


RIGID_TOLERANCE: Final = MEASURED_TOLERANCE.rigid
"""Metres: measured torsos give by some centimetres (docs, "Tolerances")."""
