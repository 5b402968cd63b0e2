"""Legal and illegal postures of the stick figure, whose verdict is known from how they were made."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from benchmarks.studies.two_models.angles import (
    JUDGED_DOFS,
    PART_DOFS,
    angles_of,
    column,
    excess,
    figure_limits,
)
from posekit.body import Figure
from posekit.body.capsules import Capsule
from posekit.errors import InputError
from posekit.geometry import Array
from posekit.skeleton import JOINT, JOINTS, SIDES
from posekit.synthesis import random_postures

ILLEGAL_KINDS: Final = (
    "beyond a limit",
    "bent the wrong way",
    "arm through the trunk",
    "limb stretched",
    "trunk stretched",
)
"""Kinds of illegal postures."""

BEYOND_DEGREES: Final = (10.0, 60.0)
"""Degrees beyond a limit."""

CLEAR_DEGREES: Final = 5.0
"""Degrees by which an illegal posture is outside the limits however its angles are read."""

MIN_VISIBLE: Final = (0.3, 0.15)
"""Cosine of the middle angle, sine of the bend, below which a limb's angles are hardly to be told apart."""

DEEP_METRES: Final = 0.02
"""Metres of penetration that are no matter of rounding."""

N_DRAWS: Final = 50
"""Ways of an arm that are tried at once."""

STRETCH_METRES: Final = (0.05, 0.15)
"""Metres by which a segment is stretched: more than the 3 cm that rigid parts may give."""

STRETCHED_SEGMENTS: Final[Mapping[str, Mapping[tuple[str, str], tuple[str, ...]]]] = {
    "limb": {
        (f"{side}_{joints[k]}", f"{side}_{joints[k + 1]}"): tuple(
            f"{side}_{joint}" for joint in joints[k + 1 :]
        )
        for side in SIDES
        for joints in (("shoulder", "elbow", "wrist"), ("hip", "knee", "ankle"))
        for k in (0, 1)
    },
    "trunk": {
        **{
            (start, f"{side}_{joints[0]}"): tuple(f"{side}_{joint}" for joint in joints)
            for side in SIDES
            for start, joints in (
                ("neck", ("shoulder", "elbow", "wrist")),
                ("pelvis", ("hip", "knee", "ankle")),
            )
        },
        ("neck", "pelvis"): (
            "pelvis",
            *(f"{side}_{joint}" for side in SIDES for joint in ("hip", "knee", "ankle")),
        ),
    },
}
"""The segments that are stretched, and what moves along."""

