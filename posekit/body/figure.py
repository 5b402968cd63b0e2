"""The stick figure: one URDF, its Pinocchio model, and the way between joint positions and q."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Final, Literal, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from posekit.body.angles import Limits
from posekit.body.axes import axis_signs
from posekit.body.capsules import Capsule, read_capsules
from posekit.body.closed_form import Alike, ClosedForm, freed, with_head
from posekit.body.closing import TORSO_LENGTHS, closed_lengths
from posekit.body.frames import MIDDLE_PELVIS_PART, torso_frame
from posekit.body.lengths import check_lengths
from posekit.body.pool import collides, make_pool
from posekit.body.side import side_is_certain
from posekit.body.stature import lengths_from_stature
from posekit.body.uncertainty import LengthUncertainty
from posekit.body.urdf import as_figure_error, parse, replace_limits, rewrite, write_texts
from posekit.display.short_repr import ShortRepr
from posekit.errors import FigureError
from posekit.geometry import Array, quaternion_from_rotation
from posekit.robots.kinematics import Kinematics, body_points
from posekit.robots.srdf import check_srdf
from posekit.skeleton import (
    DOFS,
    HEAD,
    JOINT,
    JOINTS,
    POINTS,
    SEGMENTS,
    SIDES,
    TORSO,
    segment_name,
    urdf_joint_name,
)

LINK_OF_POINT = {
    "neck": "torso",
    "pelvis": "hips",
    **{
        f"{side}_{joint}": f"{side}_{link}"
        for side in SIDES
        for joint, link in (
            ("shoulder", "upper_arm"),
            ("elbow", "forearm"),
            ("hip", "thigh"),
            ("knee", "shank"),
        )
    },
}
"""The URDF link whose origin is each point; points that are not listed have a link of their own name."""


SAME_TORSO_METRES: Final = 1e-4
"""Metres: a torso whose distances are no more other than that is the same."""

NO_VELOCITY = np.arange(0)
"""No entries of v: positions alone are wanted, no Jacobian."""


class Configurations(NamedTuple):
    """Configurations and how far their joints are from the postures they came from.

    Attributes
    ----------
    q : array (N, nq)
        In Pinocchio's order: metres, unit quaternion (x, y, z, w), radians. NaN in angles of unknown joints;
        a head that was not seen is at neutral.
    distance : array (N,)
        The largest distance between a posture's joint and the same joint of forward kinematics at q, metres.
    """

    q: Array
    distance: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Figure(ShortRepr):
    """A stick figure, made from URDF and SRDF text by `load_figure` and changed by `scaled`.

    Parameters
    ----------
    urdf, srdf : str
        The texts; the model, the lengths, limits, capsules and checked pairs are read from them.
    source : str
        What to call it in errors.
    side_known : bool
        Whether it is known on which side of the line from neck to pelvis the shoulders lie: a URDF says it, lengths
        do not.
    moved_lengths : mapping
        By how much lengths had to be changed so that torso and hips close, metres, by segment name.

    Raises
    ------
    FigureError
        Where the texts do not describe a stick figure.
    """

    urdf: str = field(repr=False)
    srdf: str = field(repr=False)
    source: str = "stick_figure.urdf"
    side_known: bool = field(default=True, repr=False)
    moved_lengths: Mapping[str, float] = field(default_factory=dict, repr=False)

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle the texts alone: they are small, and a model is built from them in milliseconds."""
        return _figure, (self.urdf, self.srdf, self.source, self.side_known, dict(self.moved_lengths))

    def __post_init__(self) -> None:
        object.__setattr__(self, "moved_lengths", MappingProxyType(dict(self.moved_lengths)))
        links = [link.get("name", "") for link in parse(self.urdf, self.source).findall("link")]
        names = set(self.model.names)
        missing = [urdf_joint_name(dof) for dof in DOFS if urdf_joint_name(dof) not in names]
        missing += [link for link in map(_frame_name, POINTS) if not self.model.existFrame(link)]
        if missing or self.model.nq != 7 + len(DOFS):
            raise FigureError(
                f"{self.source}: not a stick figure: it has {self.model.nq} configuration variables, expected "
                f"{7 + len(DOFS)}; missing: {', '.join(missing) or 'none'}"
            )
        with as_figure_error():
            check_srdf(self.srdf, f"{self.source}, SRDF", links)
        _ = self.limits, self.capsules
        self._check_layout()

    @cached_property
    def model(self) -> pin.Model:
        """Pinocchio's model, torso on a free-flyer."""
        try:
            return pin.buildModelFromXML(self.urdf, pin.JointModelFreeFlyer())
        except (ValueError, RuntimeError) as error:
            raise FigureError(
                f"{self.source}: Pinocchio cannot read it: {str(error).splitlines()[0]}"
            ) from error

    @cached_property
    def geometry(self) -> pin.GeometryModel:
        """Pinocchio's geometry model with the SRDF's pairs."""
        geometry = pin.buildGeomFromUrdfString(self.model, self.urdf, pin.GeometryType.COLLISION)
        geometry.addAllCollisionPairs()
        pin.removeCollisionPairsFromXML(self.model, geometry, self.srdf)
        return geometry

    @cached_property
    def neutral_points(self) -> Array:
        """The 19 points at the neutral configuration (19, 3), metres, torso frame."""
        points: Array = self.forward_kinematics(pin.neutral(self.model)[None])[0]
        points.flags.writeable = False
        return points

    @cached_property
    def lengths(self) -> Mapping[str, float]:
        """The 17 lengths, metres, by segment name."""
        points = self.neutral_points
        lengths = {segment_name((a, b)): float(np.linalg.norm(points[a] - points[b])) for a, b in SEGMENTS}
        return MappingProxyType(lengths)

    @property
    def shoulder_offset(self) -> float:
        """How far the shoulders lie in front of the line from neck to pelvis, metres; negative behind it."""
        return float(self.neutral_points[1, 0])

    @property
    def shoulder_side(self) -> Literal["front", "behind", "undecided"]:
        """On which side of that line they are; undecided where it is not known, and of a flat torso."""
        if not self.side_known or self.shoulder_offset == 0:
            return "undecided"
        return "behind" if self.shoulder_offset < 0 else "front"

    @cached_property
    def pelvis_between_hips(self) -> bool:
        """Whether the pelvis is on the line between the hips, or so near that it makes no plane with them."""
        pelvis, right = self.neutral_points[[JOINT["pelvis"], JOINT["right_hip"]]]
        return bool(pelvis[2] - right[2] < MIDDLE_PELVIS_PART * self.lengths["right_hip-left_hip"])

    @cached_property
    def head_points(self) -> Array:
        """Neck and the five head points in the paper's head frame (6, 3): x forward, y up, z right, from the neck."""
        head = self.neutral_points[[0, *HEAD]]
        return np.stack([head[:, 0], head[:, 2], -head[:, 1]], axis=-1)

    @cached_property
    def capsules(self) -> tuple[Capsule, ...]:
        """The collision bodies."""
        return self._collision[0]

    @cached_property
    def collision_pairs(self) -> tuple[tuple[int, int], ...]:
        """Index pairs into `capsules` that the SRDF leaves to be checked."""
        return self._collision[1]

    @cached_property
    def _collision(self) -> tuple[tuple[Capsule, ...], tuple[tuple[int, int], ...]]:
        return read_capsules(self.model, self.geometry, self.neutral_points)

    @cached_property
    def limits(self) -> Limits:
        """Signs and limits of the 22 angles in the order of `posekit.skeleton.DOFS`, radians."""
        index = self.angle_index
        return Limits(
            sign=axis_signs(self.model, self.source),
            lower=self.model.lowerPositionLimit[index],
            upper=self.model.upperPositionLimit[index],
        )

    @cached_property
    def ik(self) -> ClosedForm:
        """The closed form from points to angles."""
        middle = self.pelvis_between_hips
        limits = freed(self.limits) if middle else self.limits
        return ClosedForm(limits=limits, head_offsets=self._head_offsets, middle_pelvis=middle)

    @cached_property
    def angle_index(self) -> NDArray[np.intp]:
        """Where each of `posekit.skeleton.DOFS` stands in q."""
        return np.array([self.model.idx_qs[self.model.getJointId(urdf_joint_name(dof))] for dof in DOFS])

    @cached_property
    def configuration_names(self) -> tuple[str, ...]:
        """A name for each entry of q: x, y, z, qx, qy, qz, qw of the torso, then the URDF's joints."""
        names = ["x", "y", "z", "qx", "qy", "qz", "qw"] + [""] * len(DOFS)
        for dof, index in zip(DOFS, self.angle_index, strict=True):
            names[index] = urdf_joint_name(dof)
        return tuple(names)

    @cached_property
    def hash(self) -> str:
        """SHA-256 of URDF and SRDF: what a result names to say which figure it used."""
        return hashlib.sha256(f"{self.urdf}\0{self.srdf}".encode()).hexdigest()

    def scaled(
        self,
        lengths: Mapping[str, float],
        head_points: Mapping[str, ArrayLike] | None = None,
        *,
        behind: bool | None = None,
        known: LengthUncertainty | None = None,
    ) -> Figure:
        """Make the same figure with other lengths; capsules grow with their part.

        Lengths that miss closing are laid onto the nearest body that closes (`posekit.body.closing`), and
        `moved_lengths` says by how much. Lengths do not tell on which side of the line from neck to pelvis the
        shoulders lie: unless that is said, or the torso stays as it is, the new figure does not know it (`side_known`).

        Parameters
        ----------
        lengths : mapping
            Metres, by segment name ``a-b``, a before b in tree order; others stay. Left and right are separate.
        head_points : mapping, optional
            Head points in the paper's head frame, metres; with ``neck`` among them, the others count from it.
        behind : bool, optional
            Whether the shoulders lie behind the line from neck to pelvis, where positions tell it
            (`posekit.robots.shoulders_are_behind`).
        known : LengthUncertainty, optional
            How well the lengths are known: those that are known worse are changed more where they do not close.

        Raises
        ------
        FigureError
            Where a length is unknown, not positive, or no torso or hips have lengths near these.
        """
        check_lengths(lengths)
        head = self._head_in_link(head_points or {})
        closed = closed_lengths({**self.lengths, **lengths}, known)
        same = all(
            abs(closed.lengths[name] - self.lengths[name]) <= SAME_TORSO_METRES for name in TORSO_LENGTHS
        )
        text = rewrite(
            self.urdf,
            self.capsules,
            self.neutral_points,
            closed.lengths,
            head,
            behind=self.shoulder_offset < 0 if behind is None else behind,
        )
        stale = {name: metres for name, metres in self.moved_lengths.items() if name not in lengths}
        # What was checked of the old text holds of the new one, which differs in lengths that are checked here.
        figure = object.__new__(Figure)
        figure.__dict__.update(
            urdf=text,
            srdf=self.srdf,
            source=self.source,
            side_known=behind is not None or (same and self.side_known),
            moved_lengths=MappingProxyType({**stale, **closed.moved}),
            limits=self.limits,
        )
        return figure

    def with_side_within(self, known: LengthUncertainty) -> Figure:
        """Return the figure as it is known within uncertain lengths: they may leave the side of the shoulders open."""
        if not self.side_known or side_is_certain(self.lengths, known):
            return self
        return self._of_unknown_side

    @cached_property
    def _of_unknown_side(self) -> Figure:
        return replace(self, side_known=False)

    def from_stature(self, stature: float) -> Figure:
        """Make the figure of a person of this stature (m): see `posekit.body.stature`."""
        lengths = lengths_from_stature(stature, dict(self.lengths))
        ratio = lengths["neck-pelvis"] / self.lengths["neck-pelvis"]
        head = {name: self.head_points[k + 1] * ratio for k, name in enumerate(POINTS[len(JOINTS) :])}
        return self.scaled(lengths, head)

    def with_limits(self, limits: Mapping[str, tuple[float, float]]) -> Figure:
        """Make the same figure with other joint limits (radians), by name in `posekit.skeleton.DOFS`."""
        named = {urdf_joint_name(dof): bounds for dof, bounds in limits.items()}
        return replace(self, urdf=replace_limits(self.urdf, named))

    def write(self, path: str | Path) -> None:
        """Write the URDF to `path` and the SRDF beside it; `posekit.load_figure` reads them again.

        Raises
        ------
        FigureError
            Where they cannot be written.
        """
        write_texts(Path(path), self.urdf, self.srdf)

    def forward_kinematics(self, q: Array) -> Array:
        """Place the 19 points by forward kinematics: Pinocchio's, for a batch.

        Parameters
        ----------
        q : array (N, nq)
            Configurations with unit quaternions.

        Returns
        -------
        array (N, 19, 3)
            Metres; NaN where q has NaN.

        Raises
        ------
        FigureError
            Where q has another width or a quaternion is not of unit length: Pinocchio would place a
            non-rotation without a word.
        """
        if q.ndim != 2 or q.shape[1] != self.model.nq:
            raise FigureError(f"q has shape {q.shape}; expected (N, {self.model.nq})")
        norm = np.linalg.norm(q[:, 3:7], axis=1)
        if (np.abs(norm - 1) > 1e-6).any():
            raise FigureError(
                f"the quaternion of configuration {int(np.argmax(np.abs(norm - 1)))} has length "
                f"{norm[np.argmax(np.abs(norm - 1))]:g}; expected 1; normalise q[3:7]"
            )
        return self._kinematics.place(q, NO_VELOCITY).positions

    def collides(self, q: Array) -> NDArray[np.bool_]:
        """Ask coal which configurations (N, nq) penetrate in a pair that the SRDF leaves to be checked (N,)."""
        return collides(self._pool, q.T)

    def configurations(self, points: Array, alike: Alike | None = None) -> Configurations:
        """Turn postures into configurations, in closed form.

        All branches of the decomposition are tried; the one inside the limits is taken, else the one that
        violates them least. Where the posture has the figure's lengths, forward kinematics gives its joints
        back; where it has not, the rigid parts are the figure's own and `distance` says how far the two are
        apart.

        Parameters
        ----------
        points : array (N, 14, 3) or (N, 19, 3)
            Joints, and the head's five points where they are known, metres, any right-handed frame.
        alike : callable, optional
            Finds postures that share limbs, which are then solved once (`posekit.body.closed_form.Alike`).

        Returns
        -------
        Configurations
        """
        points = with_head(points)
        q = self.inverse_kinematics(points, alike)
        placed = np.isfinite(q[:, :7]).all(axis=1)
        distance = np.full(len(points), np.nan)
        if placed.any():
            joints = self.forward_kinematics(q[placed])[:, : len(JOINTS)]
            gap = np.linalg.norm(joints - points[placed, : len(JOINTS)], axis=-1)
            distance[placed] = np.fmax.reduce(gap, axis=1)
        return Configurations(q, distance)

    def inverse_kinematics(self, points: Array, alike: Alike | None = None) -> Array:
        """Turn postures (N, 19, 3) into q (N, nq), in closed form: `configurations` without the distance."""
        R_torso = torso_frame(*(points[:, JOINT[joint]] for joint in TORSO))
        q = np.full((len(points), self.model.nq), np.nan)
        q[:, :3] = points[:, 0]
        q[:, 3:7] = quaternion_from_rotation(R_torso)
        angles = self.ik.angles(points, R_torso, alike)
        angles[:, :3] = np.where(np.isnan(angles[:, :3]), 0.0, angles[:, :3])
        q[:, self.angle_index] = angles
        return q

    @cached_property
    def _pool(self) -> pin.GeometryPool:
        return make_pool(self.model, self.geometry)

    @cached_property
    def _kinematics(self) -> Kinematics:
        return Kinematics(model=self.model, points=body_points([_frame_name(name) for name in POINTS]))

    @cached_property
    def _head_offsets(self) -> Array:
        return np.asarray(self.neutral_points[list(HEAD)] - self.neutral_points[0])

    def _head_in_link(self, head_points: Mapping[str, ArrayLike]) -> Array:
        """Return the five head points in the head link's frame, some of them replaced."""
        names = POINTS[len(JOINTS) :]
        for name, point in head_points.items():
            if name not in ("neck", *names):
                raise FigureError(
                    f"figure.head_points: {name!r} is not a head point; expected neck, {', '.join(names)}"
                )
            if np.shape(point) != (3,):
                raise FigureError(f"figure.head_points: {name} has shape {np.shape(point)}; expected x, y, z")
        neck = np.asarray(head_points.get("neck", np.zeros(3)), dtype=np.float64)
        head = self._head_offsets.copy()
        for k, name in enumerate(names):
            if name in head_points:
                x, y, z = np.asarray(head_points[name], dtype=np.float64) - neck
                head[k] = x, -z, y
        if not np.isfinite(head).all() or np.linalg.norm(head.mean(axis=0)) == 0:
            raise FigureError("figure.head_points: the points must be finite and not centred on the neck")
        return head

    def _check_layout(self) -> None:
        """Refuse joints that lie otherwise than the closed form takes them to: place a posture and take it back."""
        q = pin.neutral(self.model)[None]
        lower, upper = self.limits.lower, self.limits.upper
        q[:, self.angle_index] = lower + 0.4 * (upper - lower)
        if self.pelvis_between_hips:
            # How far such a pelvis is flexed its joints do not tell: it is taken back as the neck turns it.
            q[:, self.angle_index[3:6]] = 0.0
        points = self.forward_kinematics(q)
        back = self.forward_kinematics(self.inverse_kinematics(points))
        apart = np.linalg.norm(back - points, axis=-1)[0]
        if not (apart < 1e-6).all():
            raise FigureError(
                f"{self.source}: the joint before {POINTS[int(np.argmin(apart < 1e-6))]!r} does not lie as the stick "
                "figure's; expected limbs along -z, joint origins without rpy, and the stick figure's order of joints"
            )


def _figure(urdf: str, srdf: str, source: str, side_known: bool, moved: Mapping[str, float]) -> Figure:
    return Figure(urdf=urdf, srdf=srdf, source=source, side_known=side_known, moved_lengths=moved)


def _frame_name(point: str) -> str:
    return LINK_OF_POINT.get(point, point)
