"""From Taylor's twelve points to the fourteen joints that the checks judge: neck and pelvis are completed.

Taylor's human (2000, Table 1) has two girdles and a spine between their middles, and neither neck nor pelvis. The
pelvis is put on the spine at the figure's own fraction; then the figure's rigid torso, laid onto shoulders and
pelvis, gives the neck. A torso so laid is never its mirror image: which way the body faces follows from left and
right shoulder and the spine.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from posekit.body import Figure
from posekit.body.frames import hips_frame
from posekit.body.lengths import hips_points, torso_points
from posekit.errors import InputError
from posekit.geometry import Array, rotate_back
from posekit.settings import MEASURED_TOLERANCE, Tolerance
from posekit.skeleton import JOINT, JOINTS
from posekit.tree import Check, Findings, Place, Scope
from posekit.validators import PHYSICAL_CHECKS, AnyCheck, CheckOptions, Ranges, make_checks
from posekit.validators.options import LEVEL_CAMERA_UP

MIDDLE_POINTS = ("mid_shoulders", "mid_hips")
SHOULDER_POINTS = ("right_shoulder", "left_shoulder")
COMPLETED_FROM = {"pelvis": MIDDLE_POINTS, "neck": (*SHOULDER_POINTS, *MIDDLE_POINTS)}
"""The points of Taylor's human that place the two joints which it lacks; it has the others itself."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Completion:
    """What a figure's torso says about the joints that Taylor's human lacks.

    Parameters
    ----------
    figure : Figure
        Of Taylor's proportions.
    points : tuple of str (P,)
        The names of the tree's points: the twelve joints and the girdles' middles.

    Raises
    ------
    InputError
        Where one of the fourteen points is not among them.
    """

    figure: Figure
    points: tuple[str, ...]

    def __post_init__(self) -> None:
        needed = [name for name in JOINTS if name not in COMPLETED_FROM] + list(MIDDLE_POINTS)
        missing = [name for name in needed if name not in self.points]
        if missing:
            raise InputError(
                f"the linkage has no {', '.join(missing)}: the checks judge Taylor's human; expected the points "
                f"{', '.join(needed)}"
            )

    @cached_property
    def spine(self) -> float:
        """Length of the figure's spine, middle of the shoulders to pelvis to middle of the hips, metres."""
        return sum(self._spine)

    @cached_property
    def fraction(self) -> float:
        """Where the pelvis lies on the spine: 0 at the shoulders, 1 at the hips."""
        return self._spine[0] / self.spine

    @cached_property
    def neck(self) -> Array:
        """The neck (3,) from the middle of the shoulders, in the frame of shoulders and pelvis, metres."""
        neck, right, left, pelvis = torso_points(self.figure.lengths)
        frame = hips_frame(pelvis, right, left)
        return np.asarray(rotate_back(frame[None], (neck - (right + left) / 2)[None])[0])

    @cached_property
    def _spine(self) -> tuple[float, float]:
        _, right, left, pelvis = torso_points(self.figure.lengths)
        origin, right_hip, left_hip = hips_points(self.figure.lengths)
        above = (right + left) / 2 - pelvis
        below = (right_hip + left_hip) / 2 - origin
        return float(np.linalg.norm(above)), float(np.linalg.norm(below))

    def reads(self, joints: Iterable[int]) -> tuple[int, ...]:
        """Return the tree's points that place some joints of `posekit.skeleton.JOINTS`, in tree order."""
        names = {name for joint in joints for name in COMPLETED_FROM.get(JOINTS[joint], (JOINTS[joint],))}
        return tuple(sorted(self.points.index(name) for name in names))

    def place(self, joints: Sequence[int], points: Array, given: Sequence[int]) -> Array:
        """Place some joints (N, len(joints), 3) from points (N, len(given), 3), which are the tree's `given`."""
        at = {self.points[index]: points[:, column] for column, index in enumerate(given)}
        return np.stack([self._place(JOINTS[joint], at) for joint in joints], axis=1)

    def complete(self, points: Array) -> Array:
        """Place all fourteen joints (N, 14, 3) from all of the tree's points (N, P, 3), metres."""
        return self.place(range(len(JOINTS)), points, range(len(self.points)))

    def _place(self, joint: str, at: dict[str, Array]) -> Array:
        if joint not in COMPLETED_FROM:
            return at[joint]
        shoulders, hips = (at[name] for name in MIDDLE_POINTS)
        pelvis = shoulders + self.fraction * (hips - shoulders)
        if joint == "pelvis":
            return pelvis
        frame = hips_frame(pelvis, *(at[name] for name in SHOULDER_POINTS))
        return np.asarray(shoulders + np.einsum("nij,j->ni", frame, self.neck))


