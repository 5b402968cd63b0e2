"""What moves: postures over time in a world with an up, as a result holds them, and the figure's angles of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.answers.wording import percent, words_of_paths
from posekit.body import Figure, with_head
from posekit.display.plural import plural
from posekit.errors import InputError
from posekit.following import bridge
from posekit.formats.motion import Motion, SurvivorTable, guess_up
from posekit.formats.motion.motion_axes import up_rotation
from posekit.formats.own import CameraModel, OpenCVModel, Result, View
from posekit.formats.own.frame_answer import likeliest_order
from posekit.formats.own.survivor_columns import SURVIVOR_COLUMNS
from posekit.geometry import Array
from posekit.recovery.ranked import probabilities
from posekit.recovery.recovered import recovered_with
from posekit.skeleton import JOINTS, POINTS

EVEN_STEP_SHARE: Final = 0.25
"""Share of a step by which the time of a picture may be off its place."""

MOST_GAPS: Final = 4
"""Times as many frames as there are that gaps may make."""

ASSUMED_RATE: Final = 30.0
"""Frames a second of postures without times."""

LIKELIEST_WORDS: Final = ("", "likeliest", "first")
"""Words for the survivor of a frame that has the greatest probability; the last one is what it was called."""

CAMERA_UP: Final = "-y"
"""What is up in the camera frame of a camera that is held level."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PostureSequence:
    """Postures over time, N rows.

    Parameters
    ----------
    points : array (N, 19, 3)
        Joints and head points, metres, in a world where `up` is up; NaN where not known.
    time : array (N,)
        Seconds.
    frame, survivor : int array (N,)
        The frame of each row, and which of its survivors it is.
    up : str
        ``+x`` … ``-z``.
    figure : Figure
        The person's.
    says : tuple of str
        What was done, a line each.
    values : mapping
        More numbers (N,) by name; of a result also ``rank``, 1 for the survivor of a frame whose lengths fit best.
    branches : tuple of str
        The branch code of each row; empty where there is none.
    lost : mapping of int to float
        The frames that have no posture, and are left out, with their times.
    pictures : tuple of str
        By number of a frame the picture that it was seen in; empty where nobody says.
    """

    points: Array
    time: Array
    frame: NDArray[np.intp]
    survivor: NDArray[np.intp]
    up: str
    figure: Figure
    says: tuple[str, ...] = ()
    values: dict[str, Array]
    branches: tuple[str, ...] = ()
    lost: Mapping[int, float] = field(default_factory=dict)
    pictures: tuple[str, ...] = ()

    def __len__(self) -> int:
        """Count the rows."""
        return len(self.points)

    def take(self, rows: NDArray[np.intp]) -> PostureSequence:
        """Take some rows."""
        return replace(
            self,
            points=self.points[rows],
            time=self.time[rows],
            frame=self.frame[rows],
            survivor=self.survivor[rows],
            values={name: values[rows] for name, values in self.values.items()},
            branches=tuple(self.branches[k] for k in rows.tolist()) if self.branches else (),
        )

    def turned(self, up: str) -> Array:
        """Return the points with another axis up (N, 19, 3)."""
        return self.points @ up_rotation(self.up, up).T

    def motion(self, source: str) -> Motion:
        """Return the points as a motion: one row a frame."""
        known = np.flatnonzero(np.isfinite(self.points[..., 0]).any(axis=0))
        names = tuple(POINTS[k] for k in known)
        return Motion(
            names=names,
            points=self.points[:, known],
            time=self.time,
            rate=self.rate,
            up=self.up,
            source=source,
            pictures=self._pictures(),
        )

    def _pictures(self) -> tuple[str, ...]:
        """Return the picture of each row."""
        return tuple(self.pictures[k] for k in self.frame.tolist()) if self.pictures else ()

    @property
    def rate(self) -> float:
        """Frames a second."""
        steps = np.diff(np.unique(self.time))
        return float(1 / np.median(steps)) if len(steps) else ASSUMED_RATE

    def configurations(self, up: str = "+z") -> Array:
        """Return the figure's configurations (N, nq), `up` up."""
        return self.figure.inverse_kinematics(self.turned(up))

    def furthest(self, q: Array, up: str) -> tuple[float, str, int]:
        """Return how far a joint of configurations is from its point at most, metres; which joint, in which frame."""
        placed = np.flatnonzero(np.isfinite(q[:, :7]).all(axis=1))
        if not len(placed):
            return 0.0, JOINTS[0], 0
        joints = self.figure.forward_kinematics(q[placed])[:, : len(JOINTS)]
        gap = np.nan_to_num(np.linalg.norm(joints - self.turned(up)[placed, : len(JOINTS)], axis=-1))
        row, joint = np.unravel_index(gap.argmax(), gap.shape)
        return float(gap.max()), JOINTS[joint], int(self.frame[placed[row]])

    def table(self) -> SurvivorTable:
        """Return all rows as a table of survivors."""
        return SurvivorTable(
            frame=self.frame,
            time=self.time,
            survivor=self.survivor,
            joints=self.points[:, :14],
            values=self.values,
            branches=self.branches,
            pictures=self._pictures(),
        )


