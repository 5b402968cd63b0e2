"""A person as a robot: a folder with the URDF, the SRDF and the configurations, for Pinocchio, yourdfpy and MuJoCo.

``figure.urdf`` and ``figure.srdf`` are the figure as `posekit.load_figure` reads it (metres, radians, REP-103: x
forward, y left, z up). ``configurations.npz`` has ``q`` (T, 29) in Pinocchio's order (``buildModelFromUrdf`` with
``JointModelFreeFlyer``: x, y, z, then the quaternion x, y, z, w, then the joints), ``configuration_names`` (29,) and
``time`` (T,), and is a file of schema ``posekit.configurations/1``; ``configurations.csv`` has the same, a row a frame,
empty where an angle is not known. ``figure_mujoco.urdf`` is the same figure on a floating joint ``root``, which MuJoCo
does not add by itself. Its quaternion is w, x, y, z.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from pathlib import Path
from typing import Final
from xml.etree import ElementTree

import numpy as np

from posekit.body import Figure, load_figure
from posekit.body.figure import LINK_OF_POINT
from posekit.body.urdf import parse
from posekit.formats.motion.bvh_tree import checked
from posekit.formats.motion.figure_motion import figure_motion
from posekit.formats.motion.motion import Motion
from posekit.formats.motion.motion_format import MotionFormat
from posekit.geometry import Array
from posekit.safe_io import cut, open_npz, refusal, replacing, shown, write_text
from posekit.safe_io.writing import replacing_folder
from posekit.skeleton import POINTS

FOLDER_SCHEMA: Final = "posekit.configurations/1"
FIGURE_FILE, SRDF_FILE, MUJOCO_FILE = "figure.urdf", "figure.srdf", "figure_mujoco.urdf"
NPZ_FILE, CSV_FILE = "configurations.npz", "configurations.csv"
FOLDER_FILES: Final = (FIGURE_FILE, SRDF_FILE, MUJOCO_FILE, NPZ_FILE, CSV_FILE)
LINK_OF: Final = {point: LINK_OF_POINT.get(point, point) for point in POINTS}
"""The URDF link whose origin is each point."""


def write_urdf_folder(path: str | Path, figure: Figure, q: Array, time: Array, *, up: str = "+z") -> None:
    """Write the folder: all of its files, or none.

    Parameters
    ----------
    path : path
        A folder that is not there yet, is empty, or was written so before.
    figure : Figure
        The figure whose configurations they are.
    q : array (T, nq)
        In Pinocchio's order; NaN in angles that are not known is kept.
    time : array (T,)
        Seconds, ascending.
    up : str
        The axis of q's world that points up; it is noted in the NPZ, and q stays in its world.

    Raises
    ------
    InputError
        Where q or time are not what is said above, or the folder holds anything else.
    """
    q = checked(path, figure, q, time, up)
    seconds = np.asarray(time, dtype=np.float64)
    _check_folder(Path(path))
    with replacing_folder(Path(path)) as folder:
        write_text(folder / FIGURE_FILE, [figure.urdf])
        write_text(folder / SRDF_FILE, [figure.srdf])
        write_text(folder / MUJOCO_FILE, [mujoco_text(figure)])
        with replacing(folder / NPZ_FILE) as file:
            np.savez_compressed(
                file,
                schema=np.array(FOLDER_SCHEMA),
                configuration_names=np.array(figure.configuration_names),
                q=q,
                time=seconds,
                up=np.array(up),
            )
        with replacing(folder / CSV_FILE) as file:
            for piece in _table(figure, q, seconds):
                file.write(piece)


def read_urdf_folder(path: str | Path, unit: str | None = None) -> Motion:
    """Read such a folder as the motion of the figure's points.

    Parameters
    ----------
    path : path
        The folder to read.
    unit : str, optional
        URDF has metres: any other is refused.

    Raises
    ------
    InputError
        Where a file is missing or damaged, or the configurations are not the figure's.
    FigureError
        Where the URDF is no stick figure.
    """
    folder = Path(path)
    if not (folder / FIGURE_FILE).is_file() or not (folder / NPZ_FILE).is_file():
        expected = f"a folder with {FIGURE_FILE} and {NPZ_FILE}"
        raise refusal(path, "", "another folder or file", expected, "name that folder")
    with open_npz(folder / NPZ_FILE) as archive:
        q = archive.array("q", "f", (None, None)).astype(np.float64)
        names = archive.array("configuration_names", "U", (None,)).tolist()
        seconds = archive.array("time", "f", (None,)).astype(np.float64)
        up = str(archive.array("up", "U", ())) if "up" in archive.names else ""
    place, figure = folder / NPZ_FILE, load_figure(folder / FIGURE_FILE)
    if sorted(names) != sorted(figure.configuration_names) or q.shape[1] != len(names):
        got = f"{q.shape[1]} columns, {len(names)} names, among them {shown(names[0] if names else None)}"
        raise refusal(
            place, "configuration_names", got, "those of the figure beside it", "write the folder again"
        )
    q = checked(place, figure, q[:, [names.index(name) for name in figure.configuration_names]], seconds)
    return figure_motion(path, figure, q, seconds, unit=unit, up=up)


def mujoco_text(figure: Figure) -> str:
    """Return the figure's URDF as MuJoCo takes it: with a floating root; wrists and ankles stay bodies of their own."""
    robot = parse(figure.urdf, figure.source)
    base = next(iter({link.get("name") for link in robot.findall("link")} - _children(robot)))
    settings = {"fusestatic": "false"}
    ElementTree.SubElement(ElementTree.SubElement(robot, "mujoco"), "compiler", settings)
    ElementTree.SubElement(robot, "link", name="world")
    joint = ElementTree.SubElement(robot, "joint", name="root", type="floating")
    ElementTree.SubElement(joint, "parent", link="world")
    ElementTree.SubElement(joint, "child", link=str(base))
    ElementTree.indent(robot)
    return f'<?xml version="1.0"?>\n{ElementTree.tostring(robot, encoding="unicode")}\n'


def _children(robot: ElementTree.Element) -> set[str | None]:
    return {child.get("link") for child in robot.findall("joint/child")}


def _table(figure: Figure, q: Array, time: Array) -> Iterator[bytes]:
    """Spell time and q as CSV; numbers read back as they were."""
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(["time", *figure.configuration_names])
    for second, row in zip(time.tolist(), q.tolist(), strict=True):
        rows.writerow([second, *(value if value == value else "" for value in row)])  # noqa: PLR0124 (NaN)
    yield text.getvalue().encode("ascii")


def _check_folder(folder: Path) -> None:
    """Refuse a folder that holds anything else."""
    if folder.exists() and not folder.is_dir():
        raise refusal(folder, "", "a file", "the name of a folder", "choose another name")
    there = sorted(entry.name for entry in folder.iterdir()) if folder.is_dir() else []
    other = [name for name in there if name not in FOLDER_FILES]
    if other:
        got = f"a folder that holds {cut(other[0])}"
        raise refusal(folder, "", got, "a new or empty folder", "choose another name")


URDF_FORMAT: Final = MotionFormat(
    name="urdf",
    title="a folder with the person's URDF and q, for Pinocchio, yourdfpy and MuJoCo",
    folder=True,
    looks_like=lambda given: (given.path / FIGURE_FILE).is_file() and (given.path / NPZ_FILE).is_file(),
    read=read_urdf_folder,
    write_configurations=write_urdf_folder,
)
