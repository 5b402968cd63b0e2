"""3D points in arrays (NPZ, NPY, pickle) and tables (CSV, Parquet), with names or in a layout's order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.errors import refusal, shown
from posekit.files import write_bytes
from posekit.formats.body_checks import points_motion
from posekit.formats.layout import by_order, load_layout
from posekit.formats.npz_file import packed
from posekit.formats.options import Options
from posekit.formats.robot_tables import time_and_rate
from posekit.formats.tables import TIMES, Table, by_row, columns_of_points, csv_text, seconds
from posekit.geometry import FARTHEST_COORDINATE, UNIT_WORDS, UP_WORDS, Array, Ints
from posekit.skeleton import HEAD_POINTS, JOINTS

if TYPE_CHECKING:
    from posekit.motion import Motion

#: Arrays by name.
Held = Mapping[str, Any]

#: Names of arrays of points, in the order of the search.
POINTS: Final = (
    *("joints", "points", "posed_joints", "pred_keypoints_3d", "keypoints_3d", "keypoints3d", "positions_3d"),
    *("poses_3d", "joints_3d", "joints3d", "kpts_3d", "pred_joints", "joint_positions", "positions"),
    *("new_joints", "xyz", "arr_0", ""),
)
NAMES: Final = ("joint_names", "names", "keypoint_names", "point_names", "marker_names", "labels")
#: Columns of Caliscope's triangulated points; points 0 to 32 are MediaPipe's (mprib/caliscope).
CALISCOPE_COLUMNS: Final = ("sync_index", "point_id", "x_coord", "y_coord", "z_coord")
#: Names of columns with the recording or the person of each row.
PEOPLE: Final = ("clip", "person", "person_id", "track_id", "subject")
FRAMES: Final = ("frame", "fnum", "sync_index", "frame_index")


def looks_like(document: Any) -> bool:
    """Return whether a document contains 3D points."""
    if isinstance(document, Table):
        return set(CALISCOPE_COLUMNS) <= set(document.names) or bool(_wide_columns(document.names))
    return isinstance(document, Mapping) and _key(document) is not None


def _key(document: Held) -> str | None:
    """Return the name of the array of points: a known name, or the only array (T, P, 3) or (T, P, 4)."""
    arrays = {
        name: value.ndim
        for name, value in document.items()
        if isinstance(value, np.ndarray) and value.dtype.kind in "iuf" and value.ndim > 1
    }
    named = next((name for name in POINTS if name in arrays), None)
    shapes = {name: document[name].shape[-2:] for name, rank in arrays.items() if rank > 2}
    shaped = [name for name, (count, axes) in shapes.items() if axes in (3, 4) and count > 4]  # no matrices
    return named if named is not None or len(shaped) != 1 else shaped[0]


def read(document: Any, path: str, options: Options) -> Motion:
    """Read 3D points as a motion.

    Raises
    ------
    InputError
        If shapes are wrong; the message names the layouts with that number of points.
    """
    if isinstance(document, Table):
        return _read_table(document, path, options)
    key = _key(document)
    points = _shaped(document.get(key), path, key or "")
    frames = len(points)
    names = tuple(str(one) for one in np.ravel(next((document[n] for n in NAMES if n in document), ())))
    if names and len(names) != points.shape[1]:
        got = f"{len(names)} names"
        raise refusal(path, "joint_names", got, f"{points.shape[1]}, one per point", "correct the file")
    if np.shape(document.get("head")) == (frames, len(HEAD_POINTS), 3):
        points = np.concatenate([points, np.asarray(document["head"], dtype=np.float64)], axis=1)
        names = (*(names or JOINTS), *HEAD_POINTS)
    if "layout" in document and not names and not options.layout:
        options = replace(options, layout=str(document["layout"]))
    fields: dict[str, Any] = {"clips": tuple(str(one) for one in np.ravel(document.get("clip_names", ())))}
    fields |= _counts(document, frames, len(fields["clips"]) or frames, path)
    if "pred_cam_t" in document:  # SAM 3D Body
        options.note("points are relative to the body in each frame; pred_cam_t is ignored")
    if "in_world" in document or "pred_cam_t" in document:
        fields["in_world"] = bool(document.get("in_world", False))
    if np.shape(document.get("q"))[:1] == (frames,):
        fields["q"] = np.asarray(document["q"], dtype=np.float64)
        fields["q_names"] = tuple(str(one) for one in np.ravel(document.get("configuration_names", ())))
        fields["robot"] = options.urdf or str(document.get("robot", "figure"))
    fields["rate"], fields["time"] = _times(document, fields.get("clip"), frames, path)
    for name, known in (("unit", UNIT_WORDS), ("up", UP_WORDS)):
        fields[name] = _word(document, name, known, path)
    custom = "+y" if "clip_fps" in document else ""
    return points_motion(points, names, path, options, up_by_custom=custom, **fields)


def _shaped(values: Any, path: str, key: str) -> Array:
    """Return points (T, P, 3) from an array (T, P, 3), (1, T, P, 3), (T, 3 P), or (T, P, 4) with confidences."""
    points = np.asarray(values, dtype=np.float64)
    if points.ndim == 4 and 1 in points.shape[:2]:
        points = points[0] if points.shape[0] == 1 else points[:, 0]
    if points.ndim == 2 and points.shape[1] == 3 and by_order(len(points)):
        points = points[None]  # one posture
    elif points.ndim == 2 and points.shape[1] % 3 == 0 and by_order(points.shape[1] // 3):
        points = points.reshape(len(points), -1, 3)
    if points.ndim == 3 and points.shape[2] == 4:
        points = np.where(points[..., 3:] > 0, points[..., :3], np.nan)
    if points.ndim != 3 or points.shape[2] != 3 or not len(points):
        near = ", ".join(layout.name for count in points.shape[1:] for layout in by_order(count))
        expected = "(frames, points, 3) with a frame or more" + (f", as in {near}" if near else "")
        remedy = "name the points with --layout"
        if points.shape[-1:] == (2,):
            remedy = "these are points in pictures: recover them"
        elif points.shape[1:-1] == (3,):
            remedy = "exchange the last two axes, as array.transpose(0, 2, 1) does"
        raise refusal(path, key, f"shape {points.shape}", expected, remedy)
    if (np.abs(points) > FARTHEST_COORDINATE).any():
        raise refusal(path, key, "a number too large", f"coordinates below {FARTHEST_COORDINATE:g}")
    return points


def _counts(document: Held, frames: int, clips: int, path: str) -> dict[str, Ints]:
    """Return the recording's index and the frame number of each row, if the file states them."""
    found = {}
    for key, most in (("clip", clips), ("frame", 2**53)):
        values = np.asarray(document.get(key, ()))
        if key in document and values.shape == (frames,) and values.dtype.kind in "iu":
            found[key] = values.astype(np.intp)
        if key in document and (key not in found or found[key].min() < 0 or found[key].max() >= most):
            got, expected = f"{values.dtype} {values.shape}", f"{frames} whole numbers from 0, below {most}"
            raise refusal(path, key, got, expected, "correct the file")
    return found


