"""The schema ``posekit.postures/1``, as a JSON file holds it: in its own unit, null for an unknown joint."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import AfterValidator, FailFast, Field

from posekit.formats.own.units import Unit
from posekit.safe_io.refusal import nearest, shown
from posekit.skeleton import POINTS
from posekit.tables.file_model import FileModel, refuse

POSTURES_SCHEMA = "posekit.postures/1"


def check_joint_names(names: list[str]) -> list[str]:
    """Refuse names that are unknown or repeated."""
    seen = set()
    for index, name in enumerate(names):
        if name not in POINTS:
            refuse("the name of a joint", nearest(name, POINTS), at=f"[{index}]", got=shown(name))
        if name in seen:
            refuse("each joint once", "remove one of the two", at=f"[{index}]", got=f"{shown(name)} again")
        seen.add(name)
    return names


MaybePoint = Annotated[list[float | None], Field(min_length=3, max_length=3)]
Posture = Annotated[list[MaybePoint | None], Field(max_length=len(POINTS)), FailFast()]
JointNames = Annotated[
    list[str],
    Field(min_length=1, max_length=len(POINTS), json_schema_extra={"items": {"enum": list(POINTS)}}),
    AfterValidator(check_joint_names),
]


class PosturesFile(FileModel):
    """Postures of one person, in any frame."""

    hints: ClassVar[Mapping[str, str]] = {
        "postures": "a joint is [x, y, z] in the file's unit, or null where it is not known",
        "joint_names": "name each joint of a posture once, in the order of its points",
    }

    schema_: Literal["posekit.postures/1"] = Field(alias="schema")
    unit: Unit
    joint_names: JointNames = Field(
        description="The joints of a posture in the file's order; those that are left out are unknown."
    )
    postures: Annotated[list[Posture], FailFast()]
