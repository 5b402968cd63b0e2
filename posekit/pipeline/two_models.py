"""The same postures on the stick figure and on example-robot-data's `human`, with the same ranges.

The human's axes are the ISB's (Wu et al. 2005, J. Biomech. 38: x forward, y up, z right). Its shoulders and hips turn
in the stick figure's order, flexion, abduction, rotation: one angle stands for one angle. Its spine does not: from hips
to trunk it flexes, bends and then turns, while the stick figure does so from trunk to hips.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from posekit.cameras import Array
from posekit.figure import Figure, with_head
from posekit.figure.capsules import Capsule
from posekit.figure.frames import hips_frame, torso_frame
from posekit.robot import load_robot
from posekit.robot.scaling import segment_lengths, shoulders_are_behind
from posekit.skeleton import DOFS, HIPS, JOINT, JOINTS, SIDES, TORSO
from posekit.synthesis import random_postures
from posekit.validators import Report
from posekit.validators.robot import RobotSettings, RobotValidator

HUMAN: Final = "human"
MAPPED: Final = "human_as_stick_figure.toml"

BEND: Final = 60.0
"""Degrees by which elbows and knees are bent while joints are compared, so that axial rotations show."""

TURN: Final = 20.0
"""Degrees by which one joint is turned."""

TO_ISB: Final = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""From x forward, y left, z up to x forward, y up, z right."""

HELD: Final = (
    "middle_thoracic_Z",
    "middle_thoracic_X",
    "right_clavicle_joint_X",
    "left_clavicle_joint_X",
)
"""The human's joints between the mapped points that the stick figure has not: its trunk is rigid."""

Bools = NDArray[np.bool_]


class Counterpart(NamedTuple):
    """The human's joint that does what one of the stick figure's does: angle = sign * theirs + offset, degrees."""

    joint: str
    sign: int
    offset: float


def human_validator(ranges: str = "urdf", **options: object) -> RobotValidator:
    """Make a validator of the published human; options are those of `RobotSettings`."""
    settings = RobotSettings(ranges=ranges, **options)  # type: ignore[arg-type]
    return RobotValidator(robot=load_robot(HUMAN, geometry=False), settings=settings)


def mapped_ranges() -> Path:
    """Return the file of the stick figure's ranges on the human's joints."""
    return Path(str(resources.files("posekit.urdf") / "ranges" / MAPPED))


def check_on_human(
    validator: RobotValidator, postures: Array, lengths: Mapping[str, float], behind: bool | None
) -> Report:
    """Judge postures (N, 14, 3) on the human with given segment lengths."""
    verdict = validator.judge_postures(postures, lengths=lengths, behind=behind)
    return Report(
        judgements=verdict.judgements,
        complete=verdict.complete,
        q=verdict.q,
        fk_distance=verdict.residual.max(axis=1),
    )


def measure_counterparts(figure: Figure, validator: RobotValidator | None = None) -> dict[str, Counterpart]:
    """Find which joint of the human does what each of the stick figure's does, with sign and offset.

    The stick figure is put into its neutral configuration with elbows and knees bent, and into others that differ
    from it by one angle. The human is fitted to each, and its joint that turns most is the counterpart; the offset is
    what it reads where the stick figure's angle is zero. The neck is left out: the human has no face.

    Parameters
    ----------
    figure : Figure
    validator : RobotValidator, optional
        Of the human; one with its own limits unless told otherwise.
    """
    base = pin.neutral(figure.model)
    for side in SIDES:
        for hinge in ("elbow", "knee"):
            base[_column(figure, f"{side}_{hinge}.flexion")] = np.radians(BEND)
    dofs = [dof for dof in DOFS if not dof.startswith("neck")]
    q = np.tile(base, (len(dofs) + 1, 1))
    for row, dof in enumerate(dofs, start=1):
        q[row, _column(figure, dof)] += np.radians(TURN)
    postures = figure.forward_kinematics(q)[:, : len(JOINTS)]
    verdict = (validator or human_validator(checks=("reach",))).judge_postures(postures)
    subject = verdict.models[0].subject
    read = np.degrees(verdict.q[:, subject.index])
    found = {}
    for row, dof in enumerate(dofs, start=1):
        turned = read[row] - read[0]
        k = int(np.argmax(np.abs(turned)))
        sign = int(np.sign(turned[k]))
        offset = read[0, k] - sign * np.degrees(base[_column(figure, dof)])
        found[dof] = Counterpart(subject.joint_names[k], sign, round(float(offset), 3) + 0.0)
    return found


