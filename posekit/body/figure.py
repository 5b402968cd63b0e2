"""The stick figure: a URDF, its Pinocchio model, and closed-form forward and inverse kinematics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, lru_cache, partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, Literal, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from posekit.body.angles import LIMBS, ClosedForm, Limits
from posekit.body.capsules import Capsule, grown, read_capsules
from posekit.body.frames import MIDDLE_PELVIS_PART, torso_frame
from posekit.body.lengths import (
    TORSO_LENGTHS,
    check_lengths,
    closed_lengths,
    hips_points,
    lengths_from_stature,
    segment_lengths,
    side_is_certain,
    torso_points,
)
from posekit.body.uncertainty import MEASURED_LENGTHS, LengthUncertainty
from posekit.body.urdf import replace_limits, rewrite
from posekit.errors import FigureError, refusal, shown
from posekit.files import DATA
from posekit.geometry import Array, Ints, coordinate_rotation, frame_along, read_only, unit
from posekit.geometry.quaternions import quaternion_from_rotation, rotation_from_quaternion
from posekit.robots.robot import Robot, read_text
from posekit.skeleton import (
    DOFS,
    HEAD,
    HEAD_POINTS,
    HIPS,
    JOINT,
    JOINTS,
    LIMB_SEGMENTS,
    PARTS,
    POINTS,
    TORSO,
    segment_name,
    urdf_joint_name,
)

#: Name of the URDF link whose origin is at each point.
LINK_OF_POINT: Final = {
    **{point: point for point in POINTS},
    **{start: part for part, (start, _) in PARTS.items()},
    "pelvis": "hips",
}

#: Coordinate axis of each angle: flexion rotates about y, then bending or abduction about x, then rotation about z.
AXIS_OF_ANGLE: Final = {"flexion": 1, "bending": 0, "abduction": 0, "rotation": 2}

#: Largest change of the torso's lengths, metres, for which the torso counts as unchanged.
SAME_TORSO_METRES: Final = 1e-4

#: Number of postures whose angles are computed in one call: few enough for the processor's cache.
ROWS_AT_ONCE: Final = 2048

#: Largest accepted distance between a point by Pinocchio's forward kinematics and by the closed form.
SAME_POINT_METRES: Final = 1e-6


class Configurations(NamedTuple):
    """Configurations of given postures, and the largest position error of each.

    Attributes
    ----------
    q : array (N, nq)
        In Pinocchio's order: position (m), unit quaternion (x, y, z, w), joint angles (rad). Angles of unknown joints
        are NaN; the neck angles are zero if the head is unknown.
    distance : array (N,)
        The largest distance between a posture's joint and the same joint of forward kinematics at q, metres.
    """

    q: Array
    distance: Array


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Figure(Robot):
    """A stick figure: a robot with closed-form kinematics, made by `load_figure` and changed by `scaled`.

    Parameters
    ----------
    urdf, srdf : str
        URDF and SRDF texts, from which the model, lengths, limits, capsules and capsule pairs are read.
    source : str
        Name of the URDF in error messages.
    side_known : bool
        Whether it is known if the shoulders lie in front of the line from neck to pelvis or behind it. A URDF
        determines the side; lengths do not.
    moved_lengths : mapping
        Changes that `scaled` made to impossible lengths of torso or hips, metres, by segment name.

    Raises
    ------
    InputError
        If the texts do not describe a stick figure.

    Examples
    --------
    >>> figure = load_figure()
    >>> q, distance = figure.configurations(figure.neutral_points[None, :14])
    >>> bool(distance[0] < 1e-9)
    True
    """

    name: str = "figure"
    source: str = "figure"
    side_known: bool = field(default=True, repr=False)
    moved_lengths: Mapping[str, float] = field(default_factory=dict, repr=False)

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle only texts and settings; unpickling builds the model from them in milliseconds."""
        settings = {one.name: getattr(self, one.name) for one in fields(self)}
        return _figure, (settings | {"moved_lengths": dict(self.moved_lengths)},)

    def __post_init__(self) -> None:
        self._set("moved_lengths", MappingProxyType(dict(self.moved_lengths)))
        super().__post_init__()
        names = set(self.model.names)
        missing = [urdf_joint_name(dof) for dof in DOFS if urdf_joint_name(dof) not in names]
        missing += [link for link in LINK_OF_POINT.values() if not self.model.existFrame(link)]
        if missing or self.model.nq != 7 + len(DOFS):
            lacking = f", without {', '.join(missing)}" if missing else ""
            got = f"{self.model.nq} configuration variables{lacking}"
            expected = f"the stick figure's {7 + len(DOFS)} configuration variables and its links"
            raise refusal(self.source, "", got, expected, "start from Figure.write", error=FigureError)
        _ = self.limits, self.capsules
        self._check_layout()
        check_lengths(self.lengths)

    @cached_property  # type: ignore[misc]
    def urdf(self) -> str:
        """The URDF text as given; for a figure made by `scaled`, the text is generated on first access."""
        return str(vars(self)["_writer"]())

    @cached_property
    def neutral_points(self) -> Array:
        """Positions (19, 3) of 14 joints and 5 head points at the neutral configuration, metres, torso frame."""
        return read_only(self._placed(self.neutral))

    def _placed(self, q: Array) -> Array:
        """Compute the points (19, 3) of one configuration (nq,) with Pinocchio."""
        data = self.model.createData()
        pin.framesForwardKinematics(self.model, data, q)
        frames = [self.model.getFrameId(LINK_OF_POINT[point]) for point in POINTS]
        return np.array([data.oMf[frame].translation for frame in frames])

    @cached_property
    def lengths(self) -> Mapping[str, float]:
        """The 17 segment lengths, metres, by segment name."""
        return MappingProxyType(segment_lengths(self.neutral_points[None]))

    @property
    def shoulder_offset(self) -> float:
        """Distance of the shoulders in front of the line from neck to pelvis, metres; negative behind it."""
        return float(self.neutral_points[1, 0])

    @property
    def shoulder_side(self) -> Literal["front", "behind", "undecided"]:
        """Side of the line from neck to pelvis on which the shoulders lie; undecided if unknown or on the line."""
        if not self.side_known or self.shoulder_offset == 0:
            return "undecided"
        return "behind" if self.shoulder_offset < 0 else "front"

    @cached_property
    def pelvis_between_hips(self) -> bool:
        """Whether the pelvis is too near to the line between the hips to define a plane with them."""
        pelvis, right = self.neutral_points[[JOINT["pelvis"], JOINT["right_hip"]]]
        return bool(pelvis[2] - right[2] < MIDDLE_PELVIS_PART * self.lengths["right_hip-left_hip"])

    @cached_property
    def head_points(self) -> Array:
        """Neck and five head points (6, 3) in Lee and Chen's head frame: origin neck, x forward, y up, z right."""
        head = self.neutral_points[[0, *HEAD]]
        return np.stack([head[:, 0], head[:, 2], -head[:, 1]], axis=-1)

    @property
    def capsules(self) -> tuple[Capsule, ...]:
        """The collision capsules."""
        return self._bodies[0]

    @property
    def capsule_pairs(self) -> tuple[tuple[int, int], ...]:
        """Pairs of capsules to check for collision, as indices of `capsules`."""
        return self._bodies[1]

    @cached_property
    def _bodies(self) -> tuple[tuple[Capsule, ...], tuple[tuple[int, int], ...]]:
        return read_capsules(self.model, self.geometry, self.neutral_points, self.source)

    @cached_property
    def limits(self) -> Limits:
        """Axis signs and limits of the 22 angles in the order of `posekit.skeleton.DOFS`, radians."""
        signs = np.empty(len(DOFS))
        for k, dof in enumerate(DOFS):
            joint = self.model.joints[self.model.getJointId(urdf_joint_name(dof))]
            data = joint.createData()
            joint.calc(data, np.zeros(joint.nq))
            axis = np.asarray(data.S).reshape(6)[3:]
            coordinate = AXIS_OF_ANGLE[dof.split(".")[1]]
            signs[k] = axis[coordinate]
            if abs(signs[k]) != 1:
                place, expected = f"joint {shown(urdf_joint_name(dof))}", f"plus or minus {'xyz'[coordinate]}"
                raise refusal(self.source, place, f"axis {axis.tolist()}", expected, error=FigureError)
        index = self.angle_index
        return Limits(sign=signs, lower=self.lower[index], upper=self.upper[index])

    @cached_property
    def ik(self) -> ClosedForm:
        """The closed-form inverse kinematics, from points to angles."""
        offsets = self.neutral_points[list(HEAD)] - self.neutral_points[0]
        return ClosedForm(limits=self.limits, head_offsets=offsets, middle_pelvis=self.pelvis_between_hips)

    @cached_property
    def angle_index(self) -> Ints:
        """Index in q of each angle of `posekit.skeleton.DOFS`."""
        return np.array([self.model.idx_qs[self.model.getJointId(urdf_joint_name(dof))] for dof in DOFS])

    def scaled(  # type: ignore[override]
        self,
        lengths: Mapping[str, float] | None = None,
        head_points: Mapping[str, ArrayLike] | None = None,
        *,
        stature: float | None = None,
        behind: bool | None = None,
        known: LengthUncertainty = MEASURED_LENGTHS,
    ) -> Figure:
        """Return a figure with other lengths; capsules scale with their links.

        If no torso or hips with these lengths exist, the nearest possible lengths are used (`posekit.body.lengths`).
        Their changes are in `moved_lengths`. Lengths do not determine whether the shoulders lie in front of the line
        from neck to pelvis or behind it. The new figure's `side_known` is False unless `behind` is given or the torso
        is unchanged.

        Parameters
        ----------
        lengths : mapping, optional
            Metres, by segment name, such as ``neck-pelvis`` (`posekit.skeleton.SEGMENT_NAMES`). Left and right are
            separate. Other lengths are unchanged.
        head_points : mapping, optional
            Head points in the frame of `Figure.head_points`, metres; if ``neck`` is given, it is subtracted from the
            others.
        stature : float, optional
            Height of the person, metres. Lengths that are not given are estimated from the stature
            (`lengths_from_stature`), and the head scales with the stature.
        behind : bool, optional
            Whether the shoulders lie behind the line from neck to pelvis. `shoulders_are_behind` computes it from joint
            positions.
        known : LengthUncertainty
            Uncertainty of the lengths: if impossible lengths are replaced, uncertain lengths change more.

        Raises
        ------
        FigureError
            If a segment name is unknown, a length is not positive, or no possible torso or hips have lengths near the
            given lengths.
        """
        lengths, head_points = dict(lengths or {}), dict(head_points or {})
        if stature is not None:
            usual = lengths_from_stature(stature, self.lengths)
            ratio = usual["neck-pelvis"] / self.lengths["neck-pelvis"]
            lengths = usual | lengths
            usual_head = {name: self.head_points[k + 1] * ratio for k, name in enumerate(HEAD_POINTS)}
            head_points = head_points or usual_head
        head = self._head_in_link(head_points)
        closed, moved = closed_lengths({**self.lengths, **lengths}, known)
        same = all(abs(closed[name] - self.lengths[name]) <= SAME_TORSO_METRES for name in TORSO_LENGTHS)
        was_behind = self.shoulder_offset < 0
        side = was_behind if behind is None else behind
        neutral = self._neutral_of(closed, head, behind=side)
        capsules = grown(self.capsules, self.neutral_points, neutral)
        unchanged = {name: metres for name, metres in self.moved_lengths.items() if name not in lengths}
        # The new URDF differs from the checked URDF only in lengths that were checked, so it is not checked again.
        figure = object.__new__(Figure)
        figure.__dict__.update(
            {one.name: getattr(self, one.name) for one in fields(self) if one.name != "urdf"}
        )
        figure.__dict__.update(
            _writer=partial(rewrite, self.urdf, capsules, closed, head, behind=side),
            side_known=behind is not None or (same and self.side_known),
            moved_lengths=MappingProxyType({**unchanged, **moved}),
            # Known without building the model.
            limits=self.limits,
            neutral_points=read_only(neutral),
            _bodies=(capsules, self.capsule_pairs),
        )
        return figure

    def _neutral_of(self, lengths: Mapping[str, float], head: Array, *, behind: bool) -> Array:
        """Return the neutral points (19, 3) of this figure with other lengths."""
        points, torso = self.neutral_points.copy(), torso_points(lengths, behind=behind)
        points[[JOINT[name] for name in TORSO]] = torso
        points[[JOINT[name] for name in HIPS]] = hips_points(lengths) + torso[3]
        points[list(HEAD)] = head
        for start, end in LIMB_SEGMENTS:
            points[end] = points[start] - [0.0, 0.0, lengths[segment_name((start, end))]]
        return points

    def with_side_within(self, known: LengthUncertainty) -> Figure:
        """Return the figure; set `side_known` to False if lengths of this uncertainty do not determine the side."""
        if not self.side_known or side_is_certain(self.lengths, known):
            return self
        return replace(self, side_known=False)

    def with_limits(self, limits: Mapping[str, tuple[float, float]]) -> Figure:
        """Return a figure with other joint limits (radians), by angle name of `posekit.skeleton.DOFS`."""
        named = {urdf_joint_name(dof): bounds for dof, bounds in limits.items()}
        return replace(self, urdf=replace_limits(self.urdf, named))

    def write(self, path: str | Path) -> None:
        """Write the URDF to `path` and the SRDF beside it; `load_figure` reads both."""
        Path(path).with_suffix(".srdf").write_text(self.srdf or "", encoding="utf-8")
        Path(path).write_text(self.urdf, encoding="utf-8")

    def forward_kinematics(self, q: ArrayLike) -> Array:
        """Compute the 19 points (14 joints and five head points) of configurations.

        Parameters
        ----------
        q : array (N, nq)
            Configurations with unit quaternions.

        Returns
        -------
        array (N, 19, 3)
            Metres; points that depend on an unknown entry of q are NaN.
        """
        q = np.asarray(q, dtype=np.float64)
        angles, neutral = q[:, self.angle_index] * self.limits.sign, self.neutral_points
        R_torso = rotation_from_quaternion(q[:, 3:7])
        R_hips, R_head = R_torso @ _ball(angles[:, 3:6]), R_torso @ _ball(angles[:, :3])
        points = np.empty((len(q), len(POINTS), 3))
        parts = ((TORSO, R_torso, 0), (HEAD_POINTS, R_head, 0), (HIPS[1:], R_hips, JOINT["pelvis"]))
        for names, R, origin in parts:
            rows = [POINTS.index(name) for name in names]
            base = points[:, [origin]] if origin else q[:, None, :3]
            points[:, rows] = base + (neutral[rows] - neutral[origin]) @ np.swapaxes(R, 1, 2)
        for first, (start, middle, end) in LIMBS:
            # A limb hangs along -z. Its axial rotation does not move its middle joint, even if it is unknown.
            R = (R_torso if first < LIMBS[2][0] else R_hips) @ _ball(angles[:, first : first + 2])
            points[:, middle] = points[:, start] + (neutral[middle, 2] - neutral[start, 2]) * R[..., 2]
            R = (
                R
                @ coordinate_rotation(2, angles[:, first + 2])
                @ coordinate_rotation(1, angles[:, first + 3])
            )
            points[:, end] = points[:, middle] + (neutral[end, 2] - neutral[middle, 2]) * R[..., 2]
        return points

    def points(self, q: ArrayLike) -> Array:
        """Compute the 14 joints (N, 14, 3), metres, of configurations (N, nq)."""
        return self.forward_kinematics(q)[:, : len(JOINTS)]

    def configurations(
        self,
        joints: ArrayLike,
        head: Array | None = None,
        *,
        start: ArrayLike | None = None,
    ) -> Configurations:
        """Convert postures to configurations in closed form.

        Several sets of angles give the same segment directions. Of these sets, the set with the smallest violation of
        the joint limits is returned. If the posture has the figure's lengths, forward kinematics of the configuration
        reproduces the posture's joints. Otherwise torso and hips have the figure's shape, every limb segment keeps its
        direction, and `distance` is the largest position error of a joint. Every posture with 14 finite joints has a
        finite configuration.

        Parameters
        ----------
        joints : array (N, 14, 3) or (N, 19, 3)
            14 joints, or 14 joints and five head points, metres, in any right-handed frame.
        head : array (N, 5, 3), optional
            The head points, metres; unknown points are NaN.
        start
            Has no effect: the closed form needs no initial configuration.
        """
        points = with_head(joints, head)
        q = self.inverse_kinematics(points)
        gap = np.linalg.norm(self.points(q) - points[:, : len(JOINTS)], axis=-1)
        placed = np.isfinite(q[:, :7]).all(axis=1)
        return Configurations(q, np.where(placed, np.fmax.reduce(gap, axis=1), np.nan))

    def inverse_kinematics(self, points: Array) -> Array:
        """Return the configurations (N, nq) of joints and head points (N, 19, 3); see `configurations`."""
        if len(points) > ROWS_AT_ONCE:
            rows = range(0, len(points), ROWS_AT_ONCE)
            return np.concatenate([self.inverse_kinematics(points[k : k + ROWS_AT_ONCE]) for k in rows])
        R_torso = _completed_frames(points, torso_frame(*(points[:, JOINT[joint]] for joint in TORSO)))
        q = np.full((len(points), self.model.nq), np.nan)
        q[:, :3] = points[:, 0]
        q[:, 3:7] = quaternion_from_rotation(R_torso)
        angles = self.ik.angles(points)
        # The neck angles are zero if the head is unknown. Angles that degenerate points do not determine are at
        # neutral.
        angles[:, :3] = np.where(np.isnan(angles[:, :3]), 0.0, angles[:, :3])
        whole = np.isfinite(points[:, : len(JOINTS)]).all(axis=(1, 2))
        neutral = np.clip(0.0, self.limits.lower, self.limits.upper)
        angles[whole] = np.where(np.isnan(angles[whole]), neutral, angles[whole])
        q[:, self.angle_index] = angles
        return q

    def _head_in_link(self, head_points: Mapping[str, ArrayLike]) -> Array:
        """Return the figure's head points (5, 3) in the head link's frame, metres, after replacing the given points."""
        for name, point in head_points.items():
            if name not in ("neck", *HEAD_POINTS) or np.shape(point) != (3,):
                got, expected = f"shape {np.shape(point)}", f"x, y, z of neck, {', '.join(HEAD_POINTS)}"
                raise refusal("figure", f"head_points.{name}", got, expected, error=FigureError)
        neck = np.asarray(head_points.get("neck", np.zeros(3)), dtype=np.float64)
        head = self.ik.head_offsets.copy()
        for k, name in enumerate(HEAD_POINTS):
            if name in head_points:
                x, y, z = np.asarray(head_points[name], dtype=np.float64) - neck
                head[k] = x, -z, y
        if not np.isfinite(head).all() or np.linalg.norm(head.mean(axis=0)) == 0:
            got, expected = shown(head.ravel().tolist()), "finite points that are not centred on the neck"
            raise refusal("figure", "head_points", got, expected, error=FigureError)
        return head

    def _check_layout(self) -> None:
        """Raise `FigureError` if Pinocchio and the closed form place the points differently."""
        q = self.neutral[None].copy()
        q[:, self.angle_index] = self.limits.lower + 0.4 * (self.limits.upper - self.limits.lower)
        near = np.linalg.norm(self.forward_kinematics(q)[0] - self._placed(q[0]), axis=-1) < SAME_POINT_METRES
        if not near.all():
            place = f"the joint before {POINTS[int(np.argmin(near))]}"
            expected = "limbs along -z, joint origins without rpy, the stick figure's order of joints"
            raise refusal(self.source, place, "a different geometry", expected, error=FigureError)


