"""Load a robot by name or from files, in a child process first where it comes from a stranger."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from posekit.robots.declared import BodyKind
from posekit.robots.find import find
from posekit.robots.meshes import private_copies
from posekit.robots.robot import Robot
from posekit.robots.second_reader import compare_readers
from posekit.robots.untrusted import ProbeLimits, probe
from posekit.robots.urdf import check_urdf, read_urdf


def load_robot(
    name_or_path: str | Path,
    *,
    srdf: str | Path | None = None,
    package_dirs: Sequence[str | Path] = (),
    untrusted: bool | None = None,
    free_flyer: bool = True,
    geometry: bool = True,
    visuals: bool = False,
    limits: ProbeLimits | None = None,
) -> Robot:
    """Load a robot.

    Parameters
    ----------
    name_or_path : str or path
        The name of a published robot, ``stick_figure``, or the path of a URDF: see `posekit.robots.find`.
    srdf : path, optional
        Its SRDF; by default the one that belongs to it, where there is one.
    package_dirs : sequence of path
        Directories that hold the packages of its meshes, besides its own.
    untrusted : bool, optional
        Whether to load it in a child process first, with limits on memory and time. By default whatever did not
        come with posekit or example-robot-data is.
    free_flyer : bool
        Whether the root moves freely, or is fixed.
    geometry : bool
        Whether to load collision bodies, with their meshes.
    visuals : bool
        Whether to load visual bodies too.
    limits : ProbeLimits, optional
        What the child process may take.

    Returns
    -------
    Robot

    Raises
    ------
    InputError
        In one line: what is wrong with a file, a mesh or a number; or how the child process ended.
    """
    files = find(name_or_path, srdf=srdf, package_dirs=tuple(package_dirs))
    settings: dict[str, Any] = {
        "urdf": read_urdf(files.urdf),
        "srdf": None if files.srdf is None else read_urdf(files.srdf),
        "name": files.name,
        "source": str(files.urdf),
        "package_dirs": files.package_dirs,
        "free_flyer": free_flyer,
        "with_geometry": geometry,
        "with_visuals": visuals,
        "shared_srdf": files.built_in and srdf is None,
    }
    stranger = not files.built_in if untrusted is None else untrusted
    if stranger:
        tree = check_urdf(
            settings["urdf"], settings["source"]
        )  # what can be said without a child is said at once
        wanted: dict[BodyKind, bool] = {"collision": geometry, "visual": visuals}
        kinds = [kind for kind in wanted if wanted[kind]]
        with private_copies(tree, files.package_dirs, settings["source"], kinds) as settings["mesh_copies"]:
            probe(settings, compare=not files.built_in, limits=limits)
            return Robot(**settings)
    robot = Robot(**settings)
    if not files.built_in:
        compare_readers(robot.urdf, robot.model, robot.source, must_read=False)
    return robot
