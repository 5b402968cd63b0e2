"""A view of an articulated object: in memory, from a file, and to one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posekit.display.short_repr import ShortRepr
from posekit.formats.own.camera_model import ScaledOrthographicModel
from posekit.formats.own.object_view_schema import OBJECT_VIEW_SCHEMA, ObjectViewFile
from posekit.formats.own.units import PER_METRE, Unit
from posekit.linkages import Linkage
from posekit.safe_io.json_file import read_json
from posekit.safe_io.refusal import nearest, refusal, shown
from posekit.safe_io.writing import json_pieces, write_text
from posekit.tables.file_model import validated

Array = NDArray[np.float64]


def _no_frames() -> Array:
    return np.empty((0,))


@dataclass(frozen=True, kw_only=True, eq=False)
class ObjectView(ShortRepr):
    """What an uncalibrated camera saw of an object. NaN marks what is not known.

    Lengths are metres where the linkage has a unit; else they are in its own relative unit.

    Parameters
    ----------
    points : tuple of str (P,)
        The linkage's points.
    camera : ScaledOrthographicModel
        Which says where y points, and what is known of the scale.
    time : array (F,)
        Seconds.
    image : array (F, P, 2)
        Pixels, y down.
    truth : array (F, P, 3), optional
        Camera frame.
    unit : {"m", "cm", "mm"} or None
        The unit of its file; None where lengths are relative.

    Raises
    ------
    InputError
        Where a shape is wrong, a number is not finite, or a point is known in part.
    """

    points: tuple[str, ...]
    camera: ScaledOrthographicModel
    time: Array
    image: Array
    truth: Array = field(default_factory=_no_frames)
    unit: Unit | None = "m"

    def __post_init__(self) -> None:
        frames, count = len(self.time), len(self.points)
        if frames == 0:
            raise refusal("view", "time", "no frame", "at least one", "give every frame its time")
        for name, shape in (
            ("time", (frames,)),
            ("image", (frames, count, 2)),
            ("truth", (frames, count, 3)),
        ):
            given = np.array(getattr(self, name), dtype=np.float64)
            values = np.full(shape, np.nan) if given.shape == (0,) and name == "truth" else given
            if values.shape != shape:
                raise refusal("view", name, f"shape {values.shape}", f"{shape}", "give one row a frame")
            unknown = np.isnan(values)
            partly = unknown if name == "time" else unknown ^ unknown.all(axis=-1, keepdims=True)
            wrong = np.isinf(values) | partly
            if wrong.any():
                at = tuple(int(k) for k in np.argwhere(wrong)[0])
                where = f"frames[{at[0]}].{name}" + (f".{self.points[at[1]]}" if len(at) > 1 else "")
                got = shown(float(values[at]))
                raise refusal("view", where, got, "finite numbers", "leave out a point that is not known")
            values.flags.writeable = False
            object.__setattr__(self, name, values)

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.time)


def read_object_view(path: str | Path, linkage: Linkage) -> ObjectView:
    """Read a view of an object.

    Parameters
    ----------
    path : path
        JSON of schema ``posekit.view/1`` whose camera is scaled orthographic.
    linkage : Linkage
        Whose points its images are of.

    Raises
    ------
    InputError
        Where the file breaks the schema, names a point that the linkage has not, or gives a scale or a truth in
        metres while the linkage's lengths are relative, or the other way round.
    """
    file = validated(ObjectViewFile, read_json(path), path)
    unit, camera = file.unit, file.camera
    measured = camera.scale is not None or any(frame.truth for frame in file.frames)
    if measured and (unit is None) != (linkage.unit is None):
        what = "camera.scale" if camera.scale is not None else "truth"
        own = "relative lengths" if linkage.unit is None else "lengths in metres"
        raise refusal(
            path,
            "unit",
            shown(unit),
            f"{'null' if linkage.unit is None else 'm, cm or mm'}: the linkage {linkage.name} has {own}",
            f"give {what} so, or leave it out",
        )
    per = PER_METRE[unit] if unit is not None and linkage.unit is not None else 1.0
    scale = None if camera.scale is None else camera.scale * per
    return ObjectView(
        points=linkage.points,
        camera=ScaledOrthographicModel(scale=scale, aspect=camera.aspect),
        time=np.array([frame.time for frame in file.frames], dtype=np.float64),
        image=_gather(path, "image", [frame.image for frame in file.frames], linkage, 2),
        truth=_gather(path, "truth", [frame.truth or {} for frame in file.frames], linkage, 3) / per,
        unit=None if linkage.unit is None else unit or "m",
    )


def write_object_view(path: str | Path, view: ObjectView) -> None:
    """Write a view of an object, whole or not at all.

    Raises
    ------
    InputError
        Where the file cannot be written, or would be larger than can be read again.
    """
    per = 1.0 if view.unit is None else PER_METRE[view.unit]
    scale = view.camera.scale
    camera: dict[str, Any] = {"model": "scaled-orthographic", "scale": None if scale is None else scale / per}
    if view.camera.aspect != 1:
        camera["aspect"] = view.camera.aspect
    frames = []
    for k in range(len(view)):
        frame: dict[str, Any] = {"time": float(view.time[k]), "image": _known(view.points, view.image[k])}
        if truth := _known(view.points, view.truth[k] * per):
            frame["truth"] = truth
        frames.append(frame)
    head: dict[str, Any] = {"schema": OBJECT_VIEW_SCHEMA, "unit": view.unit, "camera": camera}
    validated(ObjectViewFile, {**head, "frames": frames}, path)
    write_text(path, json_pieces(head, "frames", frames))


def _gather(
    path: str | Path, field_name: str, frames: Sequence[dict[str, list[float]]], linkage: Linkage, axes: int
) -> Array:
    """Make the array (F, P, axes) of points by name, NaN where a name is absent."""
    place = {name: column for column, name in enumerate(linkage.points)}
    values = np.full((len(frames), len(place), axes), np.nan)
    for k, points in enumerate(frames):
        for name, point in points.items():
            if name not in place:
                raise refusal(
                    path,
                    f"frames[{k}].{field_name}",
                    shown(name),
                    f"a point of the linkage {linkage.name}",
                    nearest(name, linkage.points),
                )
            values[k, place[name]] = point
    return values


def _known(names: Sequence[str], points: Array) -> dict[str, list[float]]:
    """Return the points that are known, by name."""
    return {name: row for name, row in zip(names, points.tolist(), strict=True) if row[0] == row[0]}
