"""Convert motion and results to subjects of a picture: configurations of robots over time.

In the world frame, z points up and the virtual camera looks along +y.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.body import load_figure, scaled_to
from posekit.cameras import PinholeCamera, View
from posekit.errors import refusal, shown
from posekit.geometry import (
    UP_AXES,
    Array,
    Record,
    coordinate_rotation,
    cross,
    rotation_from_quaternion,
    up_vector,
)
from posekit.motion import Motion
from posekit.recovery import Recovery
from posekit.robots import Robot, load_robot
from posekit.robots.kinematics import frame_places
from posekit.skeleton import JOINT

#: Colours (red, green, blue) of right limbs, left limbs and the trunk, 0 to 255.
COLOURS: Final = {"right": (230, 115, 26), "left": (38, 102, 204), "middle": (140, 148, 158)}

#: Largest number of bodies side by side in a picture.
MOST_BODIES: Final = 12

#: Number of frames of a motion in a picture, if no frames are requested.
USUAL_BODIES: Final = 6

#: Largest number of representatives in a picture.
USUAL_POSTURES: Final = 4

#: Free space between two bodies side by side, metres.
GAP: Final = 0.2

#: Default azimuth of the virtual camera from the front, or from the view's camera, degrees.
USUAL_AZIMUTH: Final = 35.0

#: Pictures per second in an animation of postures without times.
POSTURES_PER_SECOND: Final = 2.0


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Subject(Record):
    """One body over T pictures.

    Parameters
    ----------
    robot : Robot
        Robot to draw.
    q : array (T, nq)
        Configurations; a row with NaN is not drawn.
    R_world_data : array (3, 3)
        Rotation from the frame of the data to the world frame.
    offset : array (3,)
        Displacement in the world frame, metres.
    label : str
        Text under the body.
    """

    robot: Robot
    q: Array
    R_world_data: Array
    offset: Array
    label: str = ""

    @cached_property
    def points(self) -> Array:
        """Positions of the robot's links (T, P, 3), world frame, metres; NaN if the configuration is unknown."""
        return np.asarray(link_places(self.robot, self.q) @ self.R_world_data.T + self.offset)


def link_frames(robot: Robot) -> list[int]:
    """Return the indices of a model's frames that belong to links."""
    import pinocchio as pin

    return [k for k, one in enumerate(robot.model.frames) if one.type == pin.FrameType.BODY]


def link_places(robot: Robot, q: Array) -> Array:
    """Return the origins (N, L, 3) of all links at configurations (N, nq), metres; NaN if a configuration has NaN."""
    places = frame_places(robot.model, q, link_frames(robot))
    places[~np.isfinite(q).all(axis=1)] = np.nan
    return places


def side(name: str) -> str:
    """Return the side of a joint or a link: ``right``, ``left`` or ``middle``."""
    word = name.split("_", 1)[0]
    return word if word in COLOURS else "middle"


def subjects_of(
    source: Motion | Recovery,
    *,
    which: str = "",
    frame: int | tuple[int, int] | None = None,
    urdf: str = "",
    view: View | None = None,
    azimuth: float | None = None,
    moving: bool = False,
) -> tuple[list[Subject], list[str], float | None]:
    """Return the bodies to draw, a caption for each picture, and the pictures per second (None if unknown).

    Parameters
    ----------
    source : Motion or Recovery
    which : str
        Postures of a result: ``answer``, ``path``, ``all``, ``first`` or numbers such as ``0,4``. Default:
        representatives for a picture; the path, or else the answers, for an animation.
    frame : int or (int, int), optional
        Frame, or first and last frame, numbered from 0.
    urdf : str
        URDF, or name of a robot; default: the robot that the motion names.
    view : View, optional
        View of the result; its camera determines the up direction.
    azimuth : float, optional
        Azimuth of the virtual camera, degrees, from the front of a motion or from the camera of a result.
    moving : bool
        Draw one frame per picture; otherwise draw frames and alternative postures side by side in one picture.

    Raises
    ------
    InputError
        If there is nothing to draw.
    """
    turn = coordinate_rotation(2, -np.radians(USUAL_AZIMUTH if azimuth is None else azimuth))
    if isinstance(source, Recovery):
        R = turn @ upright_camera(view)
        single = len(source) == 1 or which in ("", "all") or frame is not None
        if single and not moving and not isinstance(frame, tuple):
            return _alternatives(source, which, frame, R), [""], None
        followed = source.path is not None and len(source.path) > 0
        motion = source.motion(which or ("path" if followed else "answer"))  # type: ignore[arg-type]
        figure = load_figure().scaled(source.lengths)
        q = motion.q if motion.q is not None else figure.configurations(motion.figure_joints).q
        robot: Robot = figure
    else:
        motion = source
        robot, q = configured(motion, urdf)
        R = turn @ facing(robot, q, upright(motion))
    rows = frame_rows(len(motion), frame, motion.source)
    if moving:
        subject = Subject(robot=robot, q=q[rows], R_world_data=R, offset=np.zeros(3))
        rate = motion.rate if motion.in_time else POSTURES_PER_SECOND
        return [subject], [caption(motion, row) for row in rows], rate
    rows = rows[spread(len(rows), USUAL_BODIES if frame is None else MOST_BODIES)]
    labels = [caption(motion, row) if len(motion) > 1 else "" for row in rows]
    return beside(robot, q[rows], R, labels), [""], None


