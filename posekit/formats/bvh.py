"""BVH: a skeleton's hierarchy and its channels over time, a text format of animation programs.

A file has three sections: HIERARCHY with ROOT, JOINT and End Site, each with OFFSET and CHANNELS; MOTION with Frames
and Frame Time; and one line of values for each frame, with angles in degrees (Meredith & Maddock 2001, *Motion Capture
File Formats Explained*, University of Sheffield, CS-01-11). The file states no unit and no up axis. By convention y is
up; centimetres are frequent.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from posekit.errors import refusal, shown
from posekit.files import text
from posekit.formats.body_checks import METRES, points_motion
from posekit.formats.options import Options
from posekit.geometry import Array, coordinate_rotation

if TYPE_CHECKING:
    from posekit.motion import Motion

MAX_JOINTS: Final = 2000
MAX_DEPTH: Final = 250
#: Largest length, position or angle that is read, in any unit.
LARGEST_VALUE: Final = 1e9
#: For each channel name in lower case: whether it is a rotation, and its axis, 0 to 2.
KINDS: Final = ("position", "rotation")
CHANNELS: Final = {f"{a}{kind}": (kind == "rotation", k) for kind in KINDS for k, a in enumerate("xyz")}

#: Metres per unit of the CMU database, 1/0.45 inch (mocap.cs.cmu.edu, FAQs); its BVH conversions have this unit, too.
CMU_METRES: Final = 0.0254 / 0.45
UNITS: Final = {**METRES, "0.45 in": CMU_METRES}
#: Usual length of the longest chain of bones between two ends of a skeleton, metres: CMU, LAFAN1 and Bandai-Namco
#: have 1.9 to 2.3.
CHAIN_METRES: Final = 2.0
#: Smallest and largest plausible length of this chain, metres: a small child's and a giant's.
CHAIN_BOUNDS: Final = (0.9, 4.5)
#: Number of frames that are sampled to find the unit.
FRAMES_SAMPLED: Final = 200
#: Share of the largest offset below which offsets are not compared with their position channels.
SMALL_OFFSET_SHARE: Final = 1e-3
_MOTION: Final = re.compile(r"^[ \t]*MOTION[ \t]*\r?$", re.MULTILINE | re.IGNORECASE)
_HEAD: Final = re.compile(r"\s*Frames\s*:\s*(\S+)\s+Frame\s*Time\s*:\s*(\S+)", re.IGNORECASE)
_TOKEN: Final = re.compile(r"[{}]|[^\s{}]+")
_NUMBER: Final = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,4})?", re.ASCII)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Bvh:
    """Content of a BVH file: joints and End Sites in the file's order, parents first.

    Attributes
    ----------
    text : str
        Text of the file.
    names : tuple of str (P,)
        Names of the joints. An End Site is named after its joint, such as ``LeftHand_end``.
    parents : tuple of int (P,)
        Index of each joint's parent; -1 for a root.
    offsets : array (P, 3)
        Offset of each joint from its parent, in the file's unit.
    channels : tuple (P,) of tuple of (bool, int)
        Whether each channel is a rotation, and its axis, 0 to 2.
    sites : tuple of bool (P,)
        Whether each joint is an End Site.
    frame_time : float
        Seconds from frame to frame; NaN if the file states no valid number.
    values : array (T, C)
        Values of the channels of all joints, in the file's unit of length and in degrees.
    frames : int
        Number of frames that the file states.
    """

    text: str
    names: tuple[str, ...]
    parents: tuple[int, ...]
    offsets: Array
    channels: tuple[tuple[tuple[bool, int], ...], ...]
    sites: tuple[bool, ...]
    frame_time: float
    values: Array
    frames: int

    @property
    def columns(self) -> list[slice]:
        """Columns of each joint's channels in `values`."""
        ends = np.cumsum([len(channels) for channels in self.channels]).tolist()
        return [slice(end - len(channels), end) for end, channels in zip(ends, self.channels, strict=True)]