def mapped_limits(figure: Figure, counterparts: Mapping[str, Counterpart]) -> dict[str, tuple[float, float]]:
    """Return the figure's limits as limits of the human's joints, degrees; joints that it has not are held at zero."""
    limits: dict[str, tuple[float, float]] = {}
    for dof, (joint, sign, offset) in counterparts.items():
        k = DOFS.index(dof)
        ends = sorted(sign * np.degrees([figure.limits.lower[k], figure.limits.upper[k]]) + offset)
        limits[joint] = (round(float(ends[0]), 3) + 0.0, round(float(ends[1]), 3) + 0.0)
    return limits | dict.fromkeys(HELD, (0.0, 0.0))


def counterpart_angles(
    figure: Figure, postures: Array, counterparts: Mapping[str, Counterpart]
) -> dict[str, Array]:
    r"""Return the human's angles (N,) of postures with the figure's lengths, degrees, in closed form.

    Limbs keep their angles, but for sign and offset. The spine's are those of :math:`R_z(a) R_x(b) R_y(c)`, the
    trunk in the hips' frame, where the stick figure's are those of the inverse in the same order.

    Parameters
    ----------
    figure : Figure
    postures : array (N, 14, 3)
        Metres.
    counterparts : mapping
        From `measure_counterparts`.
    """
    q, _ = figure.configurations(with_head(postures))
    own = {dof: np.degrees(q[:, _column(figure, dof)]) for dof in counterparts}
    place = np.moveaxis(postures, 1, 0)
    R_torso = torso_frame(*place[[JOINT[name] for name in TORSO]])
    R_hips = hips_frame(*place[[JOINT[name] for name in HIPS]])
    R = TO_ISB @ np.swapaxes(R_hips, 1, 2) @ R_torso @ TO_ISB.T
    own["pelvis.flexion"] = np.degrees(np.arctan2(R[:, 0, 1], R[:, 1, 1]))
    own["pelvis.bending"] = np.degrees(-np.arcsin(np.clip(R[:, 2, 1], -1.0, 1.0)))
    own["pelvis.rotation"] = np.degrees(np.arctan2(-R[:, 2, 0], R[:, 2, 2]))
    return {found.joint: found.sign * own[dof] + found.offset for dof, found in counterparts.items()}


def _column(figure: Figure, dof: str) -> int:
    return int(figure.angle_index[DOFS.index(dof)])


KINDS: Final = (
    "beyond a limit",
    "bent the wrong way",
    "arm through the trunk",
    "limb stretched",
    "trunk stretched",
)
"""Kinds of illegal postures."""

BEYOND: Final = (10.0, 60.0)
"""Degrees beyond a limit."""

CLEARLY: Final = 5.0
"""Degrees by which every configuration of an illegal angle must be outside the limits."""

VISIBLE: Final = 0.3
"""Cosine of an abduction, sine of a bend, below which the angles of a limb are hardly to be told apart."""

DEEP: Final = 0.02
"""Metres of penetration that are no matter of rounding or of a capsule's exact radius."""

DRAWS: Final = 50
"""Ways of an arm that are tried at once."""

