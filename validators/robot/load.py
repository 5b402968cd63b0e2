"""What is judged, by name, file or object: the stick figure, or any robot."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from posekit.body import Figure, load_figure
from posekit.body.urdf import as_figure_error
from posekit.errors import FigureError, InputError
from posekit.robots import Robot, load_robot, robot_names
from posekit.robots.urdf import check_urdf, read_urdf
from posekit.skeleton import DOFS, urdf_joint_name

STICK_FIGURE: Final = "stick_figure"


def load_subject(
    urdf: str | Path | Figure | Robot,
    *,
    srdf: str | Path | None = None,
    package_dirs: Sequence[str | Path] = (),
    untrusted: bool | None = None,
    visuals: bool = False,
) -> Figure | Robot:
    """Load a figure or a robot.

    A file with all joints of the stick figure is a figure; any other is a robot.

    Raises
    ------
    FigureError
        Where a file is not there, is no URDF, or is a broken figure.
    InputError
        Where a robot cannot be loaded, or an option is for robots alone.
    """
    if isinstance(urdf, Figure | Robot):
        _refuse_options(srdf, package_dirs, "the object that was given")
        return urdf
    name = str(urdf)
    if name == STICK_FIGURE:
        _refuse_options(srdf, package_dirs, "the built-in stick figure")
        return load_figure()
    if isinstance(urdf, Path) or name not in robot_names():
        if not Path(name).is_file():
            raise FigureError(
                f"--urdf {name}: no such file or robot; expected the path of a URDF, stick_figure, or a robot of "
                "example-robot-data, as human"
            )
        if _is_figure(name):
            _refuse_options(
                srdf, package_dirs, "a stick figure, whose SRDF is the file of its name beside it"
            )
            return load_figure(name, untrusted=untrusted is not False)
    return load_robot(urdf, srdf=srdf, package_dirs=package_dirs, untrusted=untrusted, visuals=visuals)


def _is_figure(path: str) -> bool:
    """Tell whether a URDF has the stick figure's joints; refuse what is no URDF."""
    with as_figure_error():
        robot = check_urdf(read_urdf(path), path)
    joints = {joint.get("name", "") for joint in robot.findall("joint")}
    return all(urdf_joint_name(dof) in joints for dof in DOFS)


def _refuse_options(srdf: str | Path | None, package_dirs: Sequence[str | Path], of: str) -> None:
    given = [name for name, value in (("--srdf", srdf), ("--package-dir", package_dirs)) if value]
    if given:
        raise InputError(f"{given[0]}: {of} needs none; expected a robot's URDF with it")