def parse(data: bytes, source: str) -> Bvh:
    """Parse a BVH file.

    Raises
    ------
    InputError
        If the file is damaged or cut off; the message names the wrong line.
    """
    document = text(data, source)
    motion = _MOTION.search(document)
    if motion is None:
        remedy = "the file is cut off, or is no BVH file"
        raise refusal(source, "", "no line MOTION", "HIERARCHY, then MOTION", remedy)
    joints = _hierarchy(document[: motion.start()], source)
    head = _HEAD.match(document, motion.end())
    if head is None:
        line = document.count("\n", 0, motion.end()) + 2
        raise refusal(source, f"line {line}", "no header", "Frames: and Frame Time:", "add both after MOTION")
    if not (head[1].isascii() and head[1].isdigit() and 0 < int(head[1][:13]) < 10**12):
        raise refusal(source, "Frames", shown(head[1]), "a positive whole number")
    seconds = float(head[2]) if _NUMBER.fullmatch(head[2]) else np.nan
    names, parents, offsets, channels, sites = zip(*joints, strict=True)
    width = sum(map(len, channels))
    if width == 0:
        raise refusal(source, "CHANNELS", "none", "channels of at least one joint", "it has no motion")
    return Bvh(
        text=document,
        names=names,
        parents=parents,
        offsets=np.array(offsets, dtype=np.float64),
        channels=channels,
        sites=sites,
        frame_time=seconds if 1e-6 <= seconds <= 1e6 else np.nan,
        values=_values(document, head.end(), width, source),
        frames=int(head[1]),
    )


def _hierarchy(document: str, source: str) -> list[Any]:
    """Read joints as [name, parent, offset, channels, whether an End Site], word by word, without recursion."""
    tokens = list(_TOKEN.finditer(document))
    words = [token.group() for token in tokens]
    joints: list[Any] = []
    opened: list[int] = []
    at = 1
    try:
        if not words or words[0].lower() != "hierarchy":
            raise ValueError("HIERARCHY in the first line")
        while at < len(words):
            keyword = words[at].lower()
            if keyword in ("root", "joint", "end"):
                brace = words.index("{", at)
                _open_joint(joints, opened, keyword, words[at + 1 : brace])
                at = brace + 1
            elif keyword == "}":
                at, _ = at + 1, opened.pop()
            elif keyword == "offset" and joints[opened[-1]][2] is None:
                joints[opened[-1]][2] = [_number(words[at + k]) for k in (1, 2, 3)]
                at += 4
            elif keyword == "channels" and joints[opened[-1]][3] is None and not joints[opened[-1]][4]:
                names = words[at + 2 : at + 2 + int(words[at + 1])]
                joints[opened[-1]][3] = tuple(CHANNELS[name.lower()] for name in names)
                at += 2 + int(words[at + 1])
            else:
                raise ValueError("ROOT, JOINT, End Site, OFFSET and CHANNELS once a joint, or }")
        if opened or not joints or any(joint[2] is None for joint in joints):
            raise ValueError("joints, an OFFSET in each, and a } for every {")
        names = [joint[0] for joint in joints]
        if len(set(names)) != len(names):
            twice = next(name for name in names if names.count(name) > 1)
            raise refusal(source, "joints", f"{shown(twice)} twice", "each name once", "rename one of both")
        if any(len(set(joint[3] or ())) != len(joint[3] or ()) for joint in joints):
            raise ValueError("each channel of a joint once")
    except (ValueError, IndexError, KeyError) as error:
        token = tokens[min(at, len(tokens) - 1)] if tokens else None
        line = document.count("\n", 0, token.start() if token else 0) + 1
        got = "the end of the hierarchy" if at >= len(words) else shown(" ".join(words[at : at + 6]))
        own = type(error) is ValueError and "invalid" not in str(error)
        expected = str(error) if own else "numbers, and names of channels"
        raise refusal(source, f"line {line}", got, expected, "correct it, or complete the file") from None
    return [[*joint[:3], joint[3] or (), joint[4]] for joint in joints]


def _open_joint(joints: list[Any], opened: list[int], keyword: str, words: list[str]) -> None:
    """Append a joint, or an End Site that is named after its joint."""
    site, parent = keyword == "end", opened[-1] if opened else -1
    if (keyword == "root") == bool(opened) or (opened and joints[parent][4]) or "}" in words:
        raise ValueError("JOINT or End Site inside a joint, ROOT outside")
    if len(joints) >= MAX_JOINTS or len(opened) >= MAX_DEPTH or not words:
        raise ValueError(f"a name; at most {MAX_JOINTS} joints, {MAX_DEPTH} deep")
    name = " ".join(words)
    if site:
        count = sum(one[1] == parent and one[4] for one in joints) + 1
        name = f"{joints[parent][0]}_end{count if count > 1 else ''}"
    opened.append(len(joints))
    joints.append([name, parent, None, None, site])


