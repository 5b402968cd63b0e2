"""How much a view may disagree with the figure, and how a frame was judged."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal

from posekit.errors import InputError
from posekit.skeleton import HIPS, JOINT, RIGID_SEGMENTS

ALLOWED_DEVIATIONS: Final = 3.0
"""Standard deviations that are allowed for, unless told otherwise: beyond them is one point in 370."""

Judged = Literal["exact", "measured", "photograph", "noisy", "refined", "given"]
"""How a frame was judged.

As ``exact``, ``measured`` or a ``photograph`` (the three tolerances below), ``noisy`` (as the deviation of its image
points lets its placed neck be off), ``refined`` (the same, and to the likeliest postures), or with a tolerance that was
``given``.
"""


@dataclass(frozen=True, kw_only=True)
class RigidTolerance:
    """How far each distance inside torso and hips may be off: not all of them give alike.

    See docs, "A torso that gives".

    Parameters
    ----------
    shoulders : float
        From shoulder to shoulder, metres: what clavicles give.
    sides : float
        From each shoulder to the pelvis, metres: what the spine gives when it bends, too.
    hips : float
        From hip to hip, metres. The pelvis is bone; it is off where its depth is, which the spine's length lifts.
    own : tuple of ((int, int), float)
        Other segments and what they may be off, metres; those that are not named give as what gives most.
    """

    shoulders: float
    sides: float
    hips: float
    own: tuple[tuple[tuple[int, int], float], ...] = ()

    def __post_init__(self) -> None:
        named = {"shoulders": self.shoulders, "sides": self.sides, "hips": self.hips}
        for name, metres in (*named.items(), *((str(segment), each) for segment, each in self.own)):
            if not (math.isfinite(metres) and metres >= 0):
                raise InputError(
                    f"the rigid tolerance of {name} is {metres!r} m; expected zero or a positive, finite number"
                )

    @staticmethod
    def uniform(metres: float) -> RigidTolerance:
        """Allow all distances the same."""
        return RigidTolerance(shoulders=metres, sides=metres, hips=metres)

    @property
    def widest(self) -> float:
        """The largest of them, metres: that of whatever is none of the four."""
        return max(self.shoulders, self.sides, self.hips)

    def of(self, segment: tuple[int, int]) -> float:
        """Return what a distance between two joints may be off, metres."""
        if segment not in RIGID_SEGMENTS:
            return dict(self.own).get(segment, self.widest)
        if set(segment) <= {JOINT[name] for name in HIPS}:
            return self.hips
        return self.sides if JOINT["pelvis"] in segment else self.shoulders


@dataclass(frozen=True, kw_only=True)
class Tolerance:
    """Allowances for lengths and image points that are not exact.

    Parameters
    ----------
    rigid : float
        Metres by which distances inside torso and hips may be off.
    tangent : float
        Metres by which a segment may be too short for its image: its end is then put at the nearest point of
        the ray, and the posture carries what is missing as its length residual.
    placement : bool
        Whether the torso must also be the figure's own laid onto the posture. With centimetres of tolerance only
        the side on which the shoulders lie is asked, which tells it from its mirror image.
    angle : float
        Degrees by which the direction of a segment may be off, for joint ranges.
    hips : float
        What part of `rigid` the distance from hip to hip may be off, 0 to 1: shoulders and spines give, the pelvis is
        bone.
    """

    rigid: float
    tangent: float
    placement: bool
    angle: float = 1e-3
    hips: float = 1.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.angle) and self.angle >= 0):
            raise InputError(
                f"the angle tolerance is {self.angle!r} degrees; expected zero or a positive number"
            )
        for name in ("rigid", "tangent"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0):
                raise InputError(f"--{name}-tolerance: {value!r} m; expected zero or a positive length")
        if not 0 <= self.hips <= 1:
            raise InputError(
                f"the hips' part of the rigid tolerance is {self.hips!r}; expected a number from 0 to 1"
            )

    @property
    def distances(self) -> RigidTolerance:
        """What each distance inside torso and hips may be off."""
        return RigidTolerance(shoulders=self.rigid, sides=self.rigid, hips=self.hips * self.rigid)


EXACT_TOLERANCE: Final = Tolerance(rigid=1e-8, tangent=1e-9, placement=True)
"""For exact image points: rounding only."""

MEASURED_TOLERANCE: Final = Tolerance(rigid=0.03, tangent=0.01, placement=False, angle=2.0, hips=0.25)
"""For measured image points and bodies: what real torsos give (docs, "A torso that gives")."""

PHOTOGRAPH_TOLERANCE: Final = Tolerance(rigid=0.10, tangent=0.05, placement=False, angle=10.0)
"""For uncalibrated pictures: what took them was no scaled orthographic camera, and from a few metres the scale
differs by some percent between the nearer and the farther limbs (docs, "Uncalibrated pictures")."""


@dataclass(frozen=True, kw_only=True)
class PartialTolerance:
    """Tolerances of which some are given, as on a command line; the others are as is usual for the view.

    Parameters
    ----------
    rigid : float, optional
        Metres by which distances inside torso and hips may be off.
    tangent : float, optional
        Metres by which a segment may be too short for its image.
    angle : float, optional
        Degrees by which the direction of a segment may be off.

    Examples
    --------
    >>> PartialTolerance(tangent=0.02).filled(MEASURED_TOLERANCE).rigid
    0.03
    """

    rigid: float | None = None
    tangent: float | None = None
    angle: float | None = None

    def __post_init__(self) -> None:
        self.filled(MEASURED_TOLERANCE)  # refuses what is no tolerance

    @staticmethod
    def of(*, rigid: float | None, tangent: float | None, angle: float | None) -> PartialTolerance | None:
        """Gather tolerances that may be given; None where none of them is."""
        if rigid is None and tangent is None and angle is None:
            return None
        return PartialTolerance(rigid=rigid, tangent=tangent, angle=angle)

    def filled(self, usual: Tolerance) -> Tolerance:
        """Return the whole tolerance, with what is not given taken from the `usual` one.

        The hips get no smaller part than the rest: who gives a tolerance means it for all distances. The torso is laid
        onto the posture only where rounding alone is allowed.
        """
        rigid = usual.rigid if self.rigid is None else self.rigid
        return Tolerance(
            rigid=rigid,
            tangent=usual.tangent if self.tangent is None else self.tangent,
            placement=rigid <= EXACT_TOLERANCE.rigid,
            angle=usual.angle if self.angle is None else self.angle,
        )
