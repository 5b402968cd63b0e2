"""A robot: URDF and SRDF texts that were checked, and what Pinocchio makes of them."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pinocchio as pin

from posekit.display.short_repr import ShortRepr
from posekit.geometry import Array
from posekit.robots.declared import BodyKind
from posekit.robots.geometry import build_geometry, link_of
from posekit.robots.meshes import with_resolved_meshes
from posekit.robots.model import build_model, configuration_names
from posekit.robots.pairs import set_pairs
from posekit.robots.srdf import Srdf, check_srdf
from posekit.robots.urdf import check_urdf
from posekit.safe_io import nearest, refusal, shown


@dataclass(frozen=True, kw_only=True, eq=False)
class Robot(ShortRepr):
    """A robot, made from texts; `posekit.robots.load_robot` makes one from files.

    Everything is loaded and checked at construction. A pickle holds the texts alone; a robot with meshes reads
    them again.

    Parameters
    ----------
    urdf : str
        The URDF.
    srdf : str or None
        The SRDF, which says what pairs of links are not checked for collision.
    name, source : str
        What to call it; the file it came from, for errors.
    package_dirs : tuple of Path
        The only directories from which meshes are taken.
    free_flyer : bool
        Whether the root moves freely (as people do), or is fixed (as arms are).
    with_geometry : bool
        Whether collision bodies are loaded, meshes with them.
    with_visuals : bool
        Whether visual bodies are loaded too.
    shared_srdf : bool
        Whether the SRDF is one for several variants of the robot, as published ones are: links that it knows and
        the robot has not are passed over then, and listed in `unknown_links`.
    mesh_copies : mapping of str to Path, optional
        Files that are read, once, in place of the meshes that the URDF names: see
        `posekit.robots.meshes.private_copies`.

    Raises
    ------
    InputError
        Where a text, a mesh or what Pinocchio makes of them is wrong.
    """

    urdf: str = field(repr=False)
    srdf: str | None = field(default=None, repr=False)
    name: str = "robot"
    source: str = "URDF"
    package_dirs: tuple[Path, ...] = ()
    free_flyer: bool = True
    with_geometry: bool = True
    with_visuals: bool = False
    shared_srdf: bool = False
    mesh_copies: Mapping[str, Path] | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        _ = self.model, self._srdf, self.geometry, self.visuals

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle the texts and the settings: a model is built from them in milliseconds."""
        settings = {entry.name: getattr(self, entry.name) for entry in fields(self)}
        return _robot, ({**settings, "mesh_copies": None},)

    @cached_property
    def tree(self) -> ElementTree.Element:
        """The URDF's elements, checked; not to be changed."""
        return check_urdf(self.urdf, self.source)

    @cached_property
    def model(self) -> pin.Model:
        """Pinocchio's model. Joints that mimic others move on their own, as Pinocchio has it by default."""
        return build_model(self.tree, self.source, free_flyer=self.free_flyer)

    @cached_property
    def geometry(self) -> pin.GeometryModel | None:
        """Pinocchio's geometry model of the collision bodies, with the pairs to check; None where not wanted."""
        if not self.with_geometry:
            return None
        geometry = self._built("collision")
        set_pairs(self.model, geometry, self._srdf)
        return geometry

    @cached_property
    def visuals(self) -> pin.GeometryModel | None:
        """Pinocchio's geometry model of the visual bodies; None where not wanted."""
        return self._built("visual") if self.with_visuals else None

    def _built(self, kind: BodyKind) -> pin.GeometryModel:
        robot = with_resolved_meshes(self.tree, self.package_dirs, self.source, kind, self.mesh_copies)
        return build_geometry(self.model, robot, self.source, kind)

    @cached_property
    def lower(self) -> Array:
        """Lower limits of q (nq,), radians and metres, -inf where there are none; see `configuration_names`."""
        return _read_only(self.model.lowerPositionLimit)

    @cached_property
    def upper(self) -> Array:
        """Upper limits of q (nq,)."""
        return _read_only(self.model.upperPositionLimit)

    @cached_property
    def configuration_names(self) -> tuple[str, ...]:
        """A name for each entry of q: the joint's, with ``.cos`` and the like where a joint has several."""
        return configuration_names(self.model)

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """The moving joints, in Pinocchio's order, the free-flying root first where there is one."""
        return tuple(self.model.names)[1:]

    @cached_property
    def link_names(self) -> tuple[str, ...]:
        """The links, in Pinocchio's order."""
        return tuple(frame.name for frame in self.model.frames if frame.type == pin.FrameType.BODY)

    @cached_property
    def frame_names(self) -> tuple[str, ...]:
        """The names that `frame_id` takes: links first, then joints."""
        return tuple(
            dict.fromkeys((*self.link_names, *(frame.name for frame in list(self.model.frames)[1:])))
        )

    def frame_id(self, name: str) -> int:
        """Return the index of a frame: a link's, or a joint's where no link has the name.

        Raises
        ------
        InputError
            Where there is none; Pinocchio would return an index past the end, and crash on its use.
        """
        kinds = (pin.FrameType.BODY, pin.FrameType.JOINT, pin.FrameType.FIXED_JOINT)
        for kind in kinds:
            if self.model.existFrame(name, kind):
                return int(self.model.getFrameId(name, kind))
        raise refusal(
            self.source, "", f"the frame {shown(name)}", "a link or a joint", nearest(name, self.frame_names)
        )

    @cached_property
    def body_names(self) -> tuple[str, ...]:
        """The collision bodies, as Pinocchio names them: link and number."""
        return () if self.geometry is None else tuple(body.name for body in self.geometry.geometryObjects)

    @cached_property
    def body_links(self) -> tuple[str, ...]:
        """The link of each of `body_names`."""
        if self.geometry is None:
            return ()
        return tuple(link_of(self.model, body) for body in self.geometry.geometryObjects)

    @cached_property
    def collision_pairs(self) -> tuple[tuple[str, str], ...]:
        """The pairs of bodies that are checked, by name."""
        if self.geometry is None:
            return ()
        names = self.body_names
        return tuple((names[pair.first], names[pair.second]) for pair in self.geometry.collisionPairs)

    @property
    def pairs_from(self) -> str:
        """Where the pairs come from: ``srdf``, or ``neutral posture``."""
        return "neutral posture" if self._srdf is None else "srdf"

    @property
    def unknown_links(self) -> tuple[str, ...]:
        """Links that the SRDF names and the robot has not; empty unless the SRDF is shared."""
        return () if self._srdf is None else self._srdf.unknown

    @cached_property
    def hash(self) -> str:
        """SHA-256 of URDF and SRDF: what a report names to say which robot it used."""
        return hashlib.sha256(f"{self.urdf}\0{self.srdf or ''}".encode()).hexdigest()

    @cached_property
    def _srdf(self) -> Srdf | None:
        if self.srdf is None:
            return None
        links = [link.get("name", "") for link in self.tree.findall("link")]
        srdf = check_srdf(self.srdf, f"{self.source}, SRDF", links, strict=not self.shared_srdf)
        return None if srdf.says_nothing else srdf


def _robot(settings: dict[str, Any]) -> Robot:
    return Robot(**settings)


def _read_only(values: Array) -> Array:
    values = values.copy()
    values.flags.writeable = False
    return values
