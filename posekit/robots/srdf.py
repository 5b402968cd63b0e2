"""The pairs of links that an SRDF takes out of the collision check."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Final

from posekit.safe_io import nearest, parse_xml, refusal, shown

_PAIR: Final = ("link1", "link2")


@dataclass(frozen=True, kw_only=True)
class Srdf:
    """What an SRDF says of collisions.

    Parameters
    ----------
    disabled, enabled : frozenset of pairs
        ``disable_collisions`` and ``enable_collisions``; each pair is a frozenset of one or two link names.
    alone : frozenset of str
        Links of ``disable_default_collisions``: no pair of theirs is checked but the enabled ones.
    unknown : tuple of str
        Links that the robot has not, where that was let through.
    """

    disabled: frozenset[frozenset[str]]
    enabled: frozenset[frozenset[str]] = frozenset()
    alone: frozenset[str] = frozenset()
    unknown: tuple[str, ...] = ()

    @property
    def says_nothing(self) -> bool:
        """Whether it takes no pair out: then it was not written for collisions."""
        return not self.disabled and not self.alone

    def checks(self, link: str, other: str) -> bool:
        """Whether this pair of links is left to be checked."""
        pair = frozenset((link, other))
        if pair in self.enabled:
            return True
        return pair not in self.disabled and not self.alone & pair


def check_srdf(text: str, source: str, links: Collection[str], *, strict: bool = True) -> Srdf:
    """Parse an SRDF and check that the links of its pairs are the robot's.

    Parameters
    ----------
    text : str
        The SRDF.
    source : str
        What to call it in errors.
    links : collection of str
        The robot's links.
    strict : bool
        Whether a pair with an unknown link is an error. Published robots share one SRDF among their variants;
        there such pairs are passed over, and named.

    Raises
    ------
    InputError
        Where the text is no SRDF or names a link that the robot has not.
    """
    robot = parse_xml(text, source)
    if robot.tag != "robot":
        raise refusal(source, "", f"the root element is <{robot.tag[:60]}>", "<robot>", "name an SRDF")
    known = set(links)
    unknown: dict[str, None] = {}
    pairs: dict[str, set[frozenset[str]]] = {"disable_collisions": set(), "enable_collisions": set()}
    for tag, found in pairs.items():
        for element in robot.findall(tag):
            names = [element.get(end, "") for end in _PAIR]
            foreign = [name for name in names if name not in known]
            if foreign and strict:
                raise _foreign(source, tag, foreign[0], known)
            unknown.update(dict.fromkeys(foreign))
            if not foreign:
                found.add(frozenset(names))
    alone = [element.get("link", "") for element in robot.findall("disable_default_collisions")]
    foreign = [name for name in alone if name not in known]
    if foreign and strict:
        raise _foreign(source, "disable_default_collisions", foreign[0], known)
    unknown.update(dict.fromkeys(foreign))
    return Srdf(
        disabled=frozenset(pairs["disable_collisions"]),
        enabled=frozenset(pairs["enable_collisions"]),
        alone=frozenset(alone) & known,
        unknown=tuple(unknown),
    )


def _foreign(source: str, tag: str, name: str, known: set[str]) -> Exception:
    remedy = nearest(name, sorted(known)) if len(known) < 50 else "name the SRDF of this robot"
    return refusal(source, f"<{tag}>", f"the link {shown(name)}", "a link of the robot", remedy)