def caption(motion: Motion, row: int) -> str:
    """Return a text with the number and the time of a frame."""
    time = float(motion.time[row])  # type: ignore[index]
    text = f"frame {motion.frame[row]}" + (f", {time:.2f} s" if np.isfinite(time) else "")  # type: ignore[index]
    clips = [name for name in motion.clips if name]
    return f"{motion.clips[motion.clip[row]]}: {text}" if len(clips) > 1 else text  # type: ignore[index]


def configured(motion: Motion, urdf: str = "") -> tuple[Robot, Array]:
    """Return the robot of a motion and its configurations (T, nq); for joint positions, the figure fitted to them."""
    name = urdf or motion.robot
    if motion.q is not None and name and name != "figure":
        robot = load_robot(name)
        q = np.asarray(motion.q)
        if motion.q_names and tuple(motion.q_names) != robot.configuration_names:
            q, _ = robot.q_from_columns(motion.q_names, q)
        return robot, robot.with_mimics(robot.checked(q, motion.source or "q"))
    joints = motion.figure_joints
    if motion.joints is None and motion.q is not None and name == "figure":
        return load_figure(), np.asarray(motion.q)
    if motion.joints is None or not np.isfinite(joints).all(axis=(1, 2)).any():
        remedy = "give --urdf for a robot"
        raise refusal(motion.source or "render", "", "no complete posture", "at least one", remedy)
    figure = scaled_to(joints)
    return figure, figure.configurations(joints, motion.head).q


def upright(motion: Motion) -> Array:
    """Return the rotation (3, 3) from a motion's up axis to z; an unknown up axis is estimated from the trunk."""
    up = motion.up
    if not up and motion.joints is not None:
        joints = motion.figure_joints
        trunk = joints[:, JOINT["neck"]] - joints[:, JOINT["pelvis"]]
        trunk = trunk[np.isfinite(trunk).all(axis=1)]
        if len(trunk):
            up = max(UP_AXES, key=lambda axis: float(trunk.mean(axis=0) @ up_vector(axis)))
    z = up_vector(up or "+z")
    y = np.roll(np.abs(z), 1)
    return np.stack([cross(y, z), y, z])


def upright_camera(view: View | None) -> Array:
    """Return the rotation (3, 3) from the camera frame to a frame with z up and y along the horizontal view.

    A camera of unknown pose is assumed to be level.
    """
    z, ahead = np.array([0.0, -1.0, 0.0]), np.array([0.0, 0.0, 1.0])
    camera = None if view is None else view.camera
    if isinstance(camera, PinholeCamera) and camera.R is not None and camera.up:
        z = camera.R @ up_vector(camera.up)
        ahead = ahead if abs(z[2]) < 0.99 else np.array([0.0, -1.0, 0.0])  # it looks straight down
        ahead = ahead - (ahead @ z) * z
        ahead /= np.linalg.norm(ahead)
    return np.stack([cross(ahead, z), ahead, z])


def facing(robot: Robot, q: Array, R: Array) -> Array:
    """Return R, rotated about z so that the body faces the virtual camera (-y) in the first known frame."""
    known = q[np.isfinite(q).all(axis=1)]
    if not len(known):
        return R
    front = R[:, 0]
    if robot.free_flyer:
        front = R @ rotation_from_quaternion(known[:1, 3:7])[0][:, 0]
    return np.asarray(coordinate_rotation(2, -np.pi / 2 - np.arctan2(front[1], front[0])) @ R)


