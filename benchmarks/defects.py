"""Defects that are put into clean clips, each with its name, its size and the frames it is in.

`draw` puts one of `DEFECTS` into a span of a clip, or into all of it; a span is its first and its last frame.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.clean_clips import CleanClip, standing, up_of
from posekit.geometry import Array
from posekit.skeleton import HEAD_POINTS, JOINTS, LIMB_JOINTS, other_side
from posekit.validators.motion import MotionClip
from posekit.validators.motion.ground import ground_of

Span = tuple[int, int]
"""First and last frame."""

MARGIN_FRAMES: Final = 6
"""Between a span and the ends of its clip: what is at an end has no neighbours to tell it by."""


@dataclass(frozen=True, kw_only=True, eq=False)
class DefectCase:
    """A clip with one defect.

    Parameters
    ----------
    kind : str
        Of `DEFECTS`.
    size : float
        In the kind's unit.
    clip : MotionClip
        With the defect.
    span : tuple of int
        The first and the last frame that are wrong.
    place : str
        Where on the body; empty where all of it.
    source : str
        The name of the clean clip.
    """

    kind: str
    size: float
    clip: MotionClip
    span: Span
    place: str
    source: str


@dataclass(frozen=True, kw_only=True)
class Broken:
    """What a defect made of a clip."""

    clip: MotionClip
    span: Span
    place: str = ""


@dataclass(frozen=True, kw_only=True)
class Defect:
    """A kind of defect.

    Parameters
    ----------
    name : str
        What tables call it.
    checks : tuple of str
        What names it rightly.
    unit : str
        Of its sizes.
    sizes : tuple of float
        From those that must be found, to where it fails.
    asked : float
        The least size that must be found.
    put : callable
        From clip, span, size and generator to the broken clip.
    frames : tuple of int
        The least and the most frames of its span; 0 means all of the clip.
    grounded : bool
        Whether a foot must stand in all frames of its span.
    rate : float
        Frames a second that a clip must have for it to be told.
    share : float
        Of a clip that may be wrong: what is off in most frames is what a clip usually has.
    """

    name: str
    checks: tuple[str, ...]
    unit: str
    sizes: tuple[float, ...]
    asked: float
    put: Callable[[MotionClip, Span, float, np.random.Generator], Broken | None]
    frames: tuple[int, int] = (15, 60)
    grounded: bool = False
    rate: float = 0.0
    share: float = 1.0


def every_point(clip: MotionClip, change: Callable[[Array], Array]) -> MotionClip:
    """Change joints, head and feet alike: a function of points (T, K, 3)."""
    return replace(clip, joints=change(clip.joints), head=change(clip.head), feet=change(clip.feet))


def moved(clip: MotionClip, by: Array) -> MotionClip:
    """Move the body by (T, 3) metres."""
    return every_point(clip, lambda points: points + by[:, None])


def _in_span(clip: MotionClip, span: Span) -> Array:
    """Return 1 in a span and 0 outside (T,)."""
    inside = np.zeros(len(clip))
    inside[span[0] : span[1] + 1] = 1.0
    return inside


def _direction(rng: np.random.Generator) -> Array:
    drawn = rng.normal(size=3)
    return np.asarray(drawn / np.linalg.norm(drawn))


def _horizontal(clip: MotionClip, rng: np.random.Generator) -> Array:
    drawn = _direction(rng)
    drawn = drawn - (drawn @ up_of(clip)) * up_of(clip)
    return np.asarray(drawn / np.linalg.norm(drawn))


def floating(clip: MotionClip, span: Span, size: float, rng: np.random.Generator) -> Broken:
    """Lift the body by metres; sink it where they are negative."""
    del rng
    return Broken(clip=moved(clip, size * _in_span(clip, span)[:, None] * up_of(clip)), span=span)


def sinking(clip: MotionClip, span: Span, size: float, rng: np.random.Generator) -> Broken:
    """Sink the body by metres."""
    return floating(clip, span, -size, rng)


def floating_clip(clip: MotionClip, span: Span, size: float, rng: np.random.Generator) -> Broken:
    """Lift the body by metres over the ground that is given; sink it where they are negative."""
    lifted = floating(clip, span, size, rng).clip
    return Broken(clip=replace(lifted, ground=ground_of(clip).low), span=span)


def sinking_clip(clip: MotionClip, span: Span, size: float, rng: np.random.Generator) -> Broken:
    """Sink the body by metres into the ground that is given."""
    return floating_clip(clip, span, -size, rng)


def sliding(clip: MotionClip, span: Span, size: float, rng: np.random.Generator) -> Broken:
    """Move the body along the ground by metres a second; it stays where it came to."""
    way = size * clip.step * np.cumsum(_in_span(clip, span))
    return Broken(clip=moved(clip, way[:, None] * _horizontal(clip, rng)), span=span)


def joint_jump(clip: MotionClip, span: Span, size: float, rng: np.random.Generator) -> Broken:
    """Displace one joint in one frame by metres."""
    joints, at, joint = clip.joints.copy(), span[0], int(rng.integers(len(JOINTS)))
    joints[at, joint] += size * _direction(rng)
    return Broken(clip=replace(clip, joints=joints), span=(at, at), place=JOINTS[joint])


def body_jump(clip: MotionClip, span: Span, size: float, rng: np.random.Generator) -> Broken:
    """Displace the body in one frame by metres."""
    at = span[0], span[0]
    return Broken(clip=moved(clip, size * _in_span(clip, at)[:, None] * _direction(rng)), span=at)


def body_step(clip: MotionClip, span: Span, size: float, rng: np.random.Generator) -> Broken:
    """Displace the body from a frame on by metres."""
    after = _in_span(clip, (span[0], len(clip) - 1))
    return Broken(clip=moved(clip, size * after[:, None] * _direction(rng)), span=(span[0], span[0]))


def swap(*parts: str) -> Callable[[MotionClip, Span, float, np.random.Generator], Broken]:
    """Return the defect that takes right for left at some parts of the body, in a span."""

    def put(clip: MotionClip, span: Span, size: float, rng: np.random.Generator) -> Broken:
        del size, rng
        rows = slice(span[0], span[1] + 1)

        def swapped(points: Array, names: Sequence[str]) -> Array:
            order = [
                names.index(other_side(name)) if any(part in name for part in parts) else k
                for k, name in enumerate(names)
            ]
            changed = points.copy()
            changed[rows] = points[rows][:, order]
            return changed

        broken = replace(
            clip,
            joints=swapped(clip.joints, JOINTS),
            head=swapped(clip.head, HEAD_POINTS),
            feet=swapped(clip.feet, ("right_toe", "left_toe", "right_heel", "left_heel")),
        )
        return Broken(clip=broken, span=span, place=parts[0])

    return put


def bent(middle: str, flexion: float) -> Callable[[MotionClip, Span, float, np.random.Generator], Broken]:
    """Return the defect that bends elbows or knees to degrees of flexion plus its size, in their own plane."""

    def put(clip: MotionClip, span: Span, size: float, rng: np.random.Generator) -> Broken:
        side = ("right_", "left_")[int(rng.integers(2))]
        start, bend, end = next(limb for limb in LIMB_JOINTS if JOINTS[limb[1]] == side + middle)
        rows, joints = slice(span[0], span[1] + 1), clip.joints.copy()
        upper = joints[rows, bend] - joints[rows, start]
        lower = joints[rows, end] - joints[rows, bend]
        along = upper / np.linalg.norm(upper, axis=-1, keepdims=True)
        length = np.linalg.norm(lower, axis=-1, keepdims=True)
        across = lower - (lower * along).sum(-1, keepdims=True) * along
        across = across / np.maximum(np.linalg.norm(across, axis=-1, keepdims=True), 1e-9)
        angle = np.radians(flexion + np.sign(flexion) * size) if flexion else -np.radians(size)
        joints[rows, end] = joints[rows, bend] + length * (np.cos(angle) * along + np.sin(angle) * across)
        return Broken(clip=replace(clip, joints=joints), span=span, place=side + middle)

    return put


def drift(clip: MotionClip, span: Span, size: float, rng: np.random.Generator) -> Broken:
    """Lengthen or shorten a limb's segment by a share, over five frames, and back; of the span, where it is half."""
    start, end = _limb_segment(rng)
    weight = np.convolve(_in_span(clip, (span[0] - 2, span[1] + 2)), np.full(5, 0.2), mode="same")
    joints = clip.joints.copy()
    way = (joints[:, end] - joints[:, start]) * (rng.choice((-1.0, 1.0)) * size * weight)[:, None]
    for joint in (end, *_beyond(end)):
        joints[:, joint] += way
    inside = np.flatnonzero(weight > 0.5)
    place = f"{JOINTS[start]}-{JOINTS[end]}"
    return Broken(clip=replace(clip, joints=joints), span=(int(inside[0]), int(inside[-1])), place=place)


