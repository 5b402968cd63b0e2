"""Flips given by hand, ``posekit.nearer/1``: which end of a segment is nearer to the camera (Taylor 2000, §3.1)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from pydantic import FailFast, Field

from posekit.safe_io.json_file import read_json
from posekit.tables.file_model import FEW_ENTRIES, FileModel, validated

NEARER_SCHEMA = "posekit.nearer/1"


class NearerFile(FileModel):
    """For each frame, or once for all frames, segments and the name of their nearer end."""

    hints: ClassVar[Mapping[str, str]] = {
        "frames": 'write one object a frame, or one for all: {"right_elbow-right_wrist": "right_wrist"}'
    }

    schema_: Literal["posekit.nearer/1"] = Field(alias="schema")
    frames: Annotated[list[Annotated[dict[str, str], FEW_ENTRIES]], Field(min_length=1), FailFast()] = Field(
        description="Segment, named a-b, to the name of its nearer end; one that is level or not known is left out."
    )


def read_nearer(path: str | Path) -> list[dict[str, str]]:
    """Read which ends are nearer, one mapping a frame or one for all of them.

    Raises
    ------
    InputError
        Where the file breaks the schema.
    """
    return validated(NearerFile, read_json(path), path).frames