Made = tuple[Array, str] | None
"""A posture and what was done to it; none where that did not make it clearly illegal."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Labelled:
    """Postures whose verdict is known from how they were made.

    Parameters
    ----------
    joints : array (N, 14, 3)
        Metres.
    kind : tuple of str
        ``legal``, or one of `ILLEGAL_KINDS`.
    what : tuple of str
        What was changed, and by how much.
    """

    joints: Array
    kind: tuple[str, ...]
    what: tuple[str, ...]

    def __post_init__(self) -> None:
        self.joints.flags.writeable = False


def labelled_postures(figure: Figure, n: int, rng: np.random.Generator) -> Labelled:
    """Make n legal postures, and as many illegal ones of them, of each kind the same number.

    Legal: inside all limits, no bodies in each other. Illegal, each made of a legal one by one change:

    - one angle 10 to 60 degrees beyond its limit, no bodies in each other;
    - one elbow or knee bent 10 to 60 degrees backward, no bodies in each other;
    - one arm turned, inside its limits, until it is 2 cm or more inside torso or hips;
    - one segment of a limb 5 to 15 cm longer, what it carries moved along;
    - the same of the trunk: neck to shoulder, neck to pelvis, pelvis to hip.

    Other angles can place the points alike: an angle is illegal where all of them are five degrees outside.

    Parameters
    ----------
    figure : Figure
    n : int
        A multiple of the number of kinds.
    rng : Generator

    Raises
    ------
    InputError
        Where n is not a positive multiple of the number of kinds.
    """
    if n < 1 or n % len(ILLEGAL_KINDS):
        raise InputError(f"{n} postures were asked for; expected a positive multiple of {len(ILLEGAL_KINDS)}")
    legal = random_postures(figure, n, rng)
    joints = [*figure.forward_kinematics(legal)[:, : len(JOINTS)]]
    kinds, whats = ["legal"] * n, [""] * n
    makers = (_beyond, _wrong_way, _through_trunk, _limb_stretched, _trunk_stretched)
    for kind, make in zip(ILLEGAL_KINDS, makers, strict=True):
        done = 0
        while done < n // len(ILLEGAL_KINDS):
            made = make(figure, legal[rng.integers(n)].copy(), rng)
            if made is not None:
                joints.append(made[0])
                kinds.append(kind)
                whats.append(made[1])
                done += 1
    return Labelled(joints=np.array(joints), kind=tuple(kinds), what=tuple(whats))


def penetration(points: Array, one: Capsule, other: Capsule) -> Array:
    """Return a depth (N,), metres, that two capsules have at least: by the nearest of 41 points on each axis."""
    steps = np.linspace(-1.0, 1.0, 41)
    axes = []
    for capsule in (one, other):
        middle, axis = capsule.place(points[:, list(capsule.points)])
        axes.append(middle[:, None] + (steps * capsule.half_length)[:, None] * axis[:, None])
    apart = np.linalg.norm(axes[0][:, :, None] - axes[1][:, None], axis=3).min(axis=(1, 2))
    return np.asarray(one.radius + other.radius - apart)


def _beyond(figure: Figure, q: Array, rng: np.random.Generator) -> Made:
    """Push one angle beyond a limit; hinges only beyond the upper one."""
    dof = JUDGED_DOFS[rng.integers(len(JUDGED_DOFS))]
    amount = rng.uniform(*BEYOND_DEGREES)
    up = "elbow" in dof or "knee" in dof or rng.random() < 0.5
    lower, upper = figure_limits(figure)[dof]
    return _pushed(
        figure, q, dof, upper + amount if up else lower - amount, f"{amount if up else -amount:+.0f}"
    )


def _wrong_way(figure: Figure, q: Array, rng: np.random.Generator) -> Made:
    hinges = [dofs[-1] for part, dofs in PART_DOFS.items() if part != "pelvis"]
    amount = rng.uniform(*BEYOND_DEGREES)
    return _pushed(figure, q, hinges[rng.integers(len(hinges))], -amount, f"{-amount:+.0f}")


def _pushed(figure: Figure, q: Array, dof: str, angle: float, said: str) -> Made:
    """Set an angle (degrees): it must be outside however it is read, be seen, and be all that is wrong."""
    q[column(figure, dof)] = np.radians(angle)
    part = next(part for part, dofs in PART_DOFS.items() if dof in dofs)
    angles = {name: q[column(figure, name)] for name in PART_DOFS[part]}
    _, middle, _, *bend = angles.values()
    seen = abs(np.cos(middle)) > MIN_VISIBLE[0] and all(abs(np.sin(angle)) > MIN_VISIBLE[1] for angle in bend)
    if not seen or excess(angles_of(figure, q[None]), figure_limits(figure))[part][0] < CLEAR_DEGREES:
        return None
    return None if figure.collides(q[None])[0] else (_placed(figure, q), f"{dof} {said}")


def _through_trunk(figure: Figure, q: Array, rng: np.random.Generator) -> Made:
    """Turn one arm until it is inside the trunk: points on the two capsules' axes prove it."""
    side = SIDES[rng.integers(2)]
    dofs = PART_DOFS[f"{side}_shoulder"]
    lower, upper = np.radians([figure_limits(figure)[dof] for dof in dofs]).T
    many = np.tile(q, (N_DRAWS, 1))
    many[:, [column(figure, dof) for dof in dofs]] = rng.uniform(lower, upper, (N_DRAWS, len(dofs)))
    points = figure.forward_kinematics(many)
    capsules = {capsule.link: capsule for capsule in figure.capsules}
    pairs = [("torso", f"{side}_upper_arm"), ("torso", f"{side}_forearm"), ("hips", f"{side}_forearm")]
    depth = np.stack([penetration(points, capsules[trunk], capsules[arm]) for trunk, arm in pairs], axis=1)
    row = int(np.argmax(depth.max(axis=1) >= DEEP_METRES))
    if depth[row].max() < DEEP_METRES:
        return None
    trunk, arm = pairs[int(np.argmax(depth[row]))]
    return points[row, : len(JOINTS)], f"{trunk}-{arm} {depth[row].max() * 100:.0f} cm"


def _limb_stretched(figure: Figure, q: Array, rng: np.random.Generator) -> Made:
    return _stretched(_placed(figure, q), STRETCHED_SEGMENTS["limb"], rng)


def _trunk_stretched(figure: Figure, q: Array, rng: np.random.Generator) -> Made:
    return _stretched(_placed(figure, q), STRETCHED_SEGMENTS["trunk"], rng)


def _stretched(
    joints: Array, segments: Mapping[tuple[str, str], Sequence[str]], rng: np.random.Generator
) -> Made:
    start, end = list(segments)[rng.integers(len(segments))]
    longer = rng.uniform(*STRETCH_METRES)
    along = joints[JOINT[end]] - joints[JOINT[start]]
    joints[[JOINT[joint] for joint in segments[start, end]]] += longer * along / np.linalg.norm(along)
    return joints, f"{start}-{end} +{longer * 100:.0f} cm"


def _placed(figure: Figure, q: Array) -> Array:
    return np.array(figure.forward_kinematics(q[None])[0, : len(JOINTS)])