@dataclass(frozen=True, kw_only=True, eq=False)
class Completed(Check):
    """A check of posekit's joints, asked about Taylor's human: the joints that it lacks are completed first.

    Parameters
    ----------
    check : Check
        Reads `posekit.skeleton.JOINTS`; of the head it knows nothing here.
    completion : Completion
        Places neck and pelvis before the check is asked.
    """

    check: Check
    completion: Completion
    points: tuple[int, ...] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", self.completion.reads(self.check.points))

    @property
    def name(self) -> str:
        """The validator's name."""
        return self.check.name

    @cached_property
    def places(self) -> tuple[Place, ...]:
        """The places it judges."""
        return self.check.places

    @property
    def rigid(self) -> bool:
        """Whether it judges rigid parts."""
        return self.check.rigid

    @property
    def unit(self) -> str:
        """Unit of its values."""
        return self.check.unit

    def judge(self, points: Array) -> Findings:
        """Complete the joints that the check reads, and ask it; see `posekit.tree.Check`."""
        return self.check.judge(self.completion.place(self.check.points, points, self.points))


def joint_checks(
    figure: Figure,
    names: Iterable[AnyCheck] = PHYSICAL_CHECKS,
    *,
    ranges: Ranges,
    tolerance: Tolerance = MEASURED_TOLERANCE,
    contact_margin: float = 0.0,
) -> list[Check]:
    """Make the checks of a figure that can judge fourteen joints without a head.

    Rigid parts are the distances inside torso and hips, the completed joints' included: the girdles must lie as
    square to the spine as the figure's do, within the tolerance. The lengths of limbs are the linkage's own, and are
    not asked.

    Parameters
    ----------
    figure : Figure
        Of Taylor's proportions.
    names : iterable of str, Check or CheckSettings
        Some of ``rigid-parts``, ``joint-range``, ``collision``, and others that do not judge motion.
    ranges : Ranges
        The joint ranges.
    tolerance : Tolerance
        Its `rigid` and `angle` count.
    contact_margin : float
        Metres that two bodies must keep from each other.

    Raises
    ------
    InputError
        Where a check is unknown, or is the walking model, which reads motion from a calibrated camera.
    """
    options = CheckOptions(
        ranges=ranges,
        rigid_tolerance=tolerance.rigid,
        rigid_mode="distances",
        limbs=True,
        angle_tolerance=tolerance.angle,
        contact_margin=contact_margin,
        up=LEVEL_CAMERA_UP,
    )
    checks = make_checks(figure, names, options)
    motion = next((check.name for check in checks if check.scope is Scope.MOTION), "")
    if motion:
        raise InputError(
            f"--checks: {motion} needs a head and a calibrated camera; expected some of {', '.join(PHYSICAL_CHECKS)}"
        )
    return [check for check in checks if max(check.points) < len(JOINTS) and not _is_limb(check)]


def taylor_checks(
    figure: Figure,
    points: Sequence[str],
    names: Iterable[AnyCheck] = PHYSICAL_CHECKS,
    *,
    ranges: Ranges,
    tolerance: Tolerance = MEASURED_TOLERANCE,
    contact_margin: float = 0.0,
) -> list[Check]:
    """Make the checks that prune the tree of Taylor's human: `joint_checks`, each behind a `Completed`.

    Parameters
    ----------
    figure : Figure
        Of Taylor's proportions.
    points : sequence of str
        The names of the tree's points, in its order.
    names, ranges, tolerance, contact_margin
        See `joint_checks`.
    """
    completion = Completion(figure=figure, points=tuple(points))
    checks = joint_checks(figure, names, ranges=ranges, tolerance=tolerance, contact_margin=contact_margin)
    return [Completed(check=check, completion=completion) for check in checks]


_TRUNK = tuple(
    JOINT[name] for name in ("neck", "right_shoulder", "left_shoulder", "pelvis", "right_hip", "left_hip")
)


def _is_limb(check: Check) -> bool:
    """Tell whether a check of rigid parts judges a limb's own segment."""
    return check.rigid and not set(check.points) <= set(_TRUNK)
