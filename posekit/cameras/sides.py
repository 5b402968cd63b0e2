r"""Left and right exchanged by a detector: in single pictures, or in all of them.

In single pictures an exchange makes the difference d of right and left jump: along a film the signs :math:`s_t` with
the least second differences :math:`\sum_t | s_t d_t - 2 s_{t-1} d_{t-1} + s_{t-2} d_{t-2} |^2` are found by dynamic
programming over :math:`s_t s_{t-1}` (Viterbi 1967). An exchange in all pictures shows
in shoulders, hips and face that are opposite to each other, and in a face that is seen while the right shoulder is at
the picture's right.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from posekit.geometry import Array, Flags, Ints, runs
from posekit.skeleton import POINT, SIDES

if TYPE_CHECKING:
    from posekit.cameras.detections import Detections

LEG: Final = ("hip", "knee", "ankle")
ARM: Final = ("shoulder", "elbow", "wrist")
#: Length of a leg over that of the trunk, middle of the shoulders to middle of the hips.
LEG_OVER_TRUNK: Final = 1.6
#: Pictures before and after over which the person's size is a median: limbs point at the camera now and then.
AROUND: Final = 7
#: Widths in the picture, in leg lengths, from which the order of the sides is clear: half of those from the front.
CLEAR: Final = {"shoulder": 0.2, "hip": 0.125, "ear": 0.12, "eye": 0.05}
#: Confidence of nose and eyes over that of the body from which the face is seen.
FACE_SEEN: Final = 0.6
#: Confidence of nose and eyes over that of the body below which the face is turned away.
FACE_HIDDEN: Final = 0.25
#: Weight of a face that is not seen, against one that is.
FACE_AWAY_WEIGHT: Final = 0.7
#: Size of a jump, in leg lengths: smaller ones are noise.
JUMP: Final = 0.25
#: Ratio of the second differences before and after an exchange back, from which an exchange is suspected.
JUMP_GAIN: Final = 4.0
#: Pictures of a film without gaps in which a jump can be found.
LEAST_PICTURES: Final = 5
#: Median second difference, in leg lengths, beyond which pictures are too far apart.
APART: Final = 0.5
#: Evidence from which a warning is given; people labelled rightly do not reach it.
SURE: Final = 1.5
#: Bound of one kind of evidence.
MOST_EVIDENCE: Final = 3.0
#: Share of the clear pictures in which parts are opposite, from which they are so in all.
EXCHANGED_SHARE: Final = 0.6


def side_warnings(points: Array, confidence: Array, frame: Ints, detections: Detections) -> list[str]:
    """Tell where left and right of one person seem exchanged.

    Parameters
    ----------
    points : array (F, 19, 2)
        One person's, pixels, in the order of the pictures; NaN where one is missing.
    confidence : array (F, 19)
        NaN where there is none.
    frame : int array (F,)
        Pictures.
    detections : Detections
        Names of the pictures, and whether they are a film.

    Returns
    -------
    list of str
        A sentence each; empty if nothing is suspected.
    """
    found, body, pictures = [], points.copy(), detections.pictures
    jumps = {"arms": np.zeros(len(frame), dtype=np.bool_), "legs": np.zeros(len(frame), dtype=np.bool_)}
    around = AROUND if detections.film else 0
    if detections.film:
        ways = _orders(body, around)
        for name, parts in (("arms", ARM), ("legs", LEG)):
            jumps[name] = _jumps(body, frame, parts)
        alone = jumps["arms"] ^ jumps["legs"]
        for name, parts in (("arms", ARM), ("legs", LEG)):
            for start, end in runs(jumps[name].copy()):
                # Arms or legs alone, exchanged, would be opposite to the other pair.
                jumps[name][start:end] = (ways["shoulder"] * ways["hip"] * alone)[start:end].sum() <= 0
            body[jumps[name]] = _exchanged(body[jumps[name]], parts)
    if (jumped := jumps["arms"] | jumps["legs"]).any():
        names = [pictures[k] or str(k) for k in frame[jumped].tolist() if k < len(pictures)]
        listed = ", ".join(names[:5]) + (", …" if len(names) > 5 else "")
        found.append(f"{detections.source}: left and right jump in {jumped.sum()} pictures: {listed}")
    evidence = _opposed(body, confidence, around)
    total = sum(evidence.values())
    if "shoulders against hips" in evidence or total > SURE:
        why = ", ".join(f"{name} {worth:+.1f}" for name, worth in evidence.items() if worth > 0)
        found.append(
            f"{detections.source}: left and right look exchanged in all pictures ({why}); look at a picture, and "
            "exchange their names in a layout of your own if so"
        )
    return found


def _of(points: Array, name: str) -> Array:
    return points[:, POINT[name]]


def _pair(points: Array, part: str) -> Array:
    """Return right minus left (F, 2)."""
    return _of(points, f"right_{part}") - _of(points, f"left_{part}")


def _middle(points: Array, part: str) -> Array:
    return (_of(points, f"right_{part}") + _of(points, f"left_{part}")) / 2


def _long(vectors: Array) -> Array:
    return np.asarray(np.hypot(vectors[..., 0], vectors[..., 1]))


def _limb(points: Array, side: str, parts: tuple[str, str, str]) -> Array:
    a, b, c = (_of(points, f"{side}_{part}") for part in parts)
    return _long(b - a) + _long(c - b)


def _trunk(points: Array) -> Array:
    return _long(_middle(points, "hip") - _middle(points, "shoulder"))


def _upright(points: Array) -> Flags:
    """Tell where the trunk is within 45 degrees of upright in the picture (F,)."""
    up = _middle(points, "shoulder") - _middle(points, "hip")
    with np.errstate(invalid="ignore"):
        return np.asarray(-up[:, 1] > np.abs(up[:, 0]))


def _size(points: Array, around: int) -> Array:
    """Return the person's leg length in each picture (F,): the largest of both legs and of the trunk's share."""
    lengths = [_limb(points, side, LEG) for side in SIDES]
    each = np.fmax(np.fmax(*lengths), LEG_OVER_TRUNK * _trunk(points))
    padded = np.pad(each, around, constant_values=np.nan)
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * around + 1)
    found = np.full(len(each), np.nan)
    some = ~np.isnan(windows).all(axis=1)
    found[some] = np.nanmedian(windows[some], axis=1)
    return np.where(found > 0, found, np.nan)


def _orders(points: Array, around: int) -> dict[str, Array]:
    """Return per part (F,): 1 if the right is clearly at the picture's right, -1 at its left, 0 if it is not clear."""
    unit = _size(points, around)
    found = {}
    for part, least in CLEAR.items():
        width = np.nan_to_num(_pair(points, part)[:, 0] / unit)
        found[part] = np.where(np.abs(width) > least, np.sign(width), 0.0)
    ear, eye = found["ear"], found["eye"]
    found["face"] = np.where(ear * eye < 0, 0.0, np.where(ear != 0, ear, eye))
    return found