def frame_rows(count: int, frame: int | tuple[int, int] | None, source: str) -> NDArray[np.intp]:
    """Return the rows of a frame or of a range of frames, both ends included.

    Raises
    ------
    InputError
        If a frame does not exist.
    """
    if frame is None:
        return np.arange(count)
    first, last = frame if isinstance(frame, tuple) else (frame, frame)
    if not 0 <= first <= last < count:
        expected = f"0 to {count - 1}"
        raise refusal(source or "render", "--frame", f"{first} to {last}", expected, "choose others")
    return np.arange(first, last + 1)


def spread(count: int, most: int) -> NDArray[np.intp]:
    """Return up to `most` evenly spaced numbers from 0 to `count` - 1."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round()).astype(np.intp)


def frame_with_postures(recovery: Recovery, frame: int | tuple[int, int] | None) -> int:
    """Return the requested frame, else the first frame that has a posture.

    Raises
    ------
    InputError
        If no frame has a posture, or if the requested frame has none.
    """
    counts, source = (
        np.bincount(recovery.survivors.frame, minlength=len(recovery)),
        recovery.source or "result",
    )
    recovery.refuse_empty()
    number = int(np.flatnonzero(counts)[0])
    if frame is not None:
        number = int(frame_rows(len(recovery), frame, recovery.source)[0])
    if not counts[number]:
        raise refusal(source, f"frame {number}", "no posture", "another frame", "choose another")
    return number


def chosen_rows(recovery: Recovery, number: int, which: str) -> NDArray[np.intp]:
    """Return the rows of the survivors of one frame that `which` selects; by default the representatives.

    Raises
    ------
    InputError
        If `which` names a survivor that the frame does not have.
    """
    rows = np.arange(recovery.rows(number).start, recovery.rows(number).stop)
    if which == "":
        return np.asarray(recovery.answer.representatives[number][:USUAL_POSTURES], dtype=np.intp)
    if which in ("answer", "path"):
        return np.asarray(recovery.answer.survivor)[[number]]
    if which in ("all", "first"):
        return rows[: MOST_BODIES if which == "all" else 1]
    numbers = [int(part) for part in which.split(",") if part.strip().isdigit()]
    if not numbers or max(numbers) >= len(rows):
        expected = f"answer, path, all, first, or numbers from 0 to {len(rows) - 1}"
        raise refusal("render", "--posture", shown(which), expected, "choose others")
    return rows[numbers[:MOST_BODIES]]


def _alternatives(
    recovery: Recovery, which: str, frame: int | tuple[int, int] | None, R: Array
) -> list[Subject]:
    """Return postures of one frame of a result, side by side."""
    number = frame_with_postures(recovery, frame)
    rows, start = chosen_rows(recovery, number, which), recovery.rows(number).start
    survivors = recovery.survivors
    labels = [
        f"posture {row - start}" + (f", {p:.0%}" if np.isfinite(p) else "")
        for row, p in zip(rows, np.asarray(survivors.probability)[rows], strict=True)
    ]
    return beside(load_figure().scaled(recovery.lengths), survivors.q[rows], R, labels)


def beside(robot: Robot, q: Array, R: Array, labels: Sequence[str]) -> list[Subject]:
    """Move configurations (N, nq) side by side along the x axis; their heights do not change."""
    made = [
        Subject(robot=robot, q=row[None], R_world_data=R, offset=np.zeros(3), label=label)
        for row, label in zip(q, labels, strict=True)
        if np.isfinite(row).all()
    ]
    if not made:
        raise refusal("render", "", "no complete posture", "at least one", "choose another frame")
    lows, highs = (np.array([getattr(one.points[0], end)(axis=0) for one in made]) for end in ("min", "max"))
    step = float((highs - lows)[:, 0].max()) + GAP
    for k, (one, low, high) in enumerate(zip(made, lows, highs, strict=True)):
        middle = (low + high) / 2
        place = np.array([step * (k - (len(made) - 1) / 2) - middle[0], -middle[1], 0.0])
        made[k] = Subject(robot=robot, q=one.q, R_world_data=R, offset=place, label=one.label)
    return made


def as_motion(source: Any) -> Any:
    """Return a view's true joints, or a robot's neutral configuration, as a motion; return other objects unchanged."""
    if isinstance(source, Robot):
        return Motion(q=source.neutral[None], q_names=source.configuration_names, robot=source.source)
    if isinstance(source, View):
        return Motion(joints=source.truth, time=source.time, up="-y", source=source.source)
    return source