def _limb_segment(rng: np.random.Generator) -> Span:
    limb = LIMB_JOINTS[int(rng.integers(len(LIMB_JOINTS)))]
    first = int(rng.integers(2))
    return limb[first], limb[first + 1]


def _beyond(joint: int) -> tuple[int, ...]:
    """Return the joints of a limb behind one of it."""
    limb = next(limb for limb in LIMB_JOINTS if joint in limb)
    return limb[limb.index(joint) + 1 :]


def jitter(clip: MotionClip, span: Span, size: float, rng: np.random.Generator) -> Broken:
    """Add normal noise of a standard deviation in metres to all coordinates."""
    inside = _in_span(clip, span)[:, None, None]
    return Broken(
        clip=every_point(clip, lambda points: points + inside * rng.normal(0, size, points.shape)), span=span
    )


def joint_jitter(clip: MotionClip, span: Span, size: float, rng: np.random.Generator) -> Broken:
    """Add normal noise of a standard deviation in metres to one joint."""
    joint, joints = int(rng.integers(len(JOINTS))), clip.joints.copy()
    joints[:, joint] += _in_span(clip, span)[:, None] * rng.normal(0, size, (len(clip), 3))
    return Broken(clip=replace(clip, joints=joints), span=span, place=JOINTS[joint])


