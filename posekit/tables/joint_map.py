"""``posekit.joint_map/1``: which frames of a robot stand for which points of a posture."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Final, Literal, Self

from pydantic import BeforeValidator, Discriminator, Field, Tag, model_validator

from posekit.safe_io.refusal import shown
from posekit.skeleton import POINTS
from posekit.tables.file_model import FileModel, named, refuse

MAX_SITES: Final = 16
"""Frames in one mean."""
FEWEST_POINTS: Final = 3
"""Points that a map must have: fewer do not tell how a body is turned."""


class SiteTable(FileModel):
    """A place on a frame."""

    frame: Annotated[str, Field(min_length=1)] = Field(description="A link or a joint.")
    offset: Annotated[list[float], Field(min_length=3, max_length=3)] = Field(
        default=[0.0, 0.0, 0.0], description="In the frame, metres."
    )
    weight: Annotated[float, Field(gt=0)] = 1.0


def _site(entry: Any) -> Any:
    """Take a name for the frame of that name."""
    if not isinstance(entry, str | dict | SiteTable):
        refuse(
            "a frame's name, or { frame = …, offset = [x, y, z], weight = … }", "correct it", got=shown(entry)
        )
    return {"frame": entry} if isinstance(entry, str) else entry


Site = Annotated[SiteTable, BeforeValidator(_site)]


class MeanTable(FileModel):
    """The mean of several places."""

    mean: Annotated[list[Site], Field(min_length=1, max_length=MAX_SITES)]


def _variant(entry: Any) -> str:
    return (
        "a mean"
        if isinstance(entry, MeanTable) or (isinstance(entry, dict) and "mean" in entry)
        else "a site"
    )


Place = Annotated[
    Annotated[Site, Tag("a site")] | Annotated[MeanTable, Tag("a mean")], Discriminator(_variant)
]
Places = Annotated[dict[str, Place], named(POINTS, "point")]


class JointMapTable(FileModel):
    """Which frames stand for which points."""

    tags: ClassVar[frozenset[str]] = frozenset({"a site", "a mean"})
    hints_at: ClassVar[Mapping[str, str]] = {"points": "name the joints' frames under [points]"}

    schema_: Literal["posekit.joint_map/1"] = Field(alias="schema")
    points: Places = Field(default={}, description="Points that every such model has.")
    optional: Places = Field(default={}, description="Points that are left out where their frames are.")

    @model_validator(mode="after")
    def _enough_points(self) -> Self:
        twice = sorted(set(self.points) & set(self.optional))
        if twice:
            got = "a point that is in [points] too"
            refuse("one of them", "drop one", at=f"optional.{twice[0]}", got=got)
        if len(self.points) < FEWEST_POINTS:
            got = f"{len(self.points)} points"
            refuse(f"at least {FEWEST_POINTS}", "name more joints", at="points", got=got)
        return self
