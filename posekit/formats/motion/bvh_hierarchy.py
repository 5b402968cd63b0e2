"""The hierarchy of a BVH file: joints, their offsets and channels, read token by token and never by recursion."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final, NamedTuple, NoReturn

import numpy as np

from posekit.formats.distinct import check_distinct
from posekit.geometry import Array
from posekit.safe_io import cut, nearest, refusal, shown

MAX_HEADER: Final = 4_000_000
"""Characters of a hierarchy: that of a rig with fingers and a face has 50,000."""
MAX_JOINTS: Final = 2000
MAX_DEPTH: Final = 250
LARGEST_VALUE: Final = 1e9
"""No length, position or angle of a body is larger, in any unit."""

CHANNEL_NAMES: Final = {
    f"{axis}{kind}": (rotates, k)
    for rotates, kind in ((False, "position"), (True, "rotation"))
    for k, axis in enumerate("xyz")
}
_NUMBER: Final = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,4})?", re.ASCII)
_TOKEN: Final = re.compile(r"[{}]|[^\s{}]+")


class Channel(NamedTuple):
    """One channel: whether it turns or moves, and its axis, 0 to 2."""

    rotates: bool
    axis: int


@dataclass(frozen=True, kw_only=True, eq=False)
class Hierarchy:
    """The joints and End Sites of a BVH file, parents before children, in the file's order.

    Parameters
    ----------
    names : tuple of str (P,)
        An End Site is named after its joint, ``LeftHand_end``.
    parents : tuple of int (P,)
        -1 for a root.
    offsets : array (P, 3)
        From the parent, the file's unit.
    channels : tuple (P,) of tuple of Channel
        In the file's order; none for an End Site.
    sites : tuple of bool (P,)
        Which are End Sites.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    offsets: Array
    channels: tuple[tuple[Channel, ...], ...]
    sites: tuple[bool, ...]

    @property
    def width(self) -> int:
        """The number of values that a frame has."""
        return sum(map(len, self.channels))


@dataclass(kw_only=True)
class _Joint:
    name: str
    parent: int
    site: bool
    offset: list[float] | None = None
    channels: list[Channel] | None = None
    ends: int = field(default=0)