def _rearranged(clip: MotionClip, order: NDArray[np.intp], *, with_time: bool = False) -> MotionClip:
    time = clip.time[order] if with_time else np.arange(len(order)) * clip.step + clip.time[0]
    return replace(clip, joints=clip.joints[order], head=clip.head[order], feet=clip.feet[order], time=time)


def frozen(clip: MotionClip, span: Span, size: float, rng: np.random.Generator) -> Broken:
    """Hold the frame before a span of so many frames, and go on where the motion is by then."""
    del rng
    last = span[0] + round(size) - 1
    order = np.arange(len(clip))
    order[span[0] : last + 1] = span[0] - 1
    return Broken(clip=_rearranged(clip, order), span=(span[0], last))


def repeated(clip: MotionClip, span: Span, size: float, rng: np.random.Generator) -> Broken:
    """Say a frame so many times again, and go on from it."""
    del rng
    order = np.insert(np.arange(len(clip)), span[0], [span[0] - 1] * round(size))
    return Broken(clip=_rearranged(clip, order), span=(span[0], span[0] + round(size) - 1))


def missing(clip: MotionClip, span: Span, size: float, rng: np.random.Generator) -> Broken:
    """Leave out so many frames; the others keep their times."""
    del rng
    order = np.delete(np.arange(len(clip)), slice(span[0], span[0] + round(size)))
    return Broken(clip=_rearranged(clip, order, with_time=True), span=(span[0], span[0]))


def out_of_order(clip: MotionClip, span: Span, size: float, rng: np.random.Generator) -> Broken:
    """Put so many frames in another order; they keep their times."""
    last = span[0] + round(size) - 1
    order = _shuffled(len(clip), (span[0], last), rng)
    return Broken(clip=_rearranged(clip, order, with_time=True), span=(span[0], last))


def shuffled(clip: MotionClip, span: Span, size: float, rng: np.random.Generator) -> Broken | None:
    """Put the frames of a span in another order, under even times; in motion of more metres a frame than its size."""
    steps = np.linalg.norm(np.diff(clip.joints[span[0] : span[1] + 1], axis=0), axis=-1).max(axis=1)
    if np.median(steps) < size:
        return None
    return Broken(clip=_rearranged(clip, _shuffled(len(clip), span, rng)), span=span)