def _number(word: str) -> float:
    if not _NUMBER.fullmatch(word) or not abs(float(word)) <= LARGEST_VALUE:
        raise ValueError(f"a number of at most {LARGEST_VALUE:g}")
    return float(word)


def _values(document: str, start: int, width: int, source: str) -> Array:
    """Read the channel values of all frames (T, C), which follow the lines Frames and Frame Time."""
    try:
        values = np.array(document[start:].split(), dtype=np.float64)
        sane = (np.abs(values) <= LARGEST_VALUE).all() and "_" not in document[start:]
        if sane and len(values) and len(values) % width == 0:
            return values.reshape(-1, width)
    except ValueError:
        pass
    first = document.count("\n", 0, start) + 1
    for number, line in enumerate(document[start:].split("\n"), first):
        words = line.split()
        bad = [word for word in words if not _NUMBER.fullmatch(word) or not abs(float(word)) <= LARGEST_VALUE]
        if bad or (words and len(words) != width):
            got = shown(bad[0]) if bad else f"{len(words)} values"
            remedy = "the file is cut off there, or its CHANNELS are not those of its frames"
            raise refusal(source, f"line {number}", got, f"{width} finite numbers, one per channel", remedy)
    raise refusal(source, "MOTION", "no frames", "one line of values per frame", "the file is cut off")


def read(document: Bvh, path: str, options: Options) -> Motion:
    """Convert a BVH file to a motion; its points are the joints, and the End Sites with a nonzero offset."""
    absolute = positions_are_absolute(document)
    points = world_points(document, absolute=absolute)
    held = zip(document.parents, document.channels, strict=True)
    if absolute and any(parent >= 0 and not all(turns for turns, _ in own) for parent, own in held):
        options.note("position channels replace the offsets")
    if (frames := len(document.values)) != document.frames:
        options.warn(f"Frames is {document.frames}, but the file has {frames}: it may be cut off")
    unit, metres = (
        (options.unit, METRES[options.unit]) if options.unit else _unit(document, points, path, options)
    )
    kept = [k for k, site in enumerate(document.sites) if not site or document.offsets[k].any()]
    return points_motion(
        points[:, kept],
        [document.names[k] for k in kept],
        path,
        options,
        unit=unit,
        metres=metres,
        rate=1.0 / document.frame_time,
        up_by_custom="+y",
        document=document,
        in_world=True,
    )


def holds(document: Bvh, motion: Motion) -> bool:
    """Return whether the joints of a motion are unchanged since the motion was read from the file."""
    if motion.joints is None or len(motion) != len(document.values):
        return False
    layout = motion.layout if motion.layout.endswith(".toml") else ""
    own = read(document, motion.source, Options(layout=layout))
    return own.joints is not None and bool(np.array_equal(own.joints, motion.joints, equal_nan=True))


def with_values(document: Bvh, values: Array) -> Bvh:
    """Return the file with new values (T, C); unchanged numbers keep their text byte for byte."""
    if values.shape != document.values.shape:
        raise refusal("", "values", f"shape {values.shape}", f"{document.values.shape}", "keep the shape")
    head = _HEAD.match(document.text, _MOTION.search(document.text).end())  # type: ignore[union-attr]
    start = head.end()  # type: ignore[union-attr]
    parts = re.split(r"(\S+)", document.text[start:])  # white space and words in turn
    for place in np.flatnonzero((values != document.values).ravel()).tolist():
        parts[2 * place + 1] = f"{values.flat[place]:.6f}"
    return replace(document, text=document.text[:start] + "".join(parts), values=values)