LONGER: Final = (0.05, 0.15)
"""Metres by which a segment is stretched: more than the 3 cm that rigid parts may give."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Labelled:
    """Postures whose verdict is known from how they were made.

    Parameters
    ----------
    joints : array (N, 14, 3)
        Metres.
    kind : tuple of str
        ``legal``, or one of `KINDS`.
    what : tuple of str
        What was changed: an angle, a pair of bodies, a segment.
    """

    joints: Array
    kind: tuple[str, ...]
    what: tuple[str, ...]

    def __post_init__(self) -> None:
        self.joints.flags.writeable = False

    @property
    def legal(self) -> Bools:
        """Which are legal (N,)."""
        return np.array([kind == "legal" for kind in self.kind])


def labelled_postures(figure: Figure, n: int, rng: np.random.Generator) -> Labelled:
    """Make n legal postures, and as many illegal ones of them, of each kind the same number.

    Legal: inside all limits, no bodies in each other. Illegal, each made of a legal one by one change, and by nothing
    else than that:

    - one angle 10 to 60 degrees beyond its limit, no bodies in each other;
    - one elbow or knee bent 10 to 60 degrees backward, no bodies in each other;
    - one arm turned, inside its limits, until it is 2 cm or more inside torso or hips;
    - one segment of a limb, or of the trunk, 5 to 15 cm longer, what it carries moved along.

    Other angles can give the same posture: an illegal angle is taken only where each of them is outside by five
    degrees (`excess`).

    Parameters
    ----------
    figure : Figure
    n : int
        A multiple of the number of kinds.
    rng : Generator
    """
    legal = random_postures(figure, n, rng)
    each = n // len(KINDS)
    joints, kinds, whats = [figure.forward_kinematics(legal)[:, : len(JOINTS)]], ["legal"] * n, [""] * n
    makers = (_beyond, _wrong_way, _through_trunk, _limb_stretched, _trunk_stretched)
    for kind, make in zip(KINDS, makers, strict=True):
        done = 0
        while done < each:
            made = make(figure, legal[rng.integers(n)].copy(), rng)
            if made is not None:
                joints.append(made[0][None])
                kinds.append(kind)
                whats.append(made[1])
                done += 1
    return Labelled(joints=np.concatenate(joints), kind=tuple(kinds), what=tuple(whats))


def same_postures(q: Array, figure: Figure) -> dict[str, list[Array]]:
    """List, by part, all values of its angles that place the points alike: arrays (N, 3) or (N, 4), radians.

    A rotation by three successive axes has a second one: half a turn on, mirrored, half a turn on (Diebel 2006,
    Representing Attitude, 5.6). A limb has two more, as it may bend backward after half a turn about itself.
    """
    turn = np.pi
    parts: dict[str, list[Array]] = {}
    columns = [_column(figure, f"pelvis.{name}") for name in ("flexion", "bending", "rotation")]
    f, b, r = q[:, columns].T
    parts["pelvis"] = [np.stack([f, b, r], axis=1), np.stack([f + turn, turn - b, r + turn], axis=1)]
    for joint, hinge in LIMBS:
        columns = [_column(figure, dof) for dof in _limb_dofs(joint, hinge)]
        f, a, r, e = q[:, columns].T
        parts[joint] = [
            np.stack(angles, axis=1)
            for angles in (
                (f, a, r, e),
                (f, a, r + turn, -e),
                (f + turn, turn - a, r + turn, e),
                (f + turn, turn - a, r, -e),
            )
        ]
    return parts


def excess(q: Array, figure: Figure) -> dict[str, Array]:
    """Return, by part, how far the angles are outside the limits (N,), degrees, in the best way to read them."""
    found = {}
    for part, ways in same_postures(q, figure).items():
        dofs = _limb_dofs(part, dict(LIMBS)[part]) if part != "pelvis" else PELVIS
        rows = [DOFS.index(dof) for dof in dofs]
        lower, upper = figure.limits.lower[rows], figure.limits.upper[rows]
        outside = []
        for angles in ways:
            past = np.mod(angles - lower, 2 * np.pi)  # from the lower limit, upward
            width = upper - lower
            outside.append(
                np.where(past <= width, 0.0, np.minimum(past - width, 2 * np.pi - past)).max(axis=1)
            )
        found[part] = np.degrees(np.min(outside, axis=0))
    return found


PELVIS: Final = ("pelvis.flexion", "pelvis.bending", "pelvis.rotation")
LIMBS: Final = tuple(
    (f"{side}_{joint}", f"{side}_{hinge}")
    for side in SIDES
    for joint, hinge in (("shoulder", "elbow"), ("hip", "knee"))
)


def _limb_dofs(joint: str, hinge: str) -> tuple[str, ...]:
    return (f"{joint}.flexion", f"{joint}.abduction", f"{joint}.rotation", f"{hinge}.flexion")


Made = tuple[Array, str] | None
"""A posture and what was done to it; none where that did not make it illegal."""


def _beyond(figure: Figure, q: Array, rng: np.random.Generator) -> Made:
    """Push one angle beyond a limit; hinges only beyond the upper one."""
    dof = str(rng.choice([dof for dof in DOFS if not dof.startswith("neck")]))
    k = DOFS.index(dof)
    hinge = "elbow" in dof or "knee" in dof
    amount = rng.uniform(*BEYOND)
    up = hinge or rng.random() < 0.5
    limit = figure.limits.upper[k] if up else figure.limits.lower[k]
    q[_column(figure, dof)] = limit + np.radians(amount if up else -amount)
    return (
        (_place(figure, q), f"{dof} {'+' if up else '-'}{amount:.0f}") if _is_clear(figure, q, dof) else None
    )


def _wrong_way(figure: Figure, q: Array, rng: np.random.Generator) -> Made:
    dof = f"{LIMBS[rng.integers(len(LIMBS))][1]}.flexion"
    amount = rng.uniform(*BEYOND)
    q[_column(figure, dof)] = -np.radians(amount)
    return (_place(figure, q), f"{dof} -{amount:.0f}") if _is_clear(figure, q, dof) else None


def _is_clear(figure: Figure, q: Array, dof: str) -> bool:
    """Tell whether a pushed angle is outside however it is read, is seen, and is all that is wrong."""
    joint = dof.split(".")[0]
    part = next((first for first, hinge in LIMBS if joint in (first, hinge)), "pelvis")
    middle = "pelvis.bending" if part == "pelvis" else f"{part}.abduction"
    seen = abs(np.cos(q[_column(figure, middle)])) > VISIBLE
    if part != "pelvis":
        seen &= abs(np.sin(q[_column(figure, f"{dict(LIMBS)[part]}.flexion")])) > VISIBLE / 2
    return bool(seen and excess(q[None], figure)[part][0] >= CLEARLY and not figure.collides(q[None])[0])


def _through_trunk(figure: Figure, q: Array, rng: np.random.Generator) -> Made:
    """Turn one arm until it is inside the trunk: points on the two capsules' axes prove it."""
    side = SIDES[rng.integers(2)]
    dofs = _limb_dofs(f"{side}_shoulder", f"{side}_elbow")
    rows = [DOFS.index(dof) for dof in dofs]
    many = np.tile(q, (DRAWS, 1))
    many[:, [_column(figure, dof) for dof in dofs]] = rng.uniform(
        figure.limits.lower[rows], figure.limits.upper[rows], (DRAWS, len(dofs))
    )
    points = figure.forward_kinematics(many)
    capsules = {capsule.link: capsule for capsule in figure.capsules}
    pairs = [("torso", f"{side}_upper_arm"), ("torso", f"{side}_forearm"), ("hips", f"{side}_forearm")]
    depth = np.stack([penetration(points, capsules[trunk], capsules[arm]) for trunk, arm in pairs], axis=1)
    row = int(np.argmax(depth.max(axis=1) >= DEEP))
    if depth[row].max() < DEEP:
        return None
    trunk, arm = pairs[int(np.argmax(depth[row]))]
    return points[row, : len(JOINTS)], f"{trunk}-{arm} {depth[row].max() * 100:.0f} cm"