def _opposed(points: Array, confidence: Array, around: int) -> dict[str, float]:
    """Weigh shoulders against hips, face against shoulders, and faces that are seen; positive if exchanged."""
    ways, found = _orders(points, around), {}
    shoulders, hips, face = ways["shoulder"], ways["hip"], ways["face"]
    twisted = shoulders * hips < 0
    clear = int((shoulders * hips != 0).sum())
    if twisted.sum() > EXCHANGED_SHARE * clear:
        found["shoulders against hips"] = 3.0 * float(twisted.sum()) / clear
    turned = (shoulders * face < 0) & (hips * face <= 0)
    faced = int((shoulders * face != 0).sum())
    if turned.sum() > EXCHANGED_SHARE * faced:
        found["face against body"] = 3.0 * float(turned.sum()) / faced
    towards = _facing(points, confidence)
    votes = (towards * shoulders)[(towards != 0) & (shoulders != 0) & ~twisted]
    if len(votes):
        found["face"] = MOST_EVIDENCE * float(votes.mean())
    return found


def _facing(points: Array, confidence: Array) -> Array:
    """Return (F,): 1 where the face is towards the camera, less than 0 where it is turned away, 0 where unknown.

    There are detectors that put a face on every head and are sure of it, from behind, too: they tell nothing.
    """
    face = [POINT[name] for name in ("nose", "right_eye", "left_eye")]
    head = [*face, POINT["right_ear"], POINT["left_ear"]]
    known = confidence[:, head][~np.isnan(confidence[:, head])]
    there = ~np.isnan(points[..., 0])
    missing = there[:, face].any() and not there[:, face].all()
    if not missing and not (len(known) and float(np.ptp(known)) > 0.05):
        return np.zeros(len(points))
    sure = np.where(there, np.nan_to_num(confidence, nan=1.0), 0.0)
    joints = [k for name, k in POINT.items() if name.endswith(("shoulder", "elbow", "hip", "knee"))]
    body = sure[:, joints].sum(axis=1) / np.maximum(there[:, joints].sum(axis=1), 1)
    nose, right, left = (_of(points, name)[:, 0] for name in ("nose", "right_eye", "left_eye"))
    with np.errstate(invalid="ignore"):
        between = (nose - right) * (nose - left) < 0
    seen = (sure[:, face] >= FACE_SEEN * body[:, None]).all(axis=1) & there[:, face].all(axis=1) & between
    ear = (sure[:, head[3:]] >= FACE_HIDDEN * body[:, None]).any(axis=1) & there[:, head[3:]].any(axis=1)
    away = (sure[:, face] < FACE_HIDDEN * body[:, None]).all(axis=1) & ear
    return np.where(_upright(points), np.where(seen, 1.0, np.where(away, -FACE_AWAY_WEIGHT, 0.0)), 0.0)


