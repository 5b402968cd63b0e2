"""The walking model of Lee & Chen 1985, §3.3: Rules 1-5, each on its own switch.

The body plane holds the line from neck to pelvis and is normal to the moving direction. That is where the trunk faces,
midway between shoulders and hips; in a sequence it is the way that the neck goes (`posekit.recovery.heading`). The
paper takes the head's facing direction: who stands and turns the head by 15 degrees then swings arm and leg of one side
together, and breaks Rule 2. So the rules are with `WalkingThresholds.printed`. Of motion in space the rules are judged
over strides instead (`posekit.validators.motion.walking_phases`).

The *swing* of a joint is its displacement out of the body plane, less the one it has when the figure stands at neutral.
A swing that is not clearly other than zero is no evidence: rules about it are undecided.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.body import Figure
from posekit.body.frames import torso_frame
from posekit.errors import InputError
from posekit.geometry import Array, cross, unit
from posekit.settings.judging import checked_rules
from posekit.skeleton import HEAD, JOINT, JOINTS, SIDES, TORSO
from posekit.tree import Check, Findings, Place, Scope

RULE_NUMBERS = (1, 2, 3, 4, 5)
DEFAULT_RULES = (1, 2)
LIMB_PARTS = (("arms", "shoulder", "elbow", "wrist"), ("legs", "hip", "knee", "ankle"))


SLOWEST_WALK: Final = 0.3
"""Metres a second below which nobody walks: half of what people walk slowly, several times the sway of who stands."""


@dataclass(frozen=True, kw_only=True)
class WalkingThresholds:
    """When a swing is evidence, and what counts as parallel, flexed and vertical.

    The paper gives no numbers; these are posekit's. The defaults take the rules by their word, for figures that walk
    like Lee & Chen's; real walkers keep them as `PEOPLE_THRESHOLDS` says. Options choose either by its name
    (`thresholds_of`).

    Parameters
    ----------
    elbow_swing, knee_swing : float
        Metres that elbow or knee must be out of the body plane: nearer they are "too close to the torso".
    girdle_swing : float
        The same for shoulder and hip.
    out_of_plane : float
        Rule 4: degrees that a limb's segment may leave the plane of moving direction and body axis.
    flexed_knee : float
        Rule 5: degrees above which a knee counts as flexed.
    vertical : float
        Rule 5: degrees that the other leg may lean from the body axis.
    printed : bool
        Whether the head tells the moving direction, of each frame by itself, as the paper has it (§3.3).
    """

    elbow_swing: float = 0.02
    knee_swing: float = 0.02
    girdle_swing: float = 0.01
    out_of_plane: float = 10.0
    flexed_knee: float = 15.0
    vertical: float = 30.0
    printed: bool = False


PEOPLE_THRESHOLDS = WalkingThresholds(
    elbow_swing=0.10, knee_swing=0.25, girdle_swing=0.06, out_of_plane=35.0, flexed_knee=40.0, vertical=35.0
)
"""For real walkers (docs, "Rules of walking"): their shoulders lie behind, their hips before the figure's, arms turned
outward leave the moving plane, and while one leg passes the other both knees are in front, and bent."""

THRESHOLDS_BY_WALKERS: Final[Mapping[str, WalkingThresholds]] = MappingProxyType(
    {
        "paper": WalkingThresholds(),
        "people": PEOPLE_THRESHOLDS,
        "paper-printed": WalkingThresholds(printed=True),
    }
)
"""Thresholds by the name that `--walkers` takes."""


def thresholds_of(walkers: str) -> WalkingThresholds:
    """Return the thresholds for walkers as the paper's, or for people.

    Raises
    ------
    InputError
        Where the name is none of `THRESHOLDS_BY_WALKERS`.
    """
    if walkers not in THRESHOLDS_BY_WALKERS:
        raise InputError(f"--walkers: {walkers!r}; expected one of {', '.join(THRESHOLDS_BY_WALKERS)}")
    return THRESHOLDS_BY_WALKERS[walkers]


def walking(
    figure: Figure, rules: Iterable[int] = DEFAULT_RULES, thresholds: WalkingThresholds | None = None
) -> list[Check]:
    """Make the checks of some of the five rules; they judge the posture itself.

    Raises
    ------
    InputError
        Where a rule is not one of 1 to 5.
    """
    chosen = checked_rules(rules)
    makers = {1: _rule_1, 2: _rule_2, 3: _rule_3, 4: _rule_4, 5: _rule_5}
    body = thresholds or WalkingThresholds()
    return [check for rule in RULE_NUMBERS if rule in chosen for check in makers[rule](figure, body)]


class WalkingAxes(NamedTuple):
    """Axes of the walking body (N, 3): where it moves, its left and its down."""

    forward: Array
    left: Array
    down: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class WalkingRule(Check):
    """What the rules share: the body's axes and the swings of joints.

    Of frames in a sequence `heading` (F, 3) is the way that the body goes, as `posekit.tree.Check.moving` has it.
    """

    figure: Figure
    thresholds: WalkingThresholds
    places: tuple[Place, ...]
    joints: tuple[int, ...]
    heading: Array | None = None
    name: str = "walking"
    unit: str = "m"
    scope = Scope.MOTION

    @cached_property
    def points(self) -> tuple[int, ...]:
        """The torso, the head, then the rule's own joints; last the hips, where these say where the trunk faces."""
        hips = () if self.thresholds.printed else _indices("right_hip", "left_hip")
        return (*(JOINT[name] for name in TORSO), *HEAD, *self.joints, *hips)

    def body(self, points: Array) -> WalkingAxes:
        """Find the axes of the body plane."""
        R_torso = torso_frame(*np.moveaxis(points[:, :4], 1, 0))
        down, facing = -R_torso[:, :, 2], R_torso[:, :, 0]
        if self.thresholds.printed:
            R_head = self.figure.ik.head_frame(points[:, 0], points[:, 4:9])
            facing = np.where(np.isnan(R_head[:, :, 0]), facing, R_head[:, :, 0])
        else:
            hips = unit(cross(down, points[:, -1] - points[:, -2]))
            facing = facing + np.where(np.isnan(hips), 0.0, hips)
            if self.heading is not None:
                facing = np.where(np.isnan(self.heading), facing, self.heading)
        forward = unit(facing - np.einsum("ni,ni->n", facing, down)[:, None] * down)
        return WalkingAxes(forward, cross(forward, down), down)

    def moving(self, heading: Array) -> WalkingRule:
        """Judge frames by the way that the body goes; see `posekit.tree.Check`."""
        return self if self.thresholds.printed else replace(self, heading=heading)

    def judge_frames(self, points: Array, frame: NDArray[np.integer]) -> Findings:
        """Judge postures of some frames; see `posekit.tree.Check`."""
        one = self if self.heading is None else replace(self, heading=self.heading[frame])
        return one.judge(points)

    def joint(self, points: Array, k: int) -> Array:
        """Return the k-th of the rule's own joints (N, 3)."""
        return points[:, 9 + k]

    def swing(self, points: Array, body: WalkingAxes, k: int) -> Array:
        """Return the swing of the k-th joint (N,), metres; NaN where it is not clearly other than zero."""
        index = self.joints[k]
        limits = self.thresholds
        least = {"elbow": limits.elbow_swing, "knee": limits.knee_swing}.get(
            JOINTS[index].split("_")[1], limits.girdle_swing
        )
        displacement = np.einsum("ni,ni->n", self.joint(points, k) - points[:, 0], body.forward)
        swing = displacement - self.figure.neutral_points[index, 0]
        return np.where(np.abs(swing) < least, np.nan, swing)


