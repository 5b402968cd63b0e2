"""`save`: write an object to a file; the suffix of the file's name determines the format."""

from __future__ import annotations

from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from posekit.cameras import PinholeCamera
from posekit.errors import names_checked, refusal, shown
from posekit.formats.open import named, suffix_of

if TYPE_CHECKING:
    from posekit.motion import Motion

WRITERS: Final[dict[str, dict[str, str]]] = {
    # class of the object: ending to "module:write", where write(path, object, **options) writes the file whole
    "Motion": {
        ".bvh": "figure_tree:write_bvh",
        ".trc": "trc:write",
        ".c3d": "c3d:write",
        ".csv": "joint_arrays:write_csv",
        ".tsv": "joint_arrays:write_csv",
        ".npz": "joint_arrays:write_npz",
        ".parquet": "joint_arrays:write_parquet",
        ".glb": "glb:write",
        ".json": "postures_file:write",
    },
    "View": {".json": "view_file:write"},
    "Recovery": {f".{kind}": f"result_file:write_{kind}" for kind in ("json", "npz", "parquet")},
    "Report": {f".{kind}": f"report_file:write_{kind}" for kind in ("json", "csv", "npz", "parquet", "md")},
    "dict": {f".{kind}": f"cameras_file:write_{kind}" for kind in ("toml", "json")},
}
#: Suffixes of pictures and pages, which `posekit.render` draws.
DRAWN: Final = (".png", ".gif", ".mp4", ".html", ".svg", ".pdf")
#: Formats of points or of the figure; for them a robot's configurations are converted to points.
POINT_FORMATS: Final = (".trc", ".c3d", ".bvh", ".glb")


def save(thing: Any, path: str | PathLike[str], *, which: str = "", **options: Any) -> None:
    """Write an object to a file in the format that the suffix of the name determines.

    If writing fails, no incomplete file remains.

    Parameters
    ----------
    thing : Motion, View, Recovery, Report, or dict of cameras
    path : path
        Path whose suffix determines the format; a further ``.gz`` compresses the file.
    which : {"", "answer", "path", "all", "first"}
        Postures of a recovery to write to a file of motion; by default the followed path or, without one, the answer.
    **options
        Options of the format, such as ``unit="m"`` for BVH.

    Raises
    ------
    InputError
        If the format cannot hold the object, or the file cannot be written.

    Examples
    --------
    >>> import posekit
    >>> posekit.save(posekit.open("samples/jump.bvh"), "jump.trc")
    """
    path = Path(path)
    suffix = suffix_of(path)
    kind = type(thing).__name__
    refuse_ending(kind, path)
    if kind == "Recovery" and (which or suffix not in WRITERS[kind]):
        followed = thing.path
        thing = thing.motion(which or ("path" if followed is not None and len(followed) else "answer"))
        kind = "Motion"
    elif which:
        raise refusal(
            path, "--posture", shown(which), "no choice: a motion has one posture per frame", "leave it out"
        )
    elif kind == "dict" and not all(isinstance(camera, PinholeCamera) for camera in thing.values()):
        raise refusal(path, "", "a dict", "cameras by name", "save a motion, view, result or report")
    if kind == "Motion" and suffix in POINT_FORMATS and thing.joints is None and thing.document is None:
        thing = with_points(thing)
    names_checked(named(WRITERS[kind][suffix]))(path, thing, **options)


def refuse_ending(kind: str, path: Path) -> None:
    """Refuse a suffix to which objects of a class cannot be written; a recovery can also be written as a motion."""
    known = {**WRITERS.get(kind, {}), **(WRITERS["Motion"] if kind == "Recovery" else {})}
    if suffix_of(path) not in known:
        expected = f"one that is written: {', '.join(known)}" if known else "a motion, view, result or report"
        got = f"the ending {shown(suffix_of(path))} for a {kind}"
        remedy = "choose one of these" if known else "recover the postures of key points first"
        drawn = "write one of these, and draw it with posekit render"
        raise refusal(path, "", got, expected, drawn if suffix_of(path) in DRAWN else remedy)


def with_points(motion: Motion) -> Motion:
    """Return a motion with the positions of 14 joints, metres, computed from the robot's configurations.

    Raises
    ------
    InputError
        If the robot is unknown, is not a humanoid, or has joints that differ from the configurations.
    """
    if not motion.robot or motion.q is None:
        remedy = "give it with --urdf" + (
            ", or give the .trc of the markers" if motion.layout == "opensim" else ""
        )
        raise refusal(motion.source, "robot", "no name", "the robot of the configurations", remedy)
    from posekit.robots import load_robot

    robot = load_robot(motion.robot, bodies="none")
    if not robot.joint_map:
        remedy = "give a robot with limbs, or write .npz"
        raise refusal(motion.source, "robot", f"{robot.name} without joints of a body", "a humanoid", remedy)
    q = motion.q
    if motion.q_names and tuple(motion.q_names) != tuple(robot.configuration_names):
        q, _ = robot.q_from_columns(motion.q_names, q)
    return replace(motion, joints=robot.points(q))
