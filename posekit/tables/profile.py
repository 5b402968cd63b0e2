"""``posekit.profile/1``: which checks over time are asked, and their thresholds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from posekit.tables.fields import Name
from posekit.tables.file_model import FileModel


class ProfileTable(FileModel):
    """Thresholds by check: in the file a table for each, ``[checks.speed]``."""

    hints_at: ClassVar[Mapping[str, str]] = {
        "checks": "write a table [checks.NAME] for each check that is to be asked",
    }

    schema_: Literal["posekit.profile/1"] = Field(alias="schema")
    source: str = Field(default="", description="Whose thresholds they are: a citation.")
    checks: Annotated[dict[Name, dict[str, float | int | str]], Field(min_length=1)]