def sequence_of_result(
    result: Result, *, posture: str = "", view: View | None = None, up: str = ""
) -> PostureSequence:
    """Make a sequence of a result.

    Parameters
    ----------
    result : Result
        What was recovered.
    posture : str
        ``likeliest``, the number of a survivor from 0, ``path``, or ``all``; if empty the path where the frames were
        followed, else the likeliest.
    view : View, optional
        What it was recovered from: its camera's place in the world turns and moves the postures there. By default the
        camera that the result holds does, unless `up` is given.
    up : str
        The axis that points up in the camera's frame, or in its world where there is a view.

    Raises
    ------
    InputError
        Where no frame has a posture, or not the one that is asked for.
    """
    figure, _ = recovered_with(result)
    if posture == "path" or (not posture and result.paths is not None):
        return _of_path(result, figure, view, up)
    rows: list[tuple[int, int]] = []
    ranks: list[int] = []
    sure: list[float] = []
    lost: dict[int, float] = {}
    probability = probabilities(result, figure.lengths)
    for k in range(len(result.frames)):
        order = np.argsort(-probability[k], kind="stable")
        answer = result.frames[k].answer
        if not len(order):
            lost[k] = result.frames[k].time
            continue
        if posture == "all":
            chosen = order.tolist()
        else:
            first = likeliest_order(probability[k], answer)[0]
            chosen = [int(first) if posture in LIKELIEST_WORDS else _number(posture, len(order), k)]
            sure.append(probability[k][first] if answer is None else answer.probability[0])
        rows += [(k, row) for row in chosen]
        ranks += (np.argsort(order)[chosen] + 1).tolist()
    if not rows:
        raise InputError("result: no frame has a posture, and nothing is to be converted; recover it again")
    joints = np.stack([result.frames[k].joints[row] for k, row in rows])
    points = with_head(joints)
    says = (
        [f"{len(lost)} of {plural(len(result.frames), 'frame')} without a posture are left out"]
        if lost
        else []
    )
    if posture in LIKELIEST_WORDS and max(map(len, probability)) > 1:
        single = f"the likeliest posture of each frame, {percent(float(np.median(sure)))} sure (median)"
        jumps = result.paths is None and len(result.frames) > 1
        says.append(f"{single}; all: --posture all{'; without jumps: recover --follow 1' if jumps else ''}")
    points, up = _placed(
        points, result.camera if view is None else view.camera, up, says, told=view is not None
    )
    values = {
        "probability": np.array([probability[k][row] for k, row in rows]),
        "rank": np.array(ranks, dtype=np.float64),
    }
    for name, column in SURVIVOR_COLUMNS.items():
        of_frame = [getattr(frame, name) for frame in result.frames] if column.in_motion else []
        if column.by_check:
            margins = {
                f"{column.flat_prefix}_{check}": np.array([of_frame[k][check][row] for k, row in rows])
                for check in of_frame[0]
            }
            values |= margins
        elif of_frame:
            values[column.key] = np.array([of_frame[k][row] for k, row in rows])
    return PostureSequence(
        points=points,
        time=np.array([result.frames[k].time for k, _ in rows]),
        frame=np.array([k for k, _ in rows]),
        survivor=np.array([row for _, row in rows]),
        up=up,
        figure=figure,
        says=tuple(says),
        values=values,
        branches=tuple(result.frames[k].branches[row] for k, row in rows),
        lost=lost,
        pictures=result.pictures,
    )


