"""``posekit.ranges/1``: joint ranges of the figure, of Lee & Chen's angles, or of a robot's own joints."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, model_validator

from posekit.safe_io.refusal import cut, nearest, shown
from posekit.skeleton import DOFS
from posekit.tables.angles import TABLE1_ANGLES
from posekit.tables.fields import Bounds
from posekit.tables.file_model import FileModel, refuse


def by_joint(table: type[FileModel], document: Any) -> Any:
    """Put the tables of joints, which stand at the top of a file, under one field: ``joints``.

    Each is named as an angle is, ``[neck]`` with ``flexion = …``: the names become ``neck.flexion``.
    """
    if not isinstance(document, dict):
        return document
    own = {field.alias or name for name, field in table.model_fields.items()}
    joints: dict[str, Any] = {}
    for joint, angles in document.items():
        if joint in own:
            continue
        if not isinstance(angles, dict):
            refuse(
                "a table such as [neck] flexion = [-55, 45]", "correct it", at=cut(joint), got=shown(angles)
            )
        joints |= {f"{joint}.{angle}": entry for angle, entry in angles.items()}
    return {**{name: document[name] for name in document if name in own}, "joints": joints}


def check_angles(given: Mapping[str, Any], known: tuple[str, ...], *, every: bool) -> None:
    """Refuse names that are no angles, and, where a table is to list every one, those that are missing."""
    for name in given:
        if name not in known:
            got = "a name that is not an angle"
            refuse(f"one of {', '.join(known)}", nearest(name, known), at=cut(name), got=got)
    missing = [name for name in known if name not in given]
    if every and missing:
        refuse("a table that lists every angle", "add them", got=f"no {', '.join(missing)}")


class RangesTable(FileModel):
    """Ranges of the figure's own angles, or of those of Lee & Chen's Table 1, degrees."""

    tags: ClassVar[frozenset[str]] = frozenset({"joints"})

    schema_: Literal["posekit.ranges/1"] = Field(alias="schema")
    kind: Literal["configuration", "rotation", "projected"]
    shortest_projection: Annotated[float, Field(ge=0, lt=1)] = Field(
        default=0.1,
        description="Kind projected: part of a segment below which its projection has no direction.",
    )
    knee_flexed: float = Field(default=5.0, description="From here on the hip's wider range holds, degrees.")
    joints: dict[str, Bounds] = Field(default={}, description="By angle: in the file a table for each joint.")

    @model_validator(mode="before")
    @classmethod
    def _by_joint(cls, document: Any) -> Any:
        return by_joint(cls, document)

    @model_validator(mode="after")
    def _known_angles(self) -> Self:
        own = self.kind == "configuration"
        table1 = tuple(f"{joint}.{angle}" for joint, angles in TABLE1_ANGLES.items() for angle in angles)
        check_angles(self.joints, DOFS if own else table1, every=not own)
        return self


class JointLimitsTable(FileModel):
    """Limits by a robot's own joint names: degrees for joints that turn, metres for those that slide."""

    hints_at: ClassVar[Mapping[str, str]] = {
        "kind": 'write kind = "joints" and a table [limits] of the robot\'s own joints',
        "limits": "write [limits] above them",
    }

    schema_: Literal["posekit.ranges/1"] = Field(alias="schema")
    kind: Literal["joints"]
    limits: Annotated[dict[str, Bounds], Field(min_length=1)]
