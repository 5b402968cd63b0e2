"""Joint angles through the frames of a recording: the likeliest, what the survivors leave open, and the truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from posekit.body import Figure, with_head
from posekit.body.steady_angles import angles_near, steady_angles
from posekit.errors import ViewerError
from posekit.geometry import Array
from posekit.safe_io import shown as spelled
from posekit.skeleton import DOFS, JOINTS
from posekit.viewer.scene.drawn_subject import Shown

HALF_PROBABILITY: Final = (0.25, 0.75)
"""Between these quantiles lies the inner band."""


@dataclass(frozen=True, kw_only=True, eq=False)
class AngleTrack:
    """One joint angle over time, degrees; NaN where it is not known.

    Parameters
    ----------
    name : str
        As ``right_knee.flexion``.
    time : array (F,)
        Seconds, or the frames' numbers where their times are not known.
    value : array (F,)
        Of the posture that is drawn: the likeliest, or that of a path.
    least, most : array (F,)
        Of all survivors.
    lower, upper : array (F,)
        Quartiles of the survivors by their probability; NaN where nothing says how probable they are.
    truth : array (F,)
        Of the true posture.
    limits : (float, float), optional
        What the angle was judged by.
    """

    name: str
    time: Array
    value: Array
    least: Array
    most: Array
    lower: Array
    upper: Array
    truth: Array
    limits: tuple[float, float] | None = None


def angle_names() -> tuple[str, ...]:
    """Return the names of all angles in the order in which they are drawn: each beside that of the other side."""
    sided = [name for name in DOFS if name.startswith("right_")]
    both = [one for name in sided for one in (name, name.replace("right_", "left_", 1))]
    return tuple(name for name in DOFS if name not in both) + tuple(both)


def chosen_angles(text: str) -> tuple[str, ...]:
    """Read a list of angles: ``all``, a joint of one side or both, or a single one, as ``knee,left_elbow.flexion``.

    Raises
    ------
    ViewerError
        Where a word is no joint's and no angle's.
    """
    names = angle_names()
    if text == "all":
        return names
    found: set[str] = set()
    for word in (one.strip() for one in text.split(",")):
        said = [
            name
            for name in names
            if word
            in (name, name.split(".")[0], name.partition("_")[2], name.partition("_")[2].split(".")[0])
        ]
        if not said:
            joints = ", ".join(dict.fromkeys(name.split(".")[0].split("_")[-1] for name in names))
            raise ViewerError(
                f"--angles: {spelled(word)}; expected all, or some of {joints}, as right_knee or knee.flexion"
            )
        found.update(said)
    return tuple(name for name in names if name in found)


def angle_tracks(
    frames: Sequence[Shown],
    drawn: Sequence[Shown],
    figure: Figure,
    names: Sequence[str],
    *,
    limits: Mapping[str, tuple[float, float]],
    truth: Array | None = None,
) -> list[AngleTrack]:
    """Measure angles frame by frame; those of which nothing is known are left out.

    Parameters
    ----------
    frames : sequence of F Shown
        All survivors of each frame.
    drawn : sequence of F Shown
        The posture of each frame that the line goes through, first; none where there is none.
    figure : Figure
        Whose angles.
    names : sequence of str
        Which.
    limits : mapping of str to (float, float)
        Degrees, by name.
    truth : array (F, 14, 3), optional
        The true joints, in any frame, metres.
    """
    time = np.array([frame.time for frame in frames])
    if not (np.isfinite(time).all() and (np.diff(time) > 0).all() and len(time) > 1):
        time = np.arange(len(frames), dtype=np.float64)
    ends = np.radians([limits.get(name, (-180.0, 180.0)) for name in DOFS]).T
    line = np.stack([rows[0] if len(rows) else np.full(len(DOFS), np.nan) for rows in _angles(drawn, figure)])
    line = steady_angles(line, *ends)
    every = [angles_near(rows, own) for rows, own in zip(_angles(frames, figure), line, strict=True)]
    for row, rows in zip(line, every, strict=True):  # where no survivor's head is known, no path's is
        row[np.isnan(rows).all(axis=0)] = np.nan
    true = np.full((len(frames), len(DOFS)), np.nan)
    if truth is not None:
        found = steady_angles(_radians(figure, with_head(truth), None), *ends)
        true = np.stack([angles_near(one[None], own)[0] for one, own in zip(found, line, strict=True)])
    line, true, every = np.degrees(line), np.degrees(true), [np.degrees(rows) for rows in every]
    spread = np.stack(
        [_spread(rows, frame.probability) for rows, frame in zip(every, frames, strict=True)], axis=1
    )
    tracks = []
    for name in names:
        k = DOFS.index(name)
        if not (np.isfinite(line[:, k]).any() or np.isfinite(spread[..., k]).any()):
            continue
        least, most, lower, upper = spread[..., k]
        tracks.append(
            AngleTrack(
                name=name,
                time=time,
                value=line[:, k],
                least=least,
                most=most,
                lower=lower,
                upper=upper,
                truth=true[:, k],
                limits=limits.get(name),
            )
        )
    return tracks


def _angles(frames: Sequence[Shown], figure: Figure) -> list[Array]:
    """Return the angles (N, 22) of each frame's postures, radians; all that are to be calculated are so at once."""
    found: list[Array | None] = [
        None if frame.q is None else _radians(figure, frame.points, frame.q) for frame in frames
    ]
    left = [k for k, one in enumerate(found) if one is None]
    if left:
        counts = np.cumsum([len(frames[k]) for k in left])[:-1]
        together = _radians(figure, np.concatenate([frames[k].points for k in left]), None)
        for k, one in zip(left, np.split(together, counts), strict=True):
            found[k] = one
    return [one for one in found if one is not None]


def _radians(figure: Figure, points: Array, q: Array | None) -> Array:
    """Return the angles (N, 22) of postures in the order of `posekit.skeleton.DOFS`, radians."""
    if q is None:
        q = figure.inverse_kinematics(points) if len(points) else np.empty((0, figure.model.nq))
        # Without the head, the neck's angles are not known; inverse kinematics says 0.
        headless = np.isnan(points[:, len(JOINTS) :]).any(axis=(1, 2))
    else:
        headless = np.zeros(len(q), dtype=bool)
    angles: Array = q[:, figure.angle_index]
    neck = [k for k, name in enumerate(DOFS) if name.startswith("neck.")]
    headless = headless | (angles[:, neck] == 0).all(
        axis=1
    )  # as a result writes it whose view showed no head
    angles[np.ix_(headless, neck)] = np.nan
    return angles


def _spread(angles: Array, probability: Array | None) -> Array:
    """Return the least, the most and the quartiles (4, 22) of postures' angles (N, 22)."""
    found = np.full((4, len(DOFS)), np.nan)
    if not len(angles):
        return found
    known = np.isfinite(angles)
    found[0] = np.where(known.any(axis=0), np.where(known, angles, np.inf).min(axis=0), np.nan)
    found[1] = np.where(known.any(axis=0), np.where(known, angles, -np.inf).max(axis=0), np.nan)
    if probability is not None:
        order = np.argsort(angles, axis=0)  # what is not known is last
        held = np.cumsum(np.where(np.take_along_axis(known, order, axis=0), probability[order], 0.0), axis=0)
        for row, share in enumerate(HALF_PROBABILITY):
            at = (held >= share * held[-1]).argmax(axis=0)
            found[2 + row] = np.take_along_axis(angles, np.take_along_axis(order, at[None], axis=0), axis=0)[
                0
            ]
    return found