def world_points(document: Bvh, *, absolute: bool, values: Array | None = None) -> Array:
    r"""Compute the positions of joints and End Sites in every frame by forward kinematics.

    The transform from a joint to its parent is a translation by offset and position channels, followed by intrinsic
    rotations in the order of the channels: :math:`T = T(o) R_a R_b R_c` (Meredith & Maddock 2001).

    Parameters
    ----------
    document : Bvh
        Content of the file.
    absolute : bool
        Whether position channels replace the offset; otherwise they are added to it.
    values : array (T, C), optional
        Channel values; by default those of the file.

    Returns
    -------
    array (T, P, 3)
        Positions in the file's unit and axes.
    """
    values = document.values if values is None else values
    points = np.empty((len(values), len(document.names), 3))
    rotations: list[Array | None] = []
    for k, (parent, channels) in enumerate(zip(document.parents, document.channels, strict=True)):
        local = np.tile(document.offsets[k], (len(values), 1))
        R = turn = rotations[parent] if parent >= 0 else None
        for (rotates, axis), value in zip(channels, values[:, document.columns[k]].T, strict=True):
            if rotates:
                one = coordinate_rotation(axis, np.radians(value))
                R = one if R is None else R @ one
            elif absolute:
                local[:, axis] = value
            else:
                local[:, axis] += value
        if turn is not None:
            local = np.einsum("tij,tj->ti", turn, local)
        points[:, k] = local if parent < 0 else points[:, parent] + local
        rotations.append(R)
    return points


def positions_are_absolute(document: Bvh) -> bool:
    """Return whether position channels replace the offsets; otherwise they are added to the offsets.

    According to the format's description, a joint's position channels are added to its offset. MotionBuilder, Blender
    and data sets made with them (LAFAN1, Bandai-Namco) write the whole position into the channels and also state the
    offset. Channels replace offsets if the channels of most joints below the root are near the joints' offsets. A root
    may be anywhere; roots decide only if no other joint can.
    """
    small = SMALL_OFFSET_SHARE * float(np.abs(document.offsets).max(initial=0.0))
    votes: dict[bool, list[bool]] = {True: [], False: []}
    for k, channels in enumerate(document.channels):
        near = []
        for (rotates, axis), value in zip(channels, document.values[:, document.columns[k]].T, strict=True):
            offset = document.offsets[k, axis]
            if not rotates and abs(offset) > small:
                near.append(bool(abs(np.median(value) - offset) < 0.5 * abs(offset)))
        if near:
            votes[document.parents[k] < 0].append(any(near))
    decisive = votes[False] or votes[True]
    return bool(decisive) and 2 * sum(decisive) >= len(decisive)


def _unit(document: Bvh, points: Array, source: str, options: Options) -> tuple[str, float]:
    """Find the unit from the length of the longest chain of bones, which does not depend on the posture."""
    length = _longest_chain(points[:: max(1, len(points) // FRAMES_SAMPLED)], document.parents)
    unit = min(UNITS, key=lambda name: abs(np.log(max(length * UNITS[name] / CHAIN_METRES, 1e-300))))
    metres = length * UNITS[unit]
    if not CHAIN_BOUNDS[0] <= metres <= CHAIN_BOUNDS[1]:
        got = f"a skeleton whose longest chain of bones has {length:.4g} units"
        raise refusal(source, "unit", got, f"{CHAIN_METRES:g} m in {', '.join(UNITS)}", "state it (--unit)")
    words = {"in": "inches", "0.45 in": "CMU's unit (an inch over 0.45)"}.get(unit, unit)
    options.note(f"lengths are in {words}: the longest chain of bones has {length:.4g} units, {metres:.2f} m")
    return unit, UNITS[unit]


def _longest_chain(points: Array, parents: tuple[int, ...]) -> float:
    """Return the length of the longest chain of bones between two leaves of the tree; median over frames.

    A root with a single child is excluded, because it is a point of the world, not a joint of the body.
    """
    count = len(parents)
    children = np.bincount([parent for parent in parents if parent >= 0], minlength=count)
    bone, deepest, longest = np.zeros(count), np.zeros(count), 0.0
    outside = set()
    for k, parent in enumerate(parents):
        if parent < 0 or parent in outside:
            if children[k] == 1:
                outside.add(k)
        else:
            bone[k] = np.median(np.linalg.norm(points[:, k] - points[:, parent], axis=-1))
    for k in range(count - 1, -1, -1):
        if parents[k] >= 0:
            way = deepest[k] + bone[k]
            longest = max(longest, deepest[parents[k]] + way)
            deepest[parents[k]] = max(deepest[parents[k]], way)
    return float(longest)