def _times(held: Held, clip: Ints | None, frames: int, path: str) -> tuple[float | None, Array | None]:
    """Return the file's rate and times; if recordings have different rates, times are computed from these rates."""
    time, rate = time_and_rate(held)
    if time is not None and len(time) != frames:
        raise refusal(path, "time", f"{len(time)} numbers", f"{frames}", "correct the file")
    rates = np.ravel(held.get("clip_fps", ())).astype(np.float64)
    if time is None and clip is not None and clip.max() < rates.size and len(np.unique(rates)) > 1:
        starts = np.array([np.argmax(clip == index) for index in range(rates.size)])
        with np.errstate(divide="ignore", invalid="ignore"):
            time = (np.arange(frames) - starts[clip]) / np.where(rates > 0, rates, np.nan)[clip]
    return (float(rates[0]) if rates.size else rate), time


def _word(document: Held, key: str, known: Mapping[str, str], path: str) -> str:
    word = str(np.ravel(document.get(key, ""))[0]).strip().casefold()
    if word and word not in known:
        raise refusal(path, key, shown(word), f"one of {', '.join(known)}", "correct the file")
    return known.get(word, "")


def _wide_columns(names: Sequence[str]) -> dict[str, list[str]]:
    """Return the names of the columns x, y, z of each point that has all three, by the point's name."""
    found = columns_of_points(names).items()
    return {name: [axes[axis] for axis in "xyz"] for name, axes in found if set("xyz") <= set(axes)}


