"""`open`: read a file, recognise its container (JSON, arrays, table, …), and call the first reader that fits."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from os import PathLike
from pathlib import Path
from typing import Any, Final

from posekit.errors import names_checked, refusal, shown
from posekit.files import read_bytes
from posekit.formats.node import undamaged
from posekit.formats.options import Options
from posekit.geometry import Array, numbers

CONTAINERS: Final[dict[str, tuple[str, tuple[str, ...]]]] = {
    # container: "module:parse" of (data: bytes, source: str) -> plain document, and the endings of its files
    "json": ("json_file:parse", (".json",)),
    "arrays": ("npz_file:parse", (".npz", ".npy", ".pkl", ".pickle", ".p", ".joblib", ".pt", ".pth")),
    "table": ("tables:parse", (".csv", ".tsv", ".txt", ".trc", ".mot", ".sto")),
    "bvh": ("bvh:parse", (".bvh",)),
    "c3d": ("c3d:parse", (".c3d",)),
    "parquet": ("parquet:parse", (".parquet", ".pq")),
    "toml": ("layout:parse_toml", (".toml",)),
    "yaml": ("file_storage:parse_yaml", (".yaml", ".yml")),
    "xml": ("file_storage:parse_xml", (".xml",)),
}
#: Containers by first bytes, for files with an unknown suffix.
STARTS: Final = {
    **{b"HIERARCHY": "bvh", b"PathFileType": "table", b"{": "json", b"[": "json", b"PAR1": "parquet"},
    **{b"PK\x03\x04": "arrays", b"\x93NUMPY": "arrays"},
}
READERS: Final[dict[str, tuple[str, ...]]] = {
    # container: modules in the order in which `looks_like(document)` is called; the first that returns True reads it
    # with `read(document, path, options)`
    "json": ("view_file", "postures_file", "result_file", "report_file", "cameras_file", "keypoints"),
    "arrays": (
        *("view_file", "postures_file", "result_file", "report_file", "cameras_file"),
        *("smpl", "robot_tables", "joint_arrays"),
    ),
    "table": ("trc", "report_file", "keypoint_tables", "robot_tables", "joint_arrays"),
    "bvh": ("bvh",),
    "c3d": ("c3d",),
    "parquet": ("result_file", "report_file", "robot_tables", "joint_arrays"),
    "toml": ("cameras_file",),
    "yaml": ("cameras_file",),
    "xml": ("cameras_file",),
    "folder": ("keypoints",),  # a folder's document is its Path; `parsed` reads one of its files
}
#: Containers with a single reader, which reads all their files.
ONE_CONTENT: Final = ("bvh", "c3d")
#: Suffixes of pictures and films, which posekit does not read: run a detector on them first.
PICTURES: Final = ".png .jpg .jpeg .tif .tiff .webp .bmp .gif .heic .mp4 .mov .avi".split()
#: Suffixes of files that posekit writes but does not read.
WRITTEN_ONLY: Final = (".glb", ".gltf")


def parsed(path: str | PathLike[str]) -> tuple[str, Any]:
    """Parse a file; return the name of its container, such as ``json``, and its document (the parsed content).

    The document of JSON and TOML is a dict or a list. The document of arrays (NPZ, NPY, pickles) is a dict of arrays,
    numbers, strings and plain containers; an array without a name has the key "". The document of a table is a
    `posekit.formats.tables.Table`, whose `about` has the metadata of Parquet. The document of a folder is its `Path`.
    """
    given, path = str(path), Path(path)
    if given and path.is_dir():
        return "folder", path
    data, suffix = read_bytes(path), suffix_of(path)
    by_suffix = (name for name, (_, suffixes) in CONTAINERS.items() if suffix in suffixes)
    by_start = (name for start, name in STARTS.items() if data.lstrip()[:20].startswith(start))
    container = next(iter([*by_suffix, *by_start]), None)
    if suffix in PICTURES:
        remedy = "run a pose detector on it, and give what it writes"
        raise refusal(path, "", "pictures", "the key points that a detector found in them", remedy)
    if suffix in WRITTEN_ONLY:
        remedy = "give the file that it was made from"
        raise refusal(path, "", f"{suffix}, which is written and not read", "a file of motion", remedy)
    if not data.strip():
        raise refusal(path, "", "an empty file", "one with data", "write or copy it again")
    if container is None:
        known = ", ".join(one for _, suffixes in CONTAINERS.values() for one in suffixes)
        raise refusal(
            path, "", shown(suffix), f"a file of {known}", "export it as one of these, such as BVH or C3D"
        )
    return container, named(CONTAINERS[container][0])(data, str(path))


def suffix_of(path: Path) -> str:
    """Return the suffix of a file's name in lower case, without ``.gz``."""
    return (path.with_suffix("") if path.suffix.lower() == ".gz" else path).suffix.lower()


