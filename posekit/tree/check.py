"""The protocol between the interpretation tree and whatever judges its nodes."""

from __future__ import annotations

from dataclasses import Field, dataclass, fields, is_dataclass
from enum import Enum
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.settings import CheckSettings


@dataclass(frozen=True, kw_only=True)
class Findings:
    """What a check found in N postures at K places.

    Parameters
    ----------
    value : array (N, K)
        The judged quantity in the check's unit; NaN where it is undecided: not applicable, too close to
        call, or a joint is missing.
    lower, upper : array broadcastable to (N, K)
        Its bounds.
    tolerance : float or array broadcastable to (N, K)
        How far outside a bound is still not a violation (rounding, stated noise), in the same unit.
    rejects : bool array (N, K), optional
        The verdict itself, where another library gave it; else it follows from value and bounds.
    """

    value: Array
    lower: Array
    upper: Array
    tolerance: float | Array = 0.0
    rejects: NDArray[np.bool_] | None = None

    @property
    def margin(self) -> Array:
        """Distance to the nearer bound (N, K): negative outside, NaN undecided."""
        return np.minimum(self.value - self.lower, self.upper - self.value)

    @property
    def violated(self) -> NDArray[np.bool_]:
        """Where the value is outside its bounds by more than the tolerance (N, K); False where undecided."""
        return self.margin < -self.tolerance if self.rejects is None else self.rejects

    @property
    def undecided(self) -> NDArray[np.bool_]:
        """Where nothing could be judged (N, K)."""
        return np.isnan(self.margin)


@dataclass(frozen=True, kw_only=True)
class Place:
    """What a check judges, one of its K places: an angle of a joint, a segment, two bodies, or whatever is named.

    Parameters
    ----------
    joint, angle : str
        A joint, and which of its angles: ``right_elbow`` and ``flexion``.
    segment : str
        A segment by its two ends: ``neck-pelvis``.
    bodies : tuple of str
        Links of the figure whose distance is judged.
    name : str
        What files and reports call the place, where that does not follow from the rest.

    Examples
    --------
    >>> str(Place(joint="right_elbow", angle="flexion"))
    'right_elbow.flexion'
    """

    joint: str = ""
    angle: str = ""
    segment: str = ""
    bodies: tuple[str, ...] = ()
    name: str = ""

    def __str__(self) -> str:
        angle = f"{self.joint}.{self.angle}" if self.angle else self.joint
        return self.name or self.segment or "-".join(self.bodies) or angle

    @staticmethod
    def of_angles(*names: str) -> tuple[Place, ...]:
        """Return the places of some of `posekit.skeleton.DOFS`."""
        pairs = [name.split(".") for name in names]
        return tuple(Place(joint=joint, angle=angle) for joint, angle in pairs)


class Scope(Enum):
    """What a check must know besides the points of a posture, and when it is asked."""

    POSTURE = "posture"
    """Nothing: it judges a posture in any frame."""
    VIEW = "view"
    """Which way is up (`Check.oriented`), in the frame of the postures: in a recovery that of the camera."""
    MOTION = "motion"
    """How people move: it is asked after the tree is grown, and never of refined postures."""


