r"""Left and right exchanged by a detector: in single pictures, or in all of them.

In single pictures an exchange makes the difference d of right and left jump: along a film each :math:`d_t` gets the
sign :math:`s_t` that agrees with :math:`2 s_{t-1} d_{t-1} - s_{t-2} d_{t-2}`. An exchange in all pictures shows
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
#: Ratio of the squared second differences before and after an exchange back, from which an exchange is suspected.
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
    found, body, around = [], points.copy(), AROUND if detections.film else 0
    if detections.film:
        jumps = {parts: _jumps(points, frame, parts) for parts in (ARM, LEG)}
        orders = _orders(points, around)
        # Arms or legs alone, exchanged, would be opposite to the other pair.
        alike = orders["shoulder"] * orders["hip"] * (jumps[ARM] ^ jumps[LEG])
        for parts, jumped in jumps.items():
            for start, end in runs(jumped.copy()):
                jumped[start:end] = alike[start:end].sum() <= 0
            right, left = ([POINT[f"{side}_{part}"] for part in parts] for side in SIDES)
            for here, there in zip(right + left, left + right, strict=True):
                body[jumped, here] = points[jumped, there]
        names = [
            detections.picture(k).removeprefix("picture ") for k in frame[jumps[ARM] | jumps[LEG]].tolist()
        ]
        if names:
            listed = ", ".join(names[:5]) + (", …" if len(names) > 5 else "")
            pictures = "1 picture" if len(names) == 1 else f"{len(names)} pictures"
            found.append(f"{detections.source}: left and right jump in {pictures}: {listed}")
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


def _length(vectors: Array) -> Array:
    return np.asarray(np.linalg.norm(vectors, axis=-1))


def _size(points: Array, around: int) -> Array:
    """Return the person's leg length in each picture (F,): the largest of both legs and of the trunk's share."""
    each = LEG_OVER_TRUNK * _length(_middle(points, "hip") - _middle(points, "shoulder"))
    for side in SIDES:
        hip, knee, ankle = (_of(points, f"{side}_{part}") for part in LEG)
        each = np.fmax(each, _length(knee - hip) + _length(ankle - knee))
    windows = np.lib.stride_tricks.sliding_window_view(
        np.pad(each, around, constant_values=np.nan), 2 * around + 1
    )
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
    up = _middle(points, "shoulder") - _middle(points, "hip")
    with np.errstate(invalid="ignore"):
        upright = -up[:, 1] > np.abs(up[:, 0])  # within 45 degrees
    return np.where(upright, np.where(seen, 1.0, np.where(away, -FACE_AWAY_WEIGHT, 0.0)), 0.0)


def _jumps(points: Array, frame: Ints, parts: tuple[str, ...]) -> Flags:
    """Tell the pictures (F,) in which some parts have left and right exchanged against the pictures around."""
    found = np.zeros(len(frame), dtype=np.bool_)
    d = np.concatenate([_pair(points, part) for part in parts], axis=1) / _size(points, AROUND)[:, None]
    rows = np.flatnonzero(~np.isnan(d).any(axis=1))
    steps = np.diff(frame[rows])
    gaps = np.flatnonzero(steps > np.median(steps) if len(steps) else steps) + 1
    for stretch in np.split(rows, gaps):
        if len(stretch) < LEAST_PICTURES:
            continue
        own = d[stretch]
        signs = _signs(own)
        signs *= np.where(signs.sum() < 0, -1, 1)
        if np.median(_bends(own * signs[:, None])) > APART**2:
            continue
        for start, end in runs(np.asarray(signs < 0)):
            labelled = signs.copy()
            labelled[start:end] = 1
            near = slice(max(start - 2, 0), end + 2)
            worst, rest = (_bends((own * one[:, None])[near]).max(initial=0.0) for one in (labelled, signs))
            found[stretch[start:end]] = worst > JUMP**2 and worst > JUMP_GAIN * rest
    return found


def _bends(d: Array) -> Array:
    return np.asarray((np.diff(d, n=2, axis=0) ** 2).sum(axis=1))


def _signs(d: Array) -> Array:
    """Return the signs (F,) with which differences (F, n) go on as the two before them lead to expect."""
    signs = np.ones(len(d))
    signs[1] = np.where(d[1] @ d[0] < 0, -1, 1)
    for t in range(2, len(d)):
        expected = 2 * signs[t - 1] * d[t - 1] - signs[t - 2] * d[t - 2]
        signs[t] = np.where(d[t] @ expected < 0, -1, 1)
    return signs
