"""The schema ``posekit.configurations/1``: postures given as configurations of a robot, as a JSON file holds them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import FailFast, Field

from posekit.tables.file_model import FileModel

CONFIGURATIONS_SCHEMA = "posekit.configurations/1"
MOST_VARIABLES = 1000
"""Variables of one configuration: a robot has at most 1000 links."""

Row = Annotated[list[float], Field(max_length=MOST_VARIABLES), FailFast()]


class ConfigurationsFile(FileModel):
    """Configurations of one robot: radians, metres, quaternions as x, y, z, w."""

    hints: ClassVar[Mapping[str, str]] = {"q": "a configuration is a list of finite numbers, one a variable"}

    schema_: Literal["posekit.configurations/1"] = Field(alias="schema")
    configuration_names: Annotated[list[str], Field(max_length=MOST_VARIABLES)] | None = Field(
        default=None,
        description="The variables in the file's order; the robot's own order where they are not named.",
    )
    q: Annotated[list[Row], FailFast()]