class _Parser:
    """Reads the tokens of one hierarchy."""

    def __init__(self, path: object, text: str) -> None:
        self.path, self.text = str(path), text
        self.tokens: Iterator[re.Match[str]] = _TOKEN.finditer(text)
        self.at = 0
        self.joints: list[_Joint] = []
        self.open: list[int] = []

    def refuse(self, got: str, expected: str, remedy: str = "correct it") -> NoReturn:
        line = self.text.count("\n", 0, self.at) + 1
        raise refusal(self.path, f"line {line}", got, expected, remedy)

    def next(self, expected: str) -> str:
        token = next(self.tokens, None)
        if token is None:
            self.at = len(self.text)
            self.refuse(
                "the end of the hierarchy", expected, "the file is cut off, or MOTION stands too early"
            )
        self.at = token.start()
        return token.group()

    def number(self, what: str) -> float:
        word = self.next(what)
        value = float(word) if _NUMBER.fullmatch(word) else np.nan
        if not abs(value) <= LARGEST_VALUE:
            self.refuse(shown(word), f"{what}, a number of at most {LARGEST_VALUE:g}")
        return value

    def name(self) -> str:
        words = []
        while (word := self.next("a name and {")) != "{":
            if word == "}":
                self.refuse("}", "a name and {", "a joint's block opens with {")
            words.append(word)
        return " ".join(words)

    def joint(self, keyword: str) -> None:
        parent = self.open[-1] if self.open else -1
        if (keyword == "root") == bool(self.open):
            expected = "JOINT or End Site inside a joint, ROOT outside"
            self.refuse(keyword.upper(), expected, "check the braces before it")
        if parent >= 0 and self.joints[parent].site:
            self.refuse(keyword, "} after an End Site's offset", "check the braces before it")
        if len(self.joints) >= MAX_JOINTS or len(self.open) >= MAX_DEPTH:
            limit = f"at most {MAX_JOINTS} joints, {MAX_DEPTH} deep"
            self.refuse("more", limit, "no body has so many: remove what is not one")
        site = keyword == "end"
        name = self.name()
        if site:
            self.joints[parent].ends += 1
            count = self.joints[parent].ends
            name = f"{self.joints[parent].name}_end{count if count > 1 else ''}"
        elif not name:
            self.refuse("no name", f"a name after {keyword.upper()}", "name the joint")
        self.open.append(len(self.joints))
        self.joints.append(_Joint(name=name, parent=parent, site=site))

    def fill(self, keyword: str) -> None:
        if not self.open:
            self.refuse(cut(keyword), "ROOT", "check the braces before it")
        joint = self.joints[self.open[-1]]
        if keyword == "offset":
            if joint.offset is not None:
                self.refuse("OFFSET twice", f"one in the block of {cut(joint.name)}", "remove one of the two")
            joint.offset = [self.number(f"the offset's {axis}") for axis in "xyz"]
            return
        if joint.channels is not None or joint.site:
            self.refuse(
                "CHANNELS", f"one in the block of a joint, not in {cut(joint.name)} again", "remove it"
            )
        count = self.next("the number of channels")
        if not (count.isascii() and count.isdigit() and len(count) < 3 and int(count) <= len(CHANNEL_NAMES)):
            self.refuse(shown(count), "0 to 6 channels", "correct the number")
        joint.channels = []
        for _ in range(int(count)):
            word = self.next("a channel")
            if word.lower() not in CHANNEL_NAMES:
                self.refuse(
                    shown(word),
                    "Xposition … Zposition, Xrotation … Zrotation",
                    nearest(word, map(str.capitalize, CHANNEL_NAMES)),
                )
            joint.channels.append(Channel(*CHANNEL_NAMES[word.lower()]))
        if len(set(joint.channels)) != len(joint.channels):
            self.refuse("a channel twice", "each channel once", f"correct the channels of {cut(joint.name)}")

    def close(self) -> None:
        if not self.open:
            self.refuse("}", "ROOT", "it closes what was not opened")
        joint = self.joints[self.open.pop()]
        if joint.offset is None:
            self.refuse(f"no OFFSET in {cut(joint.name)}", "OFFSET x y z", "add it")

    def parse(self) -> Hierarchy:
        """Read to the end."""
        if self.next("HIERARCHY").lower() != "hierarchy":
            self.refuse("another word", "HIERARCHY in the first line", "check that it is a BVH file")
        for token in self.tokens:
            self.at, keyword = token.start(), token.group().lower()
            if keyword in ("root", "joint", "end"):
                self.joint(keyword)
            elif keyword in ("offset", "channels"):
                self.fill(keyword)
            elif keyword == "}":
                self.close()
            else:
                remedy = nearest(token.group(), ("ROOT", "JOINT", "End", "OFFSET", "CHANNELS"))
                self.refuse(shown(token.group()), "a keyword or a brace", remedy)
        self.at = len(self.text)
        if self.open:
            names = ", ".join(cut(self.joints[k].name) for k in self.open[:3])
            self.refuse(
                f"{len(self.open)} blocks open ({names})", "a } for every {", "add the missing braces"
            )
        if not self.joints:
            self.refuse("no joint", "ROOT and a name", "check that it is a BVH file")
        return self.finished()

    def finished(self) -> Hierarchy:
        names = tuple(joint.name for joint in self.joints)
        check_distinct(self.path, "joints", names)
        return Hierarchy(
            names=names,
            parents=tuple(joint.parent for joint in self.joints),
            offsets=np.array([joint.offset for joint in self.joints], dtype=np.float64),
            channels=tuple(tuple(joint.channels or ()) for joint in self.joints),
            sites=tuple(joint.site for joint in self.joints),
        )


def parse_hierarchy(path: object, text: str) -> Hierarchy:
    """Parse what stands before MOTION.

    Parameters
    ----------
    path : path
        What to call it in errors.
    text : str
        The file, up to its motion or whole.

    Raises
    ------
    InputError
        With the line that is wrong.
    """
    if len(text) > MAX_HEADER:
        got, limit = f"{len(text):,} characters before MOTION", f"at most {MAX_HEADER:,}"
        raise refusal(str(path), "HIERARCHY", got, limit, "check that it is a BVH file")
    return _Parser(path, text).parse()