def named(function: str) -> Callable[..., Any]:
    """Return a function of this package by its name "module:function", importing the module."""
    module, _, name = function.partition(":")
    found: Callable[..., Any] = getattr(import_module(f"posekit.formats.{module}"), name)
    return found


@names_checked
def open(  # the door's name, as in `gzip.open`
    path: str | PathLike[str] | Array,
    layout: str = "",
    *,
    unit: str | None = None,
    up: str | None = None,
    rate: float | None = None,
    urdf: str = "",
    person: int | None = None,
) -> Any:
    """Read a file, a folder or an array, and return an object of the type that its content determines.

    Parameters
    ----------
    path : path or array
        A file of motion, key points, a view, cameras, a result, a report or a robot; or a detector's folder. Files may
        be compressed with gzip. An array (T, J, 3) has 3D joint positions, an array (T, P, 2) key points in pixels.
    layout : str
        Name of a layout (`posekit.formats.layout.layout_names`), or path of a TOML file with a layout.
    unit : str, optional
        Unit of the file's lengths: "m", "cm", "mm" or "in".
    up : str, optional
        Axis that points up, such as "+y".
    rate : float, optional
        Frames per second of a file without times.
    urdf : str
        Name or path of the robot whose configurations a table contains.
    person : int, optional
        Index of the person in a file of several people, from 0.

    Returns
    -------
    Motion, View, Detections, Recovery, Report, Robot, or dict of cameras by name

    Raises
    ------
    InputError
        If the file cannot be read or recognised, or its content is contradictory.

    Examples
    --------
    >>> import posekit
    >>> posekit.open("samples/jump.bvh").rate
    30.0
    """
    options = Options(layout=layout, unit=unit or "", up=up or "", rate=rate, urdf=urdf, person=person)
    if not isinstance(path, str | PathLike):
        from posekit.formats.arrays import key_points_of, motion_of

        points = numbers(path, "", "array", "a path, an object or numbers")
        flat = points.ndim > 2 and points.shape[-1] == 2
        return key_points_of(points, options) if flat else motion_of(points, options)
    if suffix_of(Path(path)) == ".urdf":
        from posekit.robots import load_robot

        return load_robot(Path(path))
    container, document = parsed(path)
    readers = READERS[container]
    known = (one for one in readers if container in ONE_CONTENT or named(f"{one}:looks_like")(document))
    joints_alone = urdf and container in ("table", "parquet")  # of a robot whose base is fixed
    if module := next(known, "robot_tables" if joints_alone else ""):
        with undamaged(Path(path), f"the parts of {container} that {module} reads"):
            found = named(f"{module}:read")(document, str(path), options)
        if type(found).__name__ == "Motion" and not len(found):
            raise refusal(path, "", "no frames", "at least one", "write or copy it again")
        return found
    names = [str(one) for one in (document if isinstance(document, dict) else getattr(document, "names", ()))]
    listed = ", ".join(shown(name) for name in names[:8] if name)
    held = f"the entries {listed}" if listed else f"nothing that is known in a {container} file"
    remedy = "name the joints in a TOML file (--layout), or give the array to posekit.recover or validate"
    if container == "arrays" and all(isinstance(one, dict) for one in document.values()):
        held, remedy = f"{len(names)} recordings, {listed}", "write each into a file of its own"
    elif container == "folder":
        held, remedy = "a folder without key points", "give one of its files"
    elif isinstance(document, dict) and {"images", "annotations"} <= document.keys():
        held, remedy = "a COCO file without keypoints", "give the file of its person keypoints"
    raise refusal(path, "", held, "motion, key points, a view, cameras, a result or a report", remedy)