def _exchanged(points: Array, parts: tuple[str, ...]) -> Array:
    ends = [POINT[f"{side}_{part}"] for side in SIDES for part in parts]
    exchanged = points.copy()
    exchanged[:, ends] = points[:, ends[len(parts) :] + ends[: len(parts)]]
    return exchanged


def _jumps(points: Array, frame: Ints, parts: tuple[str, ...]) -> Flags:
    """Tell the pictures (F,) in which some parts have left and right exchanged against the pictures around."""
    found = np.zeros(len(frame), dtype=np.bool_)
    d = np.stack([_pair(points, part) for part in parts], axis=1) / _size(points, AROUND)[:, None, None]
    rows = np.flatnonzero(~np.isnan(d).any(axis=(1, 2)))
    if len(rows) < 2:
        return found
    gaps = np.flatnonzero(np.diff(frame[rows]) > np.median(np.diff(frame[rows]))) + 1
    for stretch in np.split(rows, gaps):
        if len(stretch) >= LEAST_PICTURES:
            found[stretch] = _in_stretch(d[stretch].reshape(len(stretch), -1))
    return found


def _in_stretch(d: Array) -> Flags:
    """Tell the exchanged pictures of a stretch without gaps (F, n), in leg lengths."""
    signs, found = _signs(d), np.zeros(len(d), dtype=np.bool_)
    if (signs < 0).sum() * 2 > len(signs):
        signs = -signs
    if float(np.median(_bends(d * signs[:, None]))) > APART**2:
        return found
    for start, end in runs(np.asarray(signs < 0)):
        kept = signs.copy()
        kept[start:end] = 1
        near = slice(max(start - 2, 0), min(end + 2, len(d)))
        worst, rest = (float(_bends(d[near] * one[near, None]).max(initial=0.0)) for one in (kept, signs))
        found[start:end] = worst > JUMP**2 and worst > JUMP_GAIN * rest
    return found


def _bends(d: Array) -> Array:
    return np.asarray((np.diff(d, n=2, axis=0) ** 2).sum(axis=1))


def _signs(d: Array) -> Array:
    """Return the signs (F,) with the least sum of squared second differences."""
    a = np.concatenate([[0.0], (d[1:] * d[:-1]).sum(axis=1)])
    b = np.concatenate([[0.0, 0.0], (d[2:] * d[:-2]).sum(axis=1)])
    ratio, cost = np.array([1.0, -1.0]), np.zeros(2)
    came = np.zeros((len(d), 2), dtype=np.intp)
    for t in range(2, len(d)):
        # The part of |s_t d_t - 2 s_(t-1) d_(t-1) + s_(t-2) d_(t-2)|^2 that the signs change.
        near, far = a[t] * ratio[None] + a[t - 1] * ratio[:, None], b[t] * np.outer(ratio, ratio)
        way = cost[:, None] - 4 * near + 2 * far
        came[t], cost = way.argmin(axis=0), way.min(axis=0)
    state, steps = int(cost.argmin()), np.ones(len(d))
    for t in range(len(d) - 1, 0, -1):
        steps[t], state = ratio[state], int(came[t, state])
    return np.asarray(np.cumprod(steps))