@dataclass(frozen=True, kw_only=True, eq=False)
class SwingTogether(WalkingRule):
    """Whether two joints swing to the same side: required (Rule 3) or forbidden (Rules 1 and 2).

    The value is the smaller of the two swings, positive where they agree.
    """

    wanted: bool

    def judge(self, points: Array) -> Findings:
        """Compare the signs of the two swings; see `posekit.tree.Check`."""
        body = self.body(points)
        a, b = self.swing(points, body, 0), self.swing(points, body, 1)
        value = (np.sign(a * b) * np.minimum(np.abs(a), np.abs(b)))[:, None]
        bound = np.zeros(1)
        infinite = np.full(1, np.inf)
        return (
            Findings(value=value, lower=bound, upper=infinite)
            if self.wanted
            else Findings(value=value, lower=-infinite, upper=bound)
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class SwingPlane(WalkingRule):
    """Rule 4: both segments of a limb lie parallel to the plane of moving direction and body axis."""

    def judge(self, points: Array) -> Findings:
        """Measure how far each segment leaves the plane; see `posekit.tree.Check`."""
        body = self.body(points)
        angles = []
        for k in (0, 1):
            segment = unit(self.joint(points, k + 1) - self.joint(points, k))
            sine = np.abs(np.einsum("ni,ni->n", segment, body.left))
            angles.append(np.degrees(np.arcsin(np.minimum(sine, 1.0))))
        value = np.maximum(*angles)[:, None]
        return Findings(
            value=value, lower=np.array([-np.inf]), upper=np.array([self.thresholds.out_of_plane])
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class OneKnee(WalkingRule):
    """Rule 5: at most one knee is flexed, and then the other leg stands nearly vertically.

    The value is the lean of the leg that is not (or less) flexed, where the other is; where both are
    flexed, the smaller flexion.
    """

    def judge(self, points: Array) -> Findings:
        """Measure knees and lean; see `posekit.tree.Check`."""
        body = self.body(points)
        flexion, lean = [], []
        for first in (0, 3):
            hip, knee, ankle = (self.joint(points, first + k) for k in range(3))
            flexion.append(_angle(knee - hip, ankle - knee))
            lean.append(_angle(ankle - hip, body.down))
        less = np.argmin(flexion, axis=0)
        rows = np.arange(len(points))
        smaller, larger = np.min(flexion, axis=0), np.max(flexion, axis=0)
        standing = np.array(lean)[less, rows]
        limit = self.thresholds
        standing = np.where(larger > limit.flexed_knee, standing, np.nan)
        return Findings(
            value=np.stack([smaller, standing], axis=-1),
            lower=np.array([-np.inf, -np.inf]),
            upper=np.array([limit.flexed_knee, limit.vertical]),
        )


def _angle(a: Array, b: Array) -> Array:
    """Return the angle between vectors (N, 3), degrees."""
    sine, cosine = np.linalg.norm(cross(a, b), axis=1), np.einsum("ni,ni->n", a, b)
    return np.asarray(np.degrees(np.arctan2(sine, cosine)))


def _indices(*names: str) -> tuple[int, ...]:
    return tuple(JOINT[name] for name in names)


def _rule_1(figure: Figure, thresholds: WalkingThresholds) -> list[Check]:
    """Let not both arms, or both legs, be in front of or behind the torso."""
    return [
        SwingTogether(
            figure=figure,
            thresholds=thresholds,
            places=(Place(name=f"rule1.{limb}"),),
            joints=_indices(f"right_{middle}", f"left_{middle}"),
            wanted=False,
        )
        for limb, _, middle, _ in LIMB_PARTS
    ]


def _rule_2(figure: Figure, thresholds: WalkingThresholds) -> list[Check]:
    """Arm and leg of one side do not swing forward, or backward, together."""
    return [
        SwingTogether(
            figure=figure,
            thresholds=thresholds,
            places=(Place(name=f"rule2.{side}"),),
            joints=_indices(f"{side}_elbow", f"{side}_knee"),
            wanted=False,
        )
        for side in SIDES
    ]


def _rule_3(figure: Figure, thresholds: WalkingThresholds) -> list[Check]:
    """Shoulder and elbow, hip and knee swing the same way."""
    return [
        SwingTogether(
            figure=figure,
            thresholds=thresholds,
            places=(Place(name=f"rule3.{side}_{limb[:-1]}"),),
            joints=_indices(f"{side}_{girdle}", f"{side}_{middle}"),
            wanted=True,
        )
        for limb, girdle, middle, _ in LIMB_PARTS
        for side in SIDES
    ]


def _rule_4(figure: Figure, thresholds: WalkingThresholds) -> list[Check]:
    """Limbs swing in planes parallel to the moving direction."""
    return [
        SwingPlane(
            figure=figure,
            thresholds=thresholds,
            places=(Place(name=f"rule4.{side}_{limb[:-1]}"),),
            joints=_indices(*(f"{side}_{name}" for name in joints)),
            unit="deg",
        )
        for limb, *joints in LIMB_PARTS
        for side in SIDES
    ]


def _rule_5(figure: Figure, thresholds: WalkingThresholds) -> list[Check]:
    """At most one knee is flexed; then the other leg stands."""
    return [
        OneKnee(
            figure=figure,
            thresholds=thresholds,
            places=(Place(name="rule5.knees"), Place(name="rule5.standing_leg")),
            joints=_indices(*(f"{side}_{name}" for side in SIDES for name in ("hip", "knee", "ankle"))),
            unit="deg",
        )
    ]
