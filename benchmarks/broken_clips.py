"""What defects make of the points of a clip: they float, slide, jump, tremble, or have labels exchanged.

Each function takes a clip, the first and the last frame that shall be wrong, a size, and a generator of random numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.clean_clips import up_of
from posekit.geometry import Array
from posekit.skeleton import HEAD_POINTS, JOINTS, LIMB_JOINTS, other_side
from posekit.validators.motion import MotionClip
from posekit.validators.motion.ground import ground_of

Span = tuple[int, int]
"""First and last frame."""


@dataclass(frozen=True, kw_only=True)
class Broken:
    """What a defect made of a clip."""

    clip: MotionClip
    span: Span
    place: str = ""


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


def body_spread_step(clip: MotionClip, span: Span, size: float, rng: np.random.Generator) -> Broken:
    """Displace the body by metres, evenly over the frames of a span; it stays where it came to."""
    way = size * np.cumsum(_in_span(clip, span)) / (span[1] - span[0] + 1)
    return Broken(clip=moved(clip, way[:, None] * _direction(rng)), span=span)


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