class Loosening(Enum):
    """What noise does to the tolerance of a check, before survivors are refined."""

    TOLERANCE = "tolerance"
    """Nothing: the check is judged with its own tolerance."""
    DIRECTIONS = "directions"
    """It judges angles: its tolerance is times the degrees by which noise may turn its segments
    (`posekit.refinement.under_noise`)."""
    REFINED = "refined"
    """It is not asked before: of refined postures alone."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Rule:
    """The compiled form of a check: a screen as numbers, for loops that grow whole trees and ask checks on the way.

    A screen tells what is clear in a posture (see `posekit.compiled.frame_kernels.screen`). Findings are those of
    `Check.judge` alone: where a screen says a place, `judge` finds that place violated first.

    Parameters
    ----------
    kind : int
        What the loops take the numbers for: one of the kinds of `posekit.compiled.screen_kinds`.
    numbers : array (N,)
        What the screen is made with.
    presumed : int
        How many numbers it gives for `Check.confirm` with every place violated; 0 where none need be confirmed.
    """

    kind: int
    numbers: Array
    presumed: int = 0


class Check:
    """One kind of judgement over a fixed set of points, in batches.

    Whoever inherits from it says `name`, `unit`, `places` and `points`, as fields, attributes or properties, and writes
    `judge`. All else has a default, and whatever asks checks goes by that: nobody asks for a check by its name.
    """

    # Declared to type checkers alone: at run time a dataclass would take an inherited property for the default of its
    # own field.
    if TYPE_CHECKING:

        @property
        def name(self) -> str:
            """What results call it: ``joint_range``."""
            ...

        @property
        def unit(self) -> str:
            """Unit of its values: ``m`` or ``deg``."""
            ...

        @property
        def places(self) -> tuple[Place, ...]:
            """The K places that it judges."""
            ...

        @property
        def points(self) -> tuple[int, ...]:
            """The points that it reads, as indices into `posekit.skeleton.POINTS`.

            The tree asks it at the first level where all of them are known.
            """
            ...

        @property
        def scope(self) -> Scope:
            """What it must know besides these points; nothing unless told otherwise."""
            ...

        @property
        def noise(self) -> Loosening:
            """How noise loosens it; not at all unless told otherwise."""
            ...

        @property
        def rule(self) -> Rule | None:
            """Its compiled form. A check without one is asked in NumPy, about what compiled loops left."""
            ...

        @property
        def rigid(self) -> bool:
            """Whether it compares rigid parts with the figure's: what fits to rounding is evidence of exact points."""
            ...

        @property
        def pulls(self) -> bool:
            """Whether refinement keeps to its bounds, where these are of angles other than the figure's own."""
            ...

        @property
        def scaled(self) -> bool:
            """Whether its own tolerances grow where its angles turn faster than the segments that they are of."""
            ...

        @property
        def slow(self) -> bool:
            """Whether it costs more than a little arithmetic a posture: it is then asked last, of what is left."""
            ...

        @property
        def of_configuration(self) -> bool:
            """Whether the model's limits and bodies alone say the same of a configuration q."""
            ...

        @property
        def needs_head(self) -> bool:
            """Whether it says nothing where the head's points are a detector's, not quite the figure's own."""
            ...

    else:
        scope = Scope.POSTURE
        noise = Loosening.TOLERANCE
        rule = None
        rigid = pulls = scaled = slow = of_configuration = needs_head = False

    @cached_property
    def where(self) -> tuple[str, ...]:
        """The K places as files and reports name them: ``("right_elbow.flexion",)``."""
        return tuple(map(str, self.places))

    @property
    def passing(self) -> Rule | None:
        """A compiled form that passes nothing the check rejects; it may leave some that the check itself passes."""
        return self.rule

    def judge(self, points: Array) -> Findings:
        """Judge postures given as the check's own points, (N, len(self.points), 3), metres."""
        raise NotImplementedError

    def judge_frames(self, points: Array, frame: NDArray[np.integer]) -> Findings:
        """Judge postures of which it is known which frame each is of (N,): all alike unless told otherwise."""
        del frame
        return self.judge(points)

    def judge_looped(self, points: Array) -> Findings:
        """Judge many postures by compiled loops, to rounding as `judge` does; by that, where there are none."""
        return self.judge(points)

    def confirm(self, presumed: Array) -> bool:
        """Ask whoever has the last word whether all that its screen presumed (M, …) is so; see `Rule`."""
        del presumed
        return True

    @property
    def settings(self) -> CheckSettings:
        """What settings and files record of it, so that another process can make the same.

        Its class as ``package.module:Class``, and those of a dataclass's fields that are not as they are by default. In
        this process the object itself is remembered (`given_check`).
        """
        kind = type(self)
        parameters: dict[str, Any] = {}
        own: tuple[Field[Any], ...] = fields(self) if is_dataclass(self) else ()
        for item in own:
            value = getattr(self, item.name)
            value = value.tolist() if isinstance(value, np.ndarray) else value
            if item.init and value != item.default:
                parameters[item.name] = value
        settings = CheckSettings(name=f"{kind.__module__}:{kind.__qualname__}", parameters=parameters)
        _GIVEN[settings] = self
        return settings

    def oriented(self, up: Array) -> Check:
        """Return the check for postures of whose frame it is known which way is up (3,): for those of scope `VIEW`."""
        del up
        return self

    def moving(self, heading: Array) -> Check:
        """Return the check for frames of which it is known where the body goes: for those of scope `MOTION`.

        Parameters
        ----------
        heading : array (F, 3)
            Unit vectors; NaN where that is not known.
        """
        del heading
        return self


_GIVEN: dict[CheckSettings, Check] = {}
"""Checks that were given as objects in this process: what is here need not be imported, as a notebook's own class."""


def given_check(settings: CheckSettings) -> Check | None:
    """Return the check of which settings were recorded in this process; None where there is none."""
    return _GIVEN.get(settings)
