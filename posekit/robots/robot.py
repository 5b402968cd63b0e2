"""A robot: Pinocchio's model of a checked URDF, with its limits, names, bodies and the places of the 14 joints."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property, partial
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, Literal
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

#: Distance from 1 up to which the length of a quaternion is normalised: files are written with few digits.
ROUNDED: Final = 1e-2
#: Names of the floating joint that is added; the first one that no joint of the URDF has.
ROOT_NAMES: Final = ("root_joint", "free_flyer", "posekit_root_joint")


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Robot(Record):
    """A robot, made from texts; `load_robot` makes one from files.

    Parameters
    ----------
    urdf : str
        The URDF. It is parsed and checked once; Pinocchio is given the checked elements.
    srdf : str or None
        The SRDF, which names pairs of links that are not checked for collision.
    name, source : str
        The robot's name, and the file it came from, for errors.
    package_dirs : tuple of Path
        The only directories from which meshes are read.
    fixed_base : bool
        Fix the root, as for an arm; otherwise it moves freely, by the URDF's own floating joint if there is one.
    bodies : {"meshes", "capsules", "none"}
        Collision bodies: those of the URDF; the same with capsules in place of meshes, or along the limbs if it has
        no bodies; or none.
    joint_map_file : str
        Name or TOML file of the joint map; see `joint_map`.

    Raises
    ------
    InputError
        If a text or a mesh is not as it should be; one line that names the place.

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
        """Pickle the texts and settings: a model is built from them in milliseconds."""
        return {entry.name: getattr(self, entry.name) for entry in fields(self)}

    @cached_property
    def tree(self) -> ElementTree.Element:
        """The checked elements of the URDF; not to be changed."""
        return check_urdf(self.urdf, self.source)

    @cached_property
    def model(self) -> pin.Model:
        """Pinocchio's model. Mimicking joints have entries of q of their own: see `mimics`."""
        joints = {joint.get("name"): joint.get("type") for joint in self.tree.findall("joint")}
        root: tuple[Any, ...] = ()
        if not self.fixed_base and "floating" not in joints.values():
            root = pin.JointModelFreeFlyer(), next(name for name in ROOT_NAMES if name not in joints)
        try:
            return pin.buildModelFromXML(text_with(self.tree), *root)
        except (ValueError, RuntimeError) as error:
            got = f"a URDF that Pinocchio cannot read ({cut(one_line(str(error).splitlines()[0]))})"
            raise refusal(self.source, "", got, "a URDF", "correct it") from None

    @cached_property
    def free_flyer(self) -> bool:
        """Whether the root moves freely."""
        return len(self.model.joints) > 1 and self.model.joints[1].shortname() == "JointModelFreeFlyer"

    @cached_property
    def geometry(self) -> pin.GeometryModel:
        """Pinocchio's collision bodies and the pairs to check."""
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
        """Lower limits of q (nq,), rad and m; -inf if there are none."""
        return self._limits(self.model.lowerPositionLimit, -np.inf)

    @cached_property
    def upper(self) -> Array:
        """Upper limits of q (nq,), rad and m; inf if there are none."""
        return self._limits(self.model.upperPositionLimit, np.inf)

    @cached_property
    def neutral(self) -> Array:
        """The neutral configuration (nq,): zero, or the nearest limit, with mimicking joints in place."""
        return read_only(self.with_mimics(np.clip(pin.neutral(self.model), self.lower, self.upper)[None])[0])

    @cached_property
    def configuration_names(self) -> tuple[str, ...]:
        """Name of each entry of q: the joint's; x, y, z, qx, qy, qz, qw of the root; ``.cos``, ``.sin``."""
        return tuple(entry.name for entry in entries_of(self.model))

    @cached_property
    def units(self) -> tuple[str, ...]:
        """Unit of each entry of q: ``rad``, ``m``, or empty for quaternions, cosines and sines."""
        return tuple(entry.unit for entry in entries_of(self.model))

    @cached_property
    def mimics(self) -> tuple[Mimic, ...]:
        """The joints that follow others; a joint comes after the one that it follows."""
        return mimics_of(self.tree)

    @cached_property
    def body_names(self) -> tuple[str, ...]:
        """The collision bodies, as Pinocchio names them: link and number."""
        return tuple(body.name for body in self.geometry.geometryObjects)

    @cached_property
    def body_links(self) -> tuple[str, ...]:
        """The link of each collision body."""
        return tuple(link_of(self.model, body) for body in self.geometry.geometryObjects)

    @cached_property
    def collision_pairs(self) -> tuple[tuple[str, str], ...]:
        """The pairs of bodies that are checked, by name."""
        pairs = self.geometry.collisionPairs
        return tuple((self.body_names[pair.first], self.body_names[pair.second]) for pair in pairs)

    @cached_property
    def hash(self) -> str:
        """SHA-256 of URDF and SRDF, by which a report identifies the robot."""
        return hashlib.sha256(f"{self.urdf}\0{self.srdf or ''}".encode()).hexdigest()

    @cached_property
    def joint_map(self) -> JointMap:
        """The frames that stand for the 14 joints: a built-in or a given map, or one from the names of the joints.

        It is empty if the robot is not a humanoid.

        Raises
        ------
        InputError
            If the given map does not fit.
        """
        if self.joint_map_file:
            return load_joint_map(self.joint_map_file, self.model)
        return find_joint_map(self.model)

    @cached_property
    def kinematics(self) -> Kinematics:
        """The kinematics of the mapped points."""
        return Kinematics(self.model, list(self.joint_map.values()))

    def checked(self, q: ArrayLike, source: str = "q") -> Array:
        """Check configurations: Pinocchio accepts quaternions of any length.

        Parameters
        ----------
        q : array (nq,) or (N, nq)
        source : str
            Their name in errors.

        Returns
        -------
        array (N, nq)
            A copy; quaternions, and cosines and sines, of unit length.

        Raises
        ------
        InputError
            If the shape is another, a number is not finite, or a quaternion's length is more than 0.01 from 1.
        """
        q, check = np.atleast_2d(np.array(q, dtype=np.float64)), partial(need, source)
        remedy = "give a row a configuration, in the order of configuration_names"
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
        """Return configurations (N, nq) whose mimicking joints have the values of their targets."""
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
        """Return the deviations (N, M) of mimicking joints from their targets' values, rad or m; see `mimics`."""
        steps = [pin.difference(self.model, a, b) for a, b in zip(self.with_mimics(q), q, strict=True)]
        at = [self.model.idx_vs[self.model.getJointId(mimic.joint)] for mimic in self.mimics]
        return np.reshape(steps, (-1, self.model.nv))[:, at]

    def q_from_columns(self, names: Sequence[str], values: ArrayLike) -> tuple[Array, tuple[str, ...]]:
        """Order the columns of a table as q.

        Parameters
        ----------
        names : sequence of str
            Names of the columns: entries of `configuration_names`, or joints; a continuous joint is one angle in
            radians, or its cosine and sine. Case and an ending ``_joint`` do not matter.
        values : array (N, len(names))
            Radians and metres.

        Returns
        -------
        q : array (N, nq)
            Joints without a column follow the joint that they mimic, or have their neutral value.
        notes : tuple of str
            Joints without a column, and columns that were ignored.

        Raises
        ------
        InputError
            If less than half of the columns are the robot's, or a name is given twice.
        """
        return from_columns(self, names, values)

    def points(self, q: ArrayLike) -> Array:
        """Return the 14 joints (N, 14, 3) of configurations (N, nq), metres, world; NaN for joints it lacks.

        Raises
        ------
        InputError
            If the given joint map does not fit, or q is not as `checked` requires.
        """
        out = np.full((len(q := self.checked(q)), len(POINTS), 3), np.nan)
        out[:, [POINTS.index(name) for name in self.joint_map]] = self.kinematics.positions(q)
        return out[:, : len(JOINTS)]

    def velocities(self, q: Array, time: Array) -> Array:
        """Return the joint velocities (T - 1, nv) between configurations (T, nq) at times (T,): rad/s and m/s.

        The difference is `pinocchio.difference`: the twist of a floating root in its own frame, linear first.
        """
        steps = [pin.difference(self.model, a, b) for a, b in pairwise(q)]
        return np.array(steps).reshape(-1, self.model.nv) / np.diff(time)[:, None]

    def collisions(self, q: ArrayLike, *, margin: float = 0.0) -> Contacts:
        """Return the collisions of configurations.

        Parameters
        ----------
        q : array (N, nq)
        margin : float
            Metres below which pairs are listed; touching pairs alone by default.

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
        """Return configurations that place the joints, inside the limits: see `posekit.robots.inverse.solve`.

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
            Largest distance of a known joint from its place, metres.
        """
        return solve(self, joints, start=start)

    def scaled(self, joints: ArrayLike) -> Robot:
        """Return the robot with the segment lengths of a person: see `posekit.robots.scaling`."""
        return scaled(self, joints)

    @cached_property
    def _collision(self) -> SelfCollision:
        return SelfCollision(self.model, self.geometry)

    def _limits(self, given: Array, none: float) -> Array:
        """Return limits of q (nq,), only of joints with one entry: Pinocchio gives quaternions limits, too."""
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
        Its SRDF; by default the published one, or the one of the same name beside the URDF.
    bodies : {"meshes", "capsules", "none"}
        Collision bodies: see `Robot`. Capsules need no mesh files.
    package_dirs : sequence of path
        Directories that hold the packages of its meshes, besides its own.
    fixed_base : bool
        Fix the root, as for an arm.
    joint_map : str or path
        Name or TOML file of the joint map; by default the one that fits.

    Raises
    ------
    InputError
        One line that says what is wrong with the name, a file, a mesh or a number.

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
