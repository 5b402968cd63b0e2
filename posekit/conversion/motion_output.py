"""Postures that move, written: as points, as a body's angles, as tables of survivors, as postures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from posekit.body import Figure
from posekit.body.steady_angles import steady_angles
from posekit.conversion.gaps import fill_gaps
from posekit.display.plural import plural
from posekit.errors import InputError
from posekit.formats import own as files
from posekit.formats.motion import (
    Motion,
    guess_up,
    motion_format,
    motion_formats,
    postures_of,
    with_up,
    write_configurations,
    write_motion,
    write_survivors,
)
from posekit.formats.motion.bvh_tree import filled, nearest_known
from posekit.formats.motion.glb import MAX_BODIES, write_postures_glb
from posekit.formats.motion.urdf_folder import write_urdf_folder
from posekit.formats.own import Postures
from posekit.formats.skeleton_maps import load_skeleton_map
from posekit.geometry import Array
from posekit.recovery.result_sequence import PostureSequence
from posekit.safe_io import refusal
from posekit.safe_io.extras import extra
from posekit.safe_io.writing import check_target

SAID_OFF_METRES: Final = 1e-3
"""A joint of the figure that is further from its posture's is named."""

CUSTOMARY_UP: Final = {"trc": "+y", "c3d": "+z", "mot": "+z", "urdf": "+z", "bvh": "+y", "glb": "+y"}
"""The axis that points up in a format's files by custom; in others it stays as it is."""

ALWAYS_Y_UP: Final = ("trc", "bvh", "glb")
"""Formats in whose files y points up, and nothing else."""

EVENLY_TIMED: Final = ("bvh", "c3d")
"""Formats that have one time from frame to frame: what is missing between two frames is put in."""

TABLE_FORMATS: Final = ("csv", "npz", "parquet")
"""Formats that carry all survivors of a frame, and motion in several clips."""


@dataclass(frozen=True, kw_only=True)
class MotionOutput:
    """What is to be written.

    Parameters
    ----------
    path : Path
        The file that is written.
    to : str
        ``postures``, or a format of motion.
    up : str
        The axis that shall point up; by custom if empty.
    gaps : str
        How frames without a posture and unseen joints are filled; by what the format can hold if empty.

    Raises
    ------
    InputError
        Where the format has an axis of its own, or the file cannot be written: before anything is read.
    """

    path: Path
    to: str
    up: str = ""
    gaps: str = ""

    def __post_init__(self) -> None:
        if self.path.suffix:
            check_target(self.path)
        if self.to != "postures" and (needed := motion_format(self.to).written_by):
            extra(*needed)
        if self.to in ALWAYS_Y_UP and self.up not in ("", "+y"):
            raise refusal("--up", "", self.up, f"+y, as in every file of {self.to}", "leave it out")

    def up_of(self, up: str) -> str:
        """Return the axis that points up in the file, where it is `up` in what is written."""
        return self.up or CUSTOMARY_UP.get(self.to, "") or up


def by_suffix(path: Path) -> str:
    """Tell the format by the end of the name: a name without an end is a folder's.

    Raises
    ------
    InputError
        Where there is no such format.
    """
    suffix = path.suffix.lower()
    if suffix == ".json":
        return "postures"
    named = [one.name for one in motion_formats().values() if one.writes and suffix in one.suffixes]
    if not suffix:
        named = [one.name for one in motion_formats().values() if not one.suffixes]
    if len(named) != 1:
        known = ", ".join(end for one in motion_formats().values() if one.writes for end in one.suffixes)
        expected = f"one of {known}, .json; or none, for a folder with the person's URDF"
        raise refusal(path, "", f"a name that ends in {suffix}", expected, "name it so, or say --to")
    return named[0]


def carries_points(to: str) -> bool:
    """Tell whether a format has any points, and not only a body's joints or angles."""
    return to != "postures" and motion_format(to).write_points is not None


def write_points(output: MotionOutput, motion: Motion, skeleton: str = "") -> list[str]:
    """Write points, all that there are.

    Which way is up, where the file does not say it, is guessed from a body's points, if it has some.

    Raises
    ------
    InputError
        Where it cannot be written, or `up` is asked for and what is up now is not known.
    """
    says = []
    if not motion.up and output.up_of(""):
        try:
            found = postures_of(motion, load_skeleton_map(skeleton) if skeleton else None)
            motion = replace(motion, up=guess_up(found.joints, motion.source))
            says.append(f"{motion.up} is taken as up, along which heads are above ankles")
        except InputError as error:
            if output.up:
                raise InputError(f"{error}; or say which axis is up with --input-up") from None
    up = output.up_of(motion.up)
    turned = with_up(motion, up) if up else motion
    write_motion(output.path, turned, output.to)
    axis = f"{turned.up} up" if turned.up else "which way is up is not known, and axes stay as they are"
    clips = f" in {plural(len(motion.clips), 'clip')}" if len(motion.clips) > 1 else ""
    return [
        *says,
        f"{plural(len(motion), 'frame')}{clips} of {plural(len(motion.names), 'point')}, {axis}",
    ]


