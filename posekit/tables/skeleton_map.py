"""``posekit.skeleton_map/1``: which points of a format are which landmarks of a body."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import BeforeValidator, Field

from posekit.tables.fields import MAX_POINTS, Name, listed
from posekit.tables.file_model import FileModel

Parts = Annotated[list[Name], Field(min_length=1, max_length=MAX_POINTS), BeforeValidator(listed)]
"""The points whose mean a landmark is: a list, or one name."""


class SkeletonMapTable(FileModel):
    """The points of a format, and the landmarks that are one of them, or the mean of some."""

    hints_at: ClassVar[Mapping[str, str]] = {
        "points": "list the names in the format's order, or leave it out where files name their points",
        "landmarks": "name the points under [landmarks]",
    }

    schema_: Literal["posekit.skeleton_map/1"] = Field(alias="schema")
    source: str = ""
    points: Annotated[list[Name], Field(max_length=MAX_POINTS)] = Field(default=[])
    landmarks: Annotated[dict[str, Parts], Field(min_length=1)]
    feet: dict[str, Parts] = Field(default={}, description="Toes and heels, what a foot stands on.")