def penetration(points: Array, one: Capsule, other: Capsule) -> Array:
    """Return a depth (N,), metres, that two capsules have at least: that of the nearest of 41 points on each axis."""
    steps = np.linspace(-1.0, 1.0, 41)
    axes = []
    for capsule in (one, other):
        middle, axis = capsule.place(points[:, list(capsule.points)])
        axes.append(middle[:, None] + (steps * capsule.half_length)[:, None] * axis[:, None])
    apart = np.linalg.norm(axes[0][:, :, None] - axes[1][:, None], axis=3).min(axis=(1, 2))
    return np.asarray(one.radius + other.radius - apart)


STRETCHED: Final[Mapping[str, Mapping[tuple[str, str], tuple[str, ...]]]] = {
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


def _limb_stretched(figure: Figure, q: Array, rng: np.random.Generator) -> Made:
    return _stretched(_place(figure, q), "limb", rng)


def _trunk_stretched(figure: Figure, q: Array, rng: np.random.Generator) -> Made:
    return _stretched(_place(figure, q), "trunk", rng)


def _stretched(joints: Array, where: str, rng: np.random.Generator) -> tuple[Array, str]:
    segments = list(STRETCHED[where].items())
    (start, end), carried = segments[rng.integers(len(segments))]
    longer = rng.uniform(*LONGER)
    along = joints[JOINT[end]] - joints[JOINT[start]]
    joints = joints.copy()
    joints[[JOINT[joint] for joint in carried]] += longer * along / np.linalg.norm(along)
    return joints, f"{start}-{end} +{longer * 100:.0f} cm"


def _place(figure: Figure, q: Array) -> Array:
    return np.asarray(figure.forward_kinematics(q[None])[0, : len(JOINTS)])