def _read_table(table: Table, path: str, options: Options) -> Motion:
    names = [name for name in table.names if name]
    if len(set(names)) != len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise refusal(path, "columns", f"{shown(twice)} twice", "each name once", "rename one of the two")
    time_name = next((name for name in names if name.casefold() in TIMES), None)
    frame_name = next((name for name in names if name.casefold() in FRAMES), None)
    who = next((table.texts(name) for name in PEOPLE if name in names), [])
    caliscope = set(CALISCOPE_COLUMNS) <= set(names)
    if caliscope:
        labels = load_layout("mediapipe_33").points
        points, rows = _caliscope(table, path, len(labels))
    else:
        columns = _wide_columns(names)
        labels = tuple(columns)
        flat = [table.checked(column) for axes in columns.values() for column in axes]
        points = np.stack(flat, axis=1).reshape(-1, len(labels), 3)
        rows = np.arange(len(points))
    if not len(rows):
        raise refusal(path, "", "no rows", "one row per frame", "check how it was written")
    fields: dict[str, Any] = {}
    if who:
        kept = [who[row] for row in rows.tolist()]
        fields["clips"] = tuple(dict.fromkeys(kept))
        fields["clip"] = np.array([fields["clips"].index(one) for one in kept], dtype=np.intp)
    number = table.checked(frame_name)[rows] if frame_name else np.full(len(rows), np.nan)
    if np.isfinite(number).all():
        # Omitted frames leave gaps in the numbers; the numbers of each recording start at 0.
        clip = fields.get("clip", np.zeros(len(rows), dtype=np.intp))
        first = np.array([number[clip == index].min() for index in range(clip.max() + 1)])
        fields["frame"] = (number - first[clip]).astype(np.intp)
    fields |= {name: table.about[name] for name in ("unit", "up") if name in table.about}
    if "in_world" in table.about:
        fields["in_world"] = table.about["in_world"] == "1"
    if caliscope:
        fields["layout"] = load_layout("mediapipe_33")
    if time_name:
        fields["time"] = seconds(time_name, table.checked(time_name)[rows])
    return points_motion(points, labels, path, options, **fields)


def _caliscope(table: Table, path: str, count: int) -> tuple[Array, Ints]:
    """Return points (T, P, 3) of a table with one row per frame and point, and the first row of each frame (T,)."""
    frame, index, *axes = (table.checked(name) for name in CALISCOPE_COLUMNS)
    used = np.flatnonzero((index >= 0) & (index < count) & np.isfinite(frame))
    if len(np.unique(np.stack([frame, index], axis=1)[used], axis=0)) < len(used):
        raise refusal(path, "", "a point twice in a frame", "each point once a frame", "remove one")
    places = np.stack(axes, axis=1)[used]
    _, first, points = by_row(frame[used, None], index[used].astype(np.intp), places, count)
    return points, used[first]


def write_npz(path: str | Path, motion: Motion) -> None:
    """Write all arrays of a motion as NPZ without pickles: points, configurations, times, clips, frames, axes."""
    arrays: dict[str, Any] = {
        "time": motion.time,
        "frame": np.asarray(motion.frame, dtype=np.int64),
        "clip": np.asarray(motion.clip, dtype=np.int64),
        "clip_names": np.array(_clip_names(motion), dtype=np.str_),
        "up": np.array(motion.up),
        "unit": np.array("m"),
        "in_world": np.array(motion.in_world),
    }
    if motion.joints is not None:
        arrays |= {"joints": motion.joints, "joint_names": np.array(motion.joint_names, dtype=np.str_)}
    if motion.q is not None:
        arrays |= {"q": motion.q, "configuration_names": np.array(motion.q_names, dtype=np.str_)}
        arrays["robot"] = np.array(motion.robot)
    write_bytes(path, packed(arrays))


def _clip_names(motion: Motion) -> tuple[str, ...]:
    count = int(np.max(np.asarray(motion.clip))) + 1
    numbered = [str(k) for k in range(count)] if count > 1 else [""]
    return (*motion.clips, *numbered[len(motion.clips) :])[:count]


def columns_of(motion: Motion) -> dict[str, NDArray[Any]]:
    """Return columns with one row per frame: time, clip if there are several, and coordinates (``neck_x``) or q."""
    clip = np.asarray(motion.clip)
    columns: dict[str, NDArray[Any]] = {}
    if not motion.in_time and len(motion) > 1:
        columns["frame"] = np.asarray(motion.frame)
    columns["time"] = np.asarray(motion.time)
    if clip.max() > 0:
        columns["clip"] = np.array(_clip_names(motion))[clip]
    if motion.joints is not None:
        for k, name in enumerate(motion.joint_names):
            columns |= {f"{name}_{axis}": motion.joints[:, k, place] for place, axis in enumerate("xyz")}
    elif motion.q is not None:
        names = motion.q_names or [f"q_{k}" for k in range(motion.q.shape[1])]
        columns |= dict(zip(names, motion.q.T, strict=True))
    return columns


def write_csv(path: str | Path, motion: Motion) -> None:
    """Write a motion's points (or configurations) as CSV or TSV with one row per frame; metres, seconds, radians."""
    tabs = Path(path).name.lower().removesuffix(".gz").endswith(".tsv")
    write_bytes(path, csv_text(columns_of(motion), "\t" if tabs else ",").encode())


def write_parquet(path: str | Path, motion: Motion) -> None:
    """Write a motion's columns as Parquet, with its axes in the metadata."""
    from posekit.formats.parquet import packed_table

    about = {"up": motion.up, "unit": "m", "in_world": str(int(motion.in_world)), "robot": motion.robot}
    write_bytes(path, packed_table(columns_of(motion), about))
