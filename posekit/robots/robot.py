"""A robot: Pinocchio's model of a checked URDF, with limits, names, collision bodies and a joint map."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property, partial
from itertools import pairwise
from pathlib import Path
from typing import Final, Literal
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from posekit.errors import cut, one_line, refusal, shown
from posekit.files import read_bytes, text
from posekit.geometry import Array, Record, read_only
from posekit.robots.bodies import build_bodies, link_of
from posekit.robots.capsules import capsule_bodies
from posekit.robots.collision import Contacts, SelfCollision, disable_pairs, set_pairs
from posekit.robots.columns import Mimic, from_columns, mimics_of
from posekit.robots.find import FIGURE, find
from posekit.robots.inverse import solve
from posekit.robots.joint_map import JointMap, find_joint_map, load_joint_map
from posekit.robots.kinematics import Kinematics, entries_of
from posekit.robots.scaling import scaled
from posekit.robots.urdf import check_urdf, need, text_with
from posekit.skeleton import JOINTS, POINTS

Bodies = Literal["meshes", "capsules", "none"]

#: Largest deviation of a quaternion's length from 1 that is normalised (dimensionless). Files have few digits.
ROUNDED: Final = 1e-2
#: Names for an added floating joint. The first name that no joint of the URDF has is used.
ROOT_NAMES: Final = ("root_joint", "free_flyer", "posekit_root_joint")


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Robot(Record):
    """A robot, built from the texts of a URDF and an SRDF; `load_robot` builds one from files.

    Parameters
    ----------
    urdf : str
        Text of the URDF. It is parsed and checked once; Pinocchio reads the checked elements.
    srdf : str or None
        Text of the SRDF, which names pairs of links that are not checked for collision.
    name, source : str
        Name of the robot, and name of its file in error messages.
    package_dirs : tuple of Path
        The only directories from which meshes are read.
    fixed_base : bool
        Whether the root is fixed, as for an arm. Otherwise the root has a floating joint, which is added if the URDF
        has none.
    bodies : {"meshes", "capsules", "none"}
        Collision bodies. ``meshes`` are the bodies of the URDF. ``capsules`` replace the URDF's meshes, or lie along
        the limbs if the URDF has no bodies.
    joint_map_file : str
        Name or TOML file of the joint map; see `joint_map`.

    Raises
    ------
    InputError
        If a text or a mesh is damaged or violates the URDF format. The one-line message names the faulty element.

    Examples
    --------
    >>> from posekit.robots import load_robot
    >>> panda = load_robot("panda", bodies="none")
    >>> panda.configuration_names[7]
    'panda_joint1'
    """

    urdf: str = field(repr=False)
    srdf: str | None = field(default=None, repr=False)
    name: str = "robot"
    source: str = "URDF"
    package_dirs: tuple[Path, ...] = field(default=(), repr=False)
    fixed_base: bool = False
    bodies: Bodies = "meshes"
    joint_map_file: str = field(default="", repr=False)

    def __post_init__(self) -> None:
        _ = self.model, self.geometry

    def __getstate__(self) -> dict[str, object]:
        """Pickle the texts and settings; the model is built from them again in milliseconds."""
        return {entry.name: getattr(self, entry.name) for entry in fields(self)}

    @cached_property
    def tree(self) -> ElementTree.Element:
        """The element ``<robot>`` of the URDF, after the checks. Change only copies."""
        return check_urdf(self.urdf, self.source)

    @cached_property
    def model(self) -> pin.Model:
        """Pinocchio's model. Mimicking joints have their own entries of q: see `mimics`."""
        urdf = text_with(self.tree)
        try:
            model = pin.buildModelFromXML(urdf)
            if self.fixed_base or _floats(model):
                return model
            root = next(name for name in ROOT_NAMES if not model.existFrame(name))
            return pin.buildModelFromXML(urdf, pin.JointModelFreeFlyer(), root)
        except (ValueError, RuntimeError) as error:
            got = f"a URDF that Pinocchio cannot read ({cut(one_line(str(error).splitlines()[0]))})"
            raise refusal(self.source, "", got, "a URDF", "correct it") from None

    @cached_property
    def free_flyer(self) -> bool:
        """Whether the root moves freely."""
        return _floats(self.model)

    @cached_property
    def geometry(self) -> pin.GeometryModel:
        """Pinocchio's collision bodies, and the pairs of bodies to check for collision."""
        if self.bodies == "none":
            return pin.GeometryModel()
        parts: tuple[tuple[str, str], ...] = ()
        if self.bodies == "meshes":
            geometry = build_bodies(self.model, self.tree, self.package_dirs, self.source, "collision")
        else:
            figure = load_robot(FIGURE[0])
            geometry, parts = capsule_bodies(self, figure), figure.collision_pairs
        geometry.addAllCollisionPairs()
        if self.srdf is None or not disable_pairs(self.model, geometry, self.srdf, f"{self.source}, SRDF"):
            set_pairs(self.model, geometry, np.array(self.neutral), parts)
        return geometry

    @cached_property
    def visuals(self) -> pin.GeometryModel:
        """Pinocchio's visual bodies, loaded at first use."""
        return build_bodies(self.model, self.tree, self.package_dirs, self.source, "visual")

    @cached_property
    def lower(self) -> Array:
        """Lower limits of q (nq,), rad and m; -inf for entries without a limit."""
        return self._limits(self.model.lowerPositionLimit, -np.inf)

    @cached_property
    def upper(self) -> Array:
        """Upper limits of q (nq,), rad and m; inf for entries without a limit."""
        return self._limits(self.model.upperPositionLimit, np.inf)

    @cached_property
    def neutral(self) -> Array:
        """The neutral configuration (nq,): zero or the limit nearest to zero; mimicking joints follow their targets."""
        return read_only(self.with_mimics(np.clip(pin.neutral(self.model), self.lower, self.upper)[None])[0])

    @cached_property
    def configuration_names(self) -> tuple[str, ...]:
        """Name of each entry of q: the joint's name, with ``.cos`` and ``.sin`` if the joint is continuous.

        A floating root has the entries x, y, z, qx, qy, qz, qw.
        """
        return tuple(entry.name for entry in entries_of(self.model))

    @cached_property
    def units(self) -> tuple[str, ...]:
        """Unit of each entry of q: ``rad``, ``m``, or empty for quaternions, cosines and sines."""
        return tuple(entry.unit for entry in entries_of(self.model))

    @cached_property
    def mimics(self) -> tuple[Mimic, ...]:
        """The mimicking joints of the URDF. A mimicking joint is listed before the joints that mimic it."""
        return mimics_of(self.tree)

    @cached_property
    def body_names(self) -> tuple[str, ...]:
        """Pinocchio's names of the collision bodies: the link's name and a number."""
        return tuple(body.name for body in self.geometry.geometryObjects)

    @cached_property
    def body_links(self) -> tuple[str, ...]:
        """The link of each collision body."""
        return tuple(link_of(self.model, body) for body in self.geometry.geometryObjects)

    @cached_property
    def collision_pairs(self) -> tuple[tuple[str, str], ...]:
        """The names of the two bodies of each pair that is checked for collision."""
        pairs = self.geometry.collisionPairs
        return tuple((self.body_names[pair.first], self.body_names[pair.second]) for pair in pairs)

    @cached_property
    def hash(self) -> str:
        """SHA-256 of URDF and SRDF. A report identifies the robot by this value."""
        return hashlib.sha256(f"{self.urdf}\0{self.srdf or ''}".encode()).hexdigest()

    @cached_property
    def joint_map(self) -> JointMap:
        """The point of the robot that represents each joint of the human model; empty if the robot is not a humanoid.

        The map is read from `joint_map_file`. By default it is a built-in map, or is derived from the names of the
        robot's joints.

        Raises
        ------
        InputError
            If the map of `joint_map_file` does not fit the robot.
        """
        if self.joint_map_file:
            return load_joint_map(self.joint_map_file, self.model)
        return find_joint_map(self.model)

    @cached_property
    def kinematics(self) -> Kinematics:
        """Batched kinematics of the points of `joint_map`."""
        return Kinematics(self.model, list(self.joint_map.values()))

    def checked(self, q: ArrayLike, source: str = "q") -> Array:
        """Check the shape and the numbers of configurations, and normalise their quaternions.

        Parameters
        ----------
        q : array (nq,) or (N, nq)
        source : str
            Name of the configurations in error messages.

        Returns
        -------
        array (N, nq)
            A copy. Quaternions, and pairs of cosine and sine, have unit length.

        Raises
        ------
        InputError
            If the shape is wrong, a number is not finite, or a quaternion's length differs from 1 by more than 0.01.
        """
        q, check = np.atleast_2d(np.array(q, dtype=np.float64)), partial(need, source)
        remedy = "give one row per configuration, in the order of configuration_names"
        check(q.shape[1:] == (self.model.nq,), "", f"shape {q.shape}", f"(N, {self.model.nq})", remedy)
        for row, column in np.argwhere(~np.isfinite(q))[:1]:
            place = f"row {row}: {self.configuration_names[column]}"
            check(False, place, shown(float(q[row, column])), "a finite number", "leave the row out")
        for joint, (at, count) in enumerate(zip(self.model.idx_qs, self.model.nqs, strict=True)):
            if count > 1:  # x, y, z before a quaternion, x, y before the cosine and sine of a planar joint
                turn = q[:, at + count - (4 if count == 7 else 2) : at + count]
                length = np.linalg.norm(turn, axis=1)
                for row in np.flatnonzero(np.abs(length - 1) > ROUNDED)[:1]:
                    kind = "quaternion" if count == 7 else "cosine and sine"
                    got, place = (
                        f"a {kind} of length {length[row]:.4g}",
                        f"row {row}: {self.model.names[joint]}",
                    )
                    check(False, place, got, "length 1", "check the order of q, and normalise it")
                turn /= length[:, None]
        return q

    def with_mimics(self, q: Array) -> Array:
        """Return configurations (N, nq) with mimicking joints set to the values that follow from their targets."""
        q, model = q.copy(), self.model
        for mimic in self.mimics:
            joint, target = model.getJointId(mimic.joint), model.getJointId(mimic.target)
            at, of = model.idx_qs[joint], model.idx_qs[target]
            value = np.arctan2(q[:, of + 1], q[:, of]) if model.nqs[target] == 2 else q[:, of]
            value = mimic.multiplier * value + mimic.offset
            if model.nqs[joint] == 2:
                q[:, at], q[:, at + 1] = np.cos(value), np.sin(value)
            else:
                q[:, at] = value
        return q

    def mimic_errors(self, q: Array) -> Array:
        """Return the deviations (N, M) of the M mimicking joints from the values set by `with_mimics`, rad or m."""
        steps = [pin.difference(self.model, a, b) for a, b in zip(self.with_mimics(q), q, strict=True)]
        at = [self.model.idx_vs[self.model.getJointId(mimic.joint)] for mimic in self.mimics]
        return np.reshape(steps, (-1, self.model.nv))[:, at]

    def q_from_columns(self, names: Sequence[str], values: ArrayLike) -> tuple[Array, tuple[str, ...]]:
        """Convert a table with named columns to configurations q.

        Parameters
        ----------
        names : sequence of str
            Names of the columns: entries of `configuration_names`, or names of joints. A continuous joint has one
            column with an angle in radians, or two with its cosine and sine. Letter case and a final ``_joint`` are
            ignored.
        values : array (N, len(names))
            Radians and metres.

        Returns
        -------
        q : array (N, nq)
            Joints without a column follow the joint that they mimic, or have their neutral value.
        notes : tuple of str
            Sentences that list joints without a column and ignored columns.

        Raises
        ------
        InputError
            If fewer than half of the columns belong to the robot, or two columns have the same name.
        """
        return from_columns(self, names, values)

    def points(self, q: ArrayLike) -> Array:
        """Return the 14 joints (N, 14, 3) of configurations (N, nq), metres, world; NaN for joints the robot lacks.

        Raises
        ------
        InputError
            If the map of `joint_map_file` does not fit the robot, or q is not valid input for `checked`.
        """
        out = np.full((len(q := self.checked(q)), len(POINTS), 3), np.nan)
        out[:, [POINTS.index(name) for name in self.joint_map]] = self.kinematics.positions(q)
        return out[:, : len(JOINTS)]

    def velocities(self, q: Array, time: Array) -> Array:
        """Return the joint velocities (T - 1, nv) between configurations (T, nq) at times (T,): rad/s and m/s.

        The velocity of a floating root is a twist in the root's frame, linear part first, as in `pinocchio.difference`.
        """
        steps = [pin.difference(self.model, a, b) for a, b in pairwise(q)]
        return np.array(steps).reshape(-1, self.model.nv) / np.diff(time)[:, None]

    def collisions(self, q: ArrayLike, *, margin: float = 0.0) -> Contacts:
        """Return the collisions of configurations.

        Parameters
        ----------
        q : array (N, nq)
        margin : float
            Distance below which pairs are listed, metres; by default only touching pairs are listed.

        Returns
        -------
        Contacts
            ``hit`` (N,), and ``frame``, ``pair`` (index into `collision_pairs`) and signed ``distance`` of each
            listed pair.

        Examples
        --------
        >>> robot = load_robot("figure")
        >>> robot.collisions(robot.neutral).hit
        array([False])
        """
        return self._collision.contacts(self.checked(q), margin)

    def configurations(self, joints: ArrayLike, *, start: ArrayLike | None = None) -> tuple[Array, Array]:
        """Return configurations within the limits whose joints are nearest to given positions.

        See `posekit.robots.inverse.solve`.

        Parameters
        ----------
        joints : array (14, 3) or (N, 14, 3)
            Metres, world; NaN is unknown.
        start : array (N, nq), optional
            Configurations near the solution.

        Returns
        -------
        q : array (N, nq)
        distance : array (N,)
            Largest distance of a known joint from its target, metres.
        """
        return solve(self, joints, start=start)

    def scaled(self, joints: ArrayLike) -> Robot:
        """Return the robot scaled to the segment lengths of a person: see `posekit.robots.scaling`."""
        return scaled(self, joints)

    @cached_property
    def _collision(self) -> SelfCollision:
        return SelfCollision(self.model, self.geometry)

    def _limits(self, given: Array, none: float) -> Array:
        """Return the given limits (nq,) of joints with one entry of q; entries of other joints get the value `none`."""
        return read_only(np.where(np.repeat(self.model.nqs, self.model.nqs) == 1, given, none))


