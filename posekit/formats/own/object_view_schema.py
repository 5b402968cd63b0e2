"""``posekit.view/1`` of any articulated object: the same file, with the points of its linkage instead of joints."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import FailFast, Field

from posekit.formats.own.units import Unit
from posekit.formats.own.view_schema import Point2, Point3, ScaledOrthographicFields
from posekit.tables.file_model import FEW_ENTRIES, FileModel

OBJECT_VIEW_SCHEMA = "posekit.view/1"


class ObjectFrameFields(FileModel):
    """One picture."""

    time: float = Field(description="Seconds.")
    image: Annotated[dict[str, Point2], FEW_ENTRIES] = Field(
        description="Where each point of the linkage is seen; one that is not seen is left out."
    )
    truth: Annotated[dict[str, Point3], FEW_ENTRIES] | None = Field(
        default=None,
        description="Points, camera frame, in `unit`, or in the linkage's own where that is null.",
    )


class ObjectViewFile(FileModel):
    """One uncalibrated view of one articulated object, a frame or a sequence."""

    hints: ClassVar[Mapping[str, str]] = {
        "unit": "write m, cm or mm; null, or nothing, where the lengths of the object are relative",
        "camera": "another object than a person is recovered from uncalibrated views: scaled-orthographic",
        "model": "another object than a person is recovered from uncalibrated views: scaled-orthographic",
        "scale": "give it in pixels a unit, or write null where it is not known",
        "image": "an image point is [u, v]; leave out a point that is not seen",
        "truth": "a point is [x, y, z]; leave out one that is not known",
        "frames": "a view has at least one frame, each of them an object with time and image",
        "time": "give it in seconds",
    }

    schema_: Literal["posekit.view/1"] = Field(alias="schema")
    unit: Unit | None = Field(default=None, description="Of lengths; null where they are relative.")
    camera: ScaledOrthographicFields
    frames: Annotated[list[ObjectFrameFields], Field(min_length=1), FailFast()] = Field(
        description="One a picture."
    )