def _shuffled(count: int, span: Span, rng: np.random.Generator) -> NDArray[np.intp]:
    """Permute a span so that its first and its last frame are others."""
    order, rows = np.arange(count), np.arange(span[0], span[1] + 1)
    drawn = rng.permutation(rows)
    while drawn[0] == rows[0] or drawn[-1] == rows[-1]:
        drawn = rng.permutation(rows)
    order[rows] = drawn
    return order


def another_unit(clip: MotionClip, span: Span, size: float, rng: np.random.Generator) -> Broken:
    """Take metres for another unit: all coordinates times its size."""
    del rng
    return Broken(clip=every_point(clip, lambda points: points * size), span=span)


def another_up(clip: MotionClip, span: Span, size: float, rng: np.random.Generator) -> Broken:
    """Turn the body by degrees about a horizontal axis of the coordinates; what is said to be up stays."""
    horizontal = np.eye(3)[np.abs(up_of(clip)) < 0.5]
    axis, angle = horizontal[int(rng.integers(2))], np.radians(size)
    cross = np.cross(np.eye(3), axis)
    turn = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return Broken(clip=every_point(clip, lambda points: points @ turn), span=span)


_ONE_FRAME, _WHOLE = (1, 1), (0, 0)
_BOTH_SIDES = ("shoulder", "elbow", "wrist", "hip", "knee", "ankle", "toe", "heel", "eye", "ear")

