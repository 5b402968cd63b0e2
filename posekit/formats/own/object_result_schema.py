"""The schema ``posekit.object/1``: every posture of an articulated object behind an uncalibrated view."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal

from pydantic import FailFast, Field

from posekit.formats.own.result_schema import Maybe, MaybePoint, Names, ResultFamily
from posekit.formats.own.survivor_models import Count
from posekit.formats.own.units import Unit
from posekit.tables.file_model import FEW_ENTRIES, FileModel

OBJECT_SCHEMA = "posekit.object/1"

Branches = Annotated[str, Field(max_length=64, pattern="^[01]*$")]
Segments = Annotated[list[Annotated[list[str], Field(min_length=2, max_length=2)]], Field(max_length=5000)]


class ObjectLevels(FileModel):
    """Survivors by level of the tree."""

    point: Names = Field(description="The points in the order in which the tree places them.")
    survivors: Annotated[list[Count], Field(max_length=1000), FailFast()]


class ObjectPosture(FileModel):
    """One survivor."""

    points: Annotated[list[MaybePoint], Field(max_length=1000), FailFast()] = Field(
        description="Camera frame, the tree's root at depth 0, in `unit` or relative; null where not seen."
    )
    branches: Branches = Field(description="Near (0) or far (1), level by level of the tree.")
    flips: Annotated[dict[str, str | None], FEW_ENTRIES] = Field(
        description="The nearer end of each segment; null where both are level, or one is not seen."
    )
    scale: float = Field(description="Pixels a `unit`, or a relative unit, that it was recovered at.")
    margins: Annotated[dict[str, Maybe], FEW_ENTRIES] = Field(
        description="By check: the distance to the nearest bound, in metres or the relative unit."
    )
    q: Annotated[list[Maybe], Field(max_length=1000)] | None = Field(
        default=None,
        description="Configuration in Pinocchio's order, metres and radians whatever the unit; the root is the "
        "base in the camera frame. Null without a URDF; the nearest that was found where `certified` is false.",
    )
    fk_distance: Maybe = Field(
        default=None, description="From the points to the forward kinematics of q, at most, in `unit`."
    )
    certified: bool | None = Field(
        description="Whether q is within the limits and places every point; false is undecided: none was found. "
        "Null without a URDF."
    )
    reason: str = Field(default="", description="Why it is not certified.")


class ObjectFrameRecord(FileModel):
    """One frame."""

    time: float = Field(description="Seconds.")
    judged: str | None = Field(
        description="exact, closed, measured or given: the tolerance; null where nothing was grown."
    )
    reason: str = Field(default="", description="Why there is nothing.")
    levels: ObjectLevels
    postures: Annotated[list[ObjectPosture], FailFast()]
    rejected: Annotated[dict[str, Count], FEW_ENTRIES] = Field(
        description="Flips lost to each reason; with the postures, all of them at all scales taken."
    )
    family: ResultFamily | None = Field(default=None, description="The scales that it can have.")


class ObjectFile(FileModel):
    """Every survivor of every frame of a view."""

    hints: ClassVar[Mapping[str, str]] = {"frames": "write the result again with posekit recover --linkage"}

    schema_: Literal["posekit.object/1"] = Field(alias="schema")
    unit: Unit | None = Field(description="Of lengths; null where they are relative.")
    linkage: str
    points: Names
    segments: Segments
    lengths: Annotated[list[float], Field(max_length=5000), FailFast()]
    configuration_names: Names
    settings: dict[str, Any]
    frames: Annotated[list[ObjectFrameRecord], Field(min_length=1), FailFast()]