def load_robot(
    name_or_path: str | Path,
    *,
    srdf: str | Path | None = None,
    bodies: Bodies = "meshes",
    package_dirs: Sequence[str | Path] = (),
    fixed_base: bool = False,
    joint_map: str | Path = "",
) -> Robot:
    """Load a robot by name or from files.

    Parameters
    ----------
    name_or_path : str or path
        A published robot (``g1``, ``human``, ``talos``, ``panda``, …), ``figure``, or the path of a URDF.
    srdf : path, optional
        The robot's SRDF; by default the published SRDF, or the SRDF of the same name beside the URDF.
    bodies : {"meshes", "capsules", "none"}
        Collision bodies: see `Robot`. Capsules need no mesh files.
    package_dirs : sequence of path
        Additional directories that contain the packages of the robot's meshes. The folders of the URDF's own package
        are always searched.
    fixed_base : bool
        Whether the root is fixed, as for an arm.
    joint_map : str or path
        Name or TOML file of the joint map; by default a built-in map, or a map derived from joint names.

    Raises
    ------
    InputError
        If a name, a file, a mesh or a number is wrong. The one-line message names the fault and the remedy.

    Examples
    --------
    >>> robot = load_robot("figure")
    >>> robot.points(robot.neutral).shape
    (1, 14, 3)
    """
    name, urdf, beside, folders = find(name_or_path)
    own_srdf = beside if srdf is None else Path(srdf)
    return Robot(
        urdf=read_text(urdf),
        srdf=None if own_srdf is None else read_text(own_srdf),
        name=name,
        source=str(urdf),
        package_dirs=(*(Path(folder).resolve() for folder in package_dirs), *folders),
        fixed_base=fixed_base,
        bodies=bodies,
        joint_map_file=str(joint_map),
    )


def read_text(path: str | Path) -> str:
    """Read a URDF or SRDF file."""
    return text(read_bytes(path), str(path))


def _floats(model: pin.Model) -> bool:
    """Return whether the first joint of a model is a floating joint."""
    return len(model.joints) > 1 and model.joints[1].shortname() == "JointModelFreeFlyer"