def _of_path(result: Result, figure: Figure, view: View | None, stated: str) -> PostureSequence:
    """Take the first path through a result, its depths smoothed where the camera is known."""
    paths = result.paths
    if paths is None:
        raise InputError("--posture path: the result was not followed; recover it with --follow 2")
    smoothed = paths.smoothed[0]
    joints = np.where(np.isnan(smoothed), paths.joints[0], smoothed)
    known = np.flatnonzero(np.isfinite(joints).any(axis=(1, 2)))
    time, place = _evenly(np.array([result.frames[k].time for k in known.tolist()]))
    filled = np.full((len(time), len(JOINTS), 3), np.nan)
    filled[place] = joints[known]
    points = with_head(bridge(time, filled))
    survivor = np.full(len(time), -1, dtype=np.intp)
    survivor[place] = paths.survivor[0, known]
    interpolated = np.full(len(time), float(len(JOINTS)))
    interpolated[place] = paths.interpolated[0, known].sum(axis=1)
    count = int((survivor < 0).sum())
    bridged = f", {count} of {plural(len(time), 'frame')} bridged" if count else ""
    others = len(paths.share) - 1
    sure = (
        f"with {percent(paths.share[0])} of the probability of {plural(others + 1, 'path')}"
        if others
        else words_of_paths(paths)
    )
    says = [f"the likeliest path, {sure}{bridged}"]
    points, up = _placed(
        points, result.camera if view is None else view.camera, stated, says, told=view is not None
    )
    codes, pictures = [""] * len(time), [""] * len(time)
    for row, k in zip(place.tolist(), known.tolist(), strict=True):
        codes[row] = result.frames[k].branches[survivor[row]] if survivor[row] >= 0 else ""
        pictures[row] = result.pictures[k] if result.pictures else ""
    return PostureSequence(
        points=points,
        time=time,
        frame=np.arange(len(time)),
        survivor=survivor,
        up=up,
        figure=figure,
        says=tuple(says),
        values={"interpolated": interpolated},
        branches=tuple(codes),
        lost={k: result.frames[k].time for k in np.setdiff1d(np.arange(len(result.frames)), known).tolist()}
        if len(time) == len(known)
        else {},
        pictures=tuple(pictures) if result.pictures else (),
    )


def _evenly(time: Array) -> tuple[Array, NDArray[np.intp]]:
    """Put in times of pictures that were left out, where the others are whole steps apart; say where these are."""
    steps = np.diff(time)
    step = float(np.median(steps)) if len(steps) else 1.0
    places = np.concatenate([[0.0], np.cumsum(np.round(steps / step))])
    whole = np.abs(time - time[:1] - places * step) <= EVEN_STEP_SHARE * step
    if not whole.all() or places[-1] > MOST_GAPS * len(time):
        return time, np.arange(len(time))
    place = places.astype(np.intp)
    every = np.arange(place[-1] + 1)
    return np.interp(every, place, time), place


def _placed(
    points: Array, camera: CameraModel | None, stated: str, says: list[str], *, told: bool
) -> tuple[Array, str]:
    """Put points of a result into its camera's world, if that is known; say where they are and what is up.

    Where a view is `told`, its camera must have a place in a world. Else an axis that is stated is the camera's.
    """
    if told and camera is not None:
        points = in_world(points, camera)
        up = stated or _up_of(camera) or guessed_up(points[:, :14], "the camera's world")
    elif not stated and isinstance(camera, OpenCVModel) and camera.R is not None:
        turned = replace(camera, t=np.zeros(3)) if camera.t is None else camera
        moved = in_world(points, turned)
        try:
            points, up = moved, camera.up or guess_up(moved[:, :14])
        except InputError:
            up = ""
    else:
        up = ""
    if up:
        says.append(f"in the camera's world, where {up} is up")
    else:
        up = stated or CAMERA_UP
        level = f"{up} up" if stated else "as if it were held level"
        says.append(f"in the camera's frame, {level}; with --view, in its world")
    return points, up


def _up_of(camera: CameraModel) -> str:
    return camera.up if isinstance(camera, OpenCVModel) and camera.R is not None else ""


def guessed_up(joints: Array, source: str) -> str:
    """Guess which axis points up, or name the option that says it."""
    try:
        return guess_up(joints, source)
    except InputError as error:
        raise InputError(f"{error}: --input-up") from None


def _number(posture: str, count: int, frame: int) -> int:
    if not posture.isdecimal() or int(posture) >= count:
        raise InputError(
            f"--posture: {posture!r}; expected likeliest, path, all, or a number from 0 to {count - 1}, "
            f"as frame {frame} has"
        )
    return int(posture)


def in_world(points: Array, model: CameraModel) -> Array:
    """Return points of a camera's frame in its world, or refuse a camera that has no place in one."""
    if not isinstance(model, OpenCVModel) or model.R is None or model.t is None:
        raise InputError("--view: its camera has no place in a world; expected R and t; leave the option out")
    return np.asarray((points - model.t) @ model.R)