def with_head(joints: ArrayLike, head: Array | None = None) -> Array:
    """Append head points (N, 5, 3), by default NaN, to postures (N, 14, 3); return postures (N, 19, 3) unchanged."""
    joints = np.asarray(joints, dtype=np.float64)
    if joints.ndim != 3 or joints.shape[1] not in (len(JOINTS), len(POINTS)) or joints.shape[2] != 3:
        expected = f"(N, {len(JOINTS)}, 3) or (N, {len(POINTS)}, 3)"
        raise refusal("", "joints", f"shape {joints.shape}", expected, "a posture per row", error=FigureError)
    if joints.shape[1] == len(POINTS):
        return joints
    if head is None:
        head = np.full((len(joints), len(HEAD), 3), np.nan)
    return np.concatenate([joints, head], axis=1)


@lru_cache(maxsize=1)
def _built_in() -> Figure:
    return Figure(
        urdf=(DATA / "stick_figure.urdf").read_text(encoding="utf-8"),
        srdf=(DATA / "stick_figure.srdf").read_text(encoding="utf-8"),
    )


def load_figure(path: str | Path | None = None) -> Figure:
    """Load the built-in figure (Lee & Chen 1985, Tables A.1 and A.2), or one that `Figure.write` wrote.

    Parameters
    ----------
    path : path, optional
        URDF file with the stick figure's joints. The SRDF file of the same name is read if it exists; otherwise the
        built-in SRDF is used.

    Raises
    ------
    InputError
        If the file cannot be read or is not a stick figure.

    Examples
    --------
    >>> round(load_figure().lengths["neck-pelvis"], 3) > 0.4
    True
    """
    if path is None:
        return _built_in()
    beside = Path(path).with_suffix(".srdf")
    if beside.exists():
        return Figure(urdf=read_text(path), srdf=read_text(beside), source=str(path))
    return Figure(urdf=read_text(path), srdf=_built_in().srdf, source=str(path))


def _figure(settings: dict[str, Any]) -> Figure:
    return Figure(**settings)


def _ball(angles: Array) -> Array:
    """Return the rotations (N, 3, 3) of two or three angles (N, 2 or 3) of a ball joint, radians."""
    R = coordinate_rotation(1, angles[:, 0]) @ coordinate_rotation(0, angles[:, 1])
    return R if angles.shape[1] == 2 else np.asarray(R @ coordinate_rotation(2, angles[:, 2]))


def _completed_frames(points: Array, R_torso: Array) -> Array:
    """Complete torso frames (N, 3, 3) that are undetermined because the shoulders are in line with the spine."""
    rows = np.isnan(R_torso).any(axis=(1, 2)) & np.isfinite(points[:, : len(JOINTS)]).all(axis=(1, 2))
    if rows.any():
        up = unit(points[rows, 0] - points[rows, JOINT["pelvis"]])
        up = np.where(np.isnan(up), [0.0, 0.0, 1.0], up)
        R = frame_along(up)
        R_torso = R_torso.copy()
        R_torso[rows] = np.stack([R[..., 1], R[..., 2], R[..., 0]], axis=-1)
    return R_torso