DEFECTS: Final[Mapping[str, Defect]] = {
    one.name: one
    for one in (
        Defect(
            name="floating",
            checks=("floating", "support"),
            unit="m",
            sizes=(0.1, 0.05, 0.03, 0.02, 0.01),
            asked=0.03,
            put=floating,
            grounded=True,
        ),
        Defect(
            name="sinking",
            checks=("penetration",),
            unit="m",
            sizes=(0.1, 0.05, 0.03, 0.02, 0.01),
            asked=0.03,
            put=sinking,
            grounded=True,
        ),
        Defect(
            name="floating clip",
            checks=("floating", "support"),
            unit="m",
            sizes=(0.1, 0.05, 0.03, 0.02, 0.01),
            asked=0.03,
            put=floating_clip,
            frames=_WHOLE,
        ),
        Defect(
            name="sinking clip",
            checks=("penetration",),
            unit="m",
            sizes=(0.1, 0.05, 0.03, 0.02, 0.01),
            asked=0.03,
            put=sinking_clip,
            frames=_WHOLE,
        ),
        Defect(
            name="sliding",
            checks=("sliding", "skating"),
            unit="m/s",
            sizes=(0.3, 0.1, 0.05, 0.03),
            asked=0.05,
            put=sliding,
            grounded=True,
        ),
        Defect(
            name="jump of a joint",
            checks=("teleport",),
            unit="m",
            sizes=(0.3, 0.1, 0.05, 0.03),
            asked=0.1,
            put=joint_jump,
            frames=_ONE_FRAME,
        ),
        Defect(
            name="jump of the body",
            checks=("teleport",),
            unit="m",
            sizes=(0.3, 0.1, 0.05, 0.03),
            asked=0.1,
            put=body_jump,
            frames=_ONE_FRAME,
        ),
        Defect(
            name="step of the body",
            checks=("teleport",),
            unit="m",
            sizes=(0.3, 0.1, 0.05, 0.03),
            asked=0.1,
            put=body_step,
            frames=_ONE_FRAME,
        ),
        Defect(
            name="swap of both sides",
            checks=("swap",),
            unit="",
            sizes=(1.0,),
            asked=1.0,
            put=swap(*_BOTH_SIDES),
            frames=(5, 100),
        ),
        Defect(
            name="swap of the arms",
            checks=("swap",),
            unit="",
            sizes=(1.0,),
            asked=1.0,
            put=swap("shoulder", "elbow", "wrist"),
            frames=(5, 100),
        ),
        Defect(
            name="swap of the legs",
            checks=("swap",),
            unit="",
            sizes=(1.0,),
            asked=1.0,
            put=swap("hip", "knee", "ankle", "toe", "heel"),
            frames=(5, 100),
        ),
        Defect(
            name="swap of forearms",
            checks=("swap",),
            unit="",
            sizes=(1.0,),
            asked=1.0,
            put=swap("elbow", "wrist"),
            share=0.6,
            frames=(5, 100),
        ),
        Defect(
            name="elbow beyond",
            checks=("joint-range",),
            unit="deg",
            sizes=(30.0, 10.0, 5.0),
            asked=10.0,
            put=bent("elbow", 150.0),
        ),
        Defect(
            name="knee beyond",
            checks=("joint-range",),
            unit="deg",
            sizes=(30.0, 10.0, 5.0),
            asked=10.0,
            put=bent("knee", 0.0),
        ),
        Defect(
            name="drift of a length",
            checks=("drift",),
            unit="1",
            sizes=(0.1, 0.05, 0.03, 0.02),
            asked=0.05,
            put=drift,
            share=0.35,
        ),
        Defect(
            name="jitter",
            checks=("jitter",),
            unit="m",
            sizes=(0.02, 0.01, 0.005, 0.003),
            asked=0.01,
            put=jitter,
            rate=25.0,
        ),
        Defect(
            name="jitter of a joint",
            checks=("jitter",),
            unit="m",
            sizes=(0.02, 0.01, 0.005, 0.003),
            asked=0.01,
            put=joint_jitter,
            rate=25.0,
        ),
        Defect(
            name="frozen",
            checks=("frozen",),
            unit="frames",
            sizes=(30.0, 15.0, 8.0),
            asked=8.0,
            put=frozen,
            frames=(30, 30),
        ),
        Defect(
            name="repeated",
            checks=("repeated",),
            unit="frames",
            sizes=(2.0, 1.0),
            asked=1.0,
            put=repeated,
            frames=_ONE_FRAME,
        ),
        Defect(
            name="missing",
            checks=("timing",),
            unit="frames",
            sizes=(10.0, 3.0, 1.0),
            asked=1.0,
            put=missing,
            frames=(10, 10),
        ),
        Defect(
            name="out of order",
            checks=("timing",),
            unit="frames",
            sizes=(30.0, 10.0, 3.0),
            asked=3.0,
            put=out_of_order,
            frames=(30, 30),
        ),
        Defect(
            name="shuffled",
            checks=("timing",),
            unit="m a frame",
            sizes=(0.05, 0.03, 0.02),
            asked=0.03,
            put=shuffled,
        ),
        Defect(
            name="another unit",
            checks=("unit",),
            unit="times",
            sizes=(1000.0, 100.0, 39.37),
            asked=1.0,
            put=another_unit,
            frames=_WHOLE,
        ),
        Defect(
            name="another up axis",
            checks=("up",),
            unit="deg",
            sizes=(180.0, 90.0),
            asked=90.0,
            put=another_up,
            frames=_WHOLE,
        ),
    )
}
"""All kinds, by name."""


def draw(
    clips: Sequence[CleanClip], kind: Defect, size: float, rng: np.random.Generator, *, tries: int = 200
) -> DefectCase | None:
    """Put one defect into a span of one of the clips; None where none of them has a span that fits it."""
    for _ in range(tries):
        clean = clips[int(rng.integers(len(clips)))]
        span = _span(clean.clip, kind, rng)
        broken = None if span is None else kind.put(clean.clip, span, size, rng)
        if broken is not None:
            return DefectCase(
                kind=kind.name,
                size=size,
                clip=broken.clip,
                span=broken.span,
                place=broken.place,
                source=clean.name,
            )
    return None


def _span(clip: MotionClip, kind: Defect, rng: np.random.Generator) -> Span | None:
    if kind.frames == _WHOLE:
        return 0, len(clip) - 1
    if clip.rate < kind.rate:
        return None
    room = len(clip) - 2 * MARGIN_FRAMES
    least, most = kind.frames
    if room < least:
        return None
    count = int(rng.integers(least, min(most, room) + 1))
    if count > kind.share * len(clip):
        return None
    first = MARGIN_FRAMES + int(rng.integers(room - count + 1))
    if kind.grounded and not standing(clip)[first : first + count].all():
        return None
    return first, first + count - 1
