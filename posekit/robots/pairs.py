"""The pairs of bodies that are checked for collision."""

from __future__ import annotations

import re
from collections.abc import Collection

import pinocchio as pin

from posekit.errors import cut, nearest, refusal, shown
from posekit.geometry import Array
from posekit.robots.bodies import link_of
from posekit.robots.capsules import PARTS
from posekit.robots.urdf import need, parse_xml

#: Pairs of links or of parts.
Pairs = Collection[frozenset[str]]


def disabled_pairs(text: str, source: str, links: Collection[str], *, strict: bool = True) -> Pairs:
    """Read the pairs of links that an SRDF disables.

    Parameters
    ----------
    text, source : str
        The SRDF and its name in errors.
    links : collection of str
        The robot's links.
    strict : bool
        Refuse unknown links. Published robots share one SRDF among variants; its foreign pairs are passed over.

    Raises
    ------
    InputError
        If the text is no SRDF or names an unknown link.
    """
    robot = parse_xml(text, source)
    need(source, robot.tag == "robot", "", f"the root element <{cut(robot.tag)}>", "<robot>", "name an SRDF")
    pairs = {
        frozenset((one.get("link1", ""), one.get("link2", ""))) for one in robot.findall("disable_collisions")
    }
    for name in sorted(frozenset[str]().union(*pairs).difference(links)) if strict else ():
        remedy = nearest(name, sorted(links)) if len(links) < 50 else "name this robot's SRDF"
        raise refusal(
            source, "<disable_collisions>", f"the link {shown(name)}", "a link of the robot", remedy
        )
    return pairs


def set_pairs(
    model: pin.Model, geometry: pin.GeometryModel, neutral: Array, disabled: Pairs, parts: Pairs
) -> None:
    """Set the pairs of bodies to check.

    If an SRDF disables pairs, all other pairs of bodies on different joints are checked. Without one, all pairs are
    checked except neighbours and pairs that touch in the neutral configuration. For capsules that stand for a
    humanoid's parts, only the pairs in `parts` are checked.
    """
    geometry.addAllCollisionPairs()
    pairs, bodies = [(pair.first, pair.second) for pair in geometry.collisionPairs], geometry.geometryObjects
    if disabled:
        links = [link_of(model, body) for body in bodies]
        kept = [(a, b) for a, b in pairs if frozenset((links[a], links[b])) not in disabled]
    else:
        near, joints = _neighbours(model, geometry), [body.parentJoint for body in bodies]
        names = [re.sub(r"_\d+$", "", body.name) for body in bodies]
        data, geometry_data = model.createData(), geometry.createData()
        pin.computeCollisions(model, data, geometry, geometry_data, neutral, False)
        kept = []
        for (a, b), result in zip(pairs, geometry_data.collisionResults, strict=True):
            ends = frozenset((names[a], names[b]))
            wanted = ends in parts if parts and ends <= PARTS.keys() else {joints[a], joints[b]} not in near
            if wanted and not result.isCollision():
                kept.append((a, b))
    geometry.removeAllCollisionPairs()
    for a, b in kept:
        geometry.addCollisionPair(pin.CollisionPair(a, b))


def _neighbours(model: pin.Model, geometry: pin.GeometryModel) -> set[frozenset[int]]:
    """Return the pairs of joints that both have bodies and of which one carries the other directly.

    A hip of three hinges has two links without a body: pelvis and thigh are neighbours.
    """
    carrying = {body.parentJoint for body in geometry.geometryObjects}
    near = set()
    for joint in carrying:
        above = int(model.parents[joint])
        while above and above not in carrying:
            above = int(model.parents[above])
        near.add(frozenset((joint, above)))
    return near
