"""Links and joints of a URDF are one tree, with names that are there once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import Final
from xml.etree import ElementTree

from posekit.safe_io import refusal, shown

MAX_DEPTH: Final = 250
"""Links from the root to a leaf; Pinocchio's reader overflows the stack some 5000 deep."""
RESERVED_NAMES: Final = ("universe",)
"""Joint names that Pinocchio has for itself."""


def check_tree(robot: ElementTree.Element, source: str) -> None:
    """Refuse links and joints that are not one tree: Pinocchio says so on stderr, or overflows its stack."""
    links = [link.get("name", "") for link in robot.findall("link")]
    joints = [joint.get("name", "") for joint in robot.findall("joint")]
    _check_names("link", links, source)
    _check_names("joint", joints, source)
    known = set(links)
    parent_of: dict[str, str] = {}
    children: dict[str, list[str]] = {}
    for joint in robot.findall("joint"):
        parent, child = _ends(joint, known, source)
        if child in parent_of:
            got = f"link {child!r} hangs on two joints"
            raise refusal(source, "", got, "a tree", "remove one of the joints")
        parent_of[child] = parent
        children.setdefault(parent, []).append(child)
    roots = [link for link in links if link not in parent_of]
    if len(roots) != 1:
        got = f"{len(roots)} links that hang on no joint ({', '.join(roots[:5]) or 'a cycle'})"
        raise refusal(source, "", got, "one root", "join the parts to one tree")
    reached, level, depth = set(roots), roots, 0
    while level:
        depth += 1
        if depth > MAX_DEPTH:
            got = f"a chain of more than {MAX_DEPTH} links"
            raise refusal(source, "", got, f"at most {MAX_DEPTH}", "merge links that are fixed to each other")
        level = [child for link in level for child in children.get(link, ())]
        reached.update(level)
    if len(reached) < len(links):
        lost = next(link for link in links if link not in reached)
        raise refusal(source, "", f"link {lost!r} hangs on itself", "a tree", "remove the cycle")


def _ends(joint: ElementTree.Element, known: set[str], source: str) -> tuple[str, str]:
    ends = [element.get("link", "") for tag in ("parent", "child") for element in joint.findall(tag)]
    unknown = [link for link in ends if link not in known]
    if len(ends) != 2 or unknown:
        got = f"{' and '.join(map(repr, ends[:4])) or 'nothing'}; unknown: {', '.join(unknown[:4]) or 'none'}"
        place = f"joint {joint.get('name')!r}"
        raise refusal(source, place, got, "one parent and one child, links of this file", "correct the names")
    return ends[0], ends[1]


def _check_names(kind: str, names: Iterable[str], source: str) -> None:
    for name, times in Counter(names).items():
        if times > 1:
            raise refusal(source, "", f"{kind} {name!r} {times} times", "each name once", "give each its own")
        if not (name and name.isprintable()) or (kind == "joint" and name in RESERVED_NAMES):
            expected = f"a name that prints, other than {', '.join(RESERVED_NAMES)}"
            raise refusal(source, kind, f"the name {shown(name)}", expected, "rename it")