def write_moving(output: MotionOutput, found: PostureSequence, *, every: bool = False) -> list[str]:
    """Write postures: one a frame, or all survivors of a result where `every`.

    Raises
    ------
    InputError
        Where the format cannot carry them, or the file cannot be written.
    """
    if every:
        return _write_every(output, found)
    if output.to == "postures":
        return _write_postures(output, fill_gaps(found, output.gaps or "leave-out"))
    found = fill_gaps(found, output.gaps or ("interpolate" if output.to in EVENLY_TIMED else "leave-out"))
    if carries_points(output.to):
        return [*found.says, *write_points(output, found.motion(str(output.path)))]
    # In BVH and GLB the writers turn z to y.
    up = "+z" if output.to in ALWAYS_Y_UP else output.up_of(found.up)
    q = found.configurations(up)
    off, joint, frame = found.furthest(q, up)
    where = f" (furthest: {joint}, frame {frame})" if off > SAID_OFF_METRES else ""
    q, says = _without_gaps(output, found.figure, q)
    if output.to == "mot":  # read by people, as curves
        angles, limits = found.figure.angle_index, found.figure.limits
        q[:, angles] = steady_angles(q[:, angles], limits.lower, limits.upper)
    if output.to == "urdf":
        write_urdf_folder(output.path, found.figure, q, found.time, up=up)
    else:
        write_configurations(output.path, found.figure, q, found.time, output.to)
    return [
        *found.says,
        *says,
        f"{plural(len(q), 'frame')} of joint angles, {output.up_of(up)} up; the figure's joints are "
        f"within {off * 100:.2g} cm of the postures'{where}",
    ]


def _without_gaps(output: MotionOutput, figure: Figure, q: Array) -> tuple[Array, list[str]]:
    """Hold what is not known of q (T, nq) where the format marks nothing as missing, and say in how many frames."""
    lacking = np.isnan(q).any(axis=1)
    placed = np.flatnonzero(np.isfinite(q[:, :7]).all(axis=1))
    if output.to not in ALWAYS_Y_UP or not lacking.any() or not len(placed):
        return q, []
    q = q.copy()
    q[:, :7] = q[placed[nearest_known(placed, len(q))], :7]
    said = (
        f"what is not known in {lacking.sum()} of {plural(len(q), 'frame')} is held as in the nearest frame that "
        "knows it"
    )
    return filled(output.path, figure, q, "hold"), [said]


def _write_postures(output: MotionOutput, found: PostureSequence) -> list[str]:
    points = found.turned(output.up) if output.up else found.points
    head = points[:, 14:] if np.isfinite(points[:, 14:]).any() else None
    files.write_postures(output.path, Postures(joints=points[:, :14], head=head))
    return [*found.says, f"{plural(len(points), 'posture')}, {output.up or found.up} up"]


def _write_every(output: MotionOutput, found: PostureSequence) -> list[str]:
    writer: Callable[[MotionOutput, PostureSequence], list[str]] | None = (
        _write_table if output.to in TABLE_FORMATS else _write_bodies if output.to == "glb" else None
    )
    if writer is None:
        raise InputError(
            f"--posture: all, but {output.to} carries one posture a frame; expected {', '.join(TABLE_FORMATS)} or glb; "
            "choose one of them, or --posture likeliest"
        )
    return writer(output, found)


def _write_table(output: MotionOutput, found: PostureSequence) -> list[str]:
    up = output.up or found.up
    write_survivors(output.path, replace(found, points=found.turned(up)).table())
    return [
        *found.says,
        f"{plural(len(found), 'survivor')} of {plural(len(np.unique(found.frame)), 'frame')}, {up} up",
    ]


def _write_bodies(output: MotionOutput, found: PostureSequence) -> list[str]:
    """Write the survivors of the first frame that has any, the best where they are too many."""
    first = np.flatnonzero(found.frame == found.frame[0])
    kept = first[np.sort(np.argsort(found.values["rank"][first], kind="stable")[:MAX_BODIES])]
    q = found.take(kept).configurations()
    names = [f"survivor_{k}" for k in found.survivor[kept].tolist()]
    write_postures_glb(output.path, found.figure, q, names=names)
    some = (
        f"the {len(kept)} of {plural(len(first), 'survivor')}"
        if len(kept) < len(first)
        else f"the {plural(len(first), 'survivor')}"
    )
    whose = " whose lengths fit best" if len(kept) < len(first) else ""
    return [*found.says, f"{some}{whose}, of frame {int(found.frame[0])}, the first that has any; +y up"]
