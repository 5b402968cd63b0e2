"""``posekit.linkage/1``: an articulated object of points and rigid segments."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import AfterValidator, Field

from posekit.tables.fields import Pair
from posekit.tables.file_model import FileModel, refuse


def _on_one_line(text: str) -> str:
    if not text.isprintable():
        refuse("a text on one line", "correct it")
    return text


Line = Annotated[str, AfterValidator(_on_one_line)]


class ConstraintsTable(FileModel):
    """What is known of segments beside their lengths."""

    coplanar: list[list[str]] = Field(default=[], description="Points of one plane.")
    perpendicular: list[Pair] = Field(default=[], description="Pairs of segments.")
    collinear: list[list[str]] = Field(default=[], description="Points of one line.")


class LinkageTable(FileModel):
    """An articulated object."""

    hints_at: ClassVar[Mapping[str, str]] = {"segments": "give the lengths under [segments]"}

    schema_: Literal["posekit.linkage/1"] = Field(alias="schema")
    name: Line | None = None
    source: Line = ""
    unit: float | None = Field(default=None, description="Metres; absent where lengths are relative.")
    height: float | None = Field(default=None, description="What a stature would be, in `unit`.")
    urdf: Line | None = Field(default=None, description="The robot that it is of.")
    points: list[str]
    midpoints: dict[str, Pair] = Field(default={}, description="Points halfway between two others.")
    segments: dict[str, float] = Field(description="Lengths by the names of two points, as a-b.")
    constraints: ConstraintsTable = ConstraintsTable()
