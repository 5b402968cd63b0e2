"""The schemas ``posekit.batch/1`` and ``posekit.batch_manifest/1``: what a batch was asked for, and how far it is."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from posekit.tables.file_model import FileModel

BATCH_SCHEMA = "posekit.batch/1"
MANIFEST_SCHEMA = "posekit.batch_manifest/1"

Count = Annotated[int, Field(ge=0)]
NotNegative = Annotated[float, Field(ge=0)]
Digest = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
"""SHA-256 of a content."""


class SourceFields(FileModel):
    """How key points were read; what is empty or null was not given."""

    format: str
    skeleton: str = Field(description="The name of a skeleton map, or the SHA-256 of one's file.")
    person: str
    swap_sides: bool
    camera: str | Annotated[list[str], Field(min_length=2, max_length=2)] = Field(
        description="A camera's file, by its SHA-256 (by name where it is no file), and its name inside."
    )
    fov: float | None = Field(description="Degrees.")
    focal35: float | None = Field(description="Millimetres.")
    size: Annotated[list[int], Field(min_length=2, max_length=2)] | None = Field(description="Pixels.")
    rate: float | None = Field(description="Frames a second.")
    minimum_confidence: float
    deviation: float | None = Field(description="Pixels.")
    stature: float | None = Field(description="Metres.")
    lengths: Digest | None
    calibrate: Digest | None
    proportions: str


class BatchSettingsFields(FileModel):
    """Everything that decides the results but the inputs; tolerances that are null were the usual ones."""

    checks: list[str]
    ranges: Annotated[list[str], Field(min_length=1, max_length=2)] = Field(
        description="Their name; of a file its path and its SHA-256."
    )
    rules: list[int]
    walkers: str
    rigid: NotNegative | None = Field(description="Metres.")
    tangent: NotNegative | None = Field(description="Metres.")
    angle: NotNegative | None = Field(description="Degrees.")
    contact_margin: float = Field(description="Metres.")
    scale: str
    proportions: str
    infer: bool
    root: str
    refine: bool | None
    length_deviation: float | None
    coverage: Annotated[float, Field(gt=0, le=1)] = 0.99
    rank: bool
    q: bool
    margins: bool
    shard_frames: Annotated[int, Field(ge=1)]
    made_with: dict[str, str] = Field(description="Versions of packages.")
    source: SourceFields
    figure: str = Field(description="A hash of the built-in figure.")


class BatchFile(FileModel):
    """What a run was asked for: ``batch.json`` of its folder."""

    schema_: Literal["posekit.batch/1"] = Field(alias="schema")
    hash: Annotated[str, Field(pattern="^[0-9a-f]{16}$")] = Field(description="Of the settings.")
    settings: BatchSettingsFields
    inputs: dict[str, Digest] = Field(description="Contents by name, below `root`.")
    root: str


class FailureFields(FileModel):
    """A shard, or an input, of which nothing came."""

    shard: str = Field(description="The file that is not there; empty where the input could not be opened.")
    input: str
    person: int | None
    frames: Annotated[list[Count], Field(min_length=2, max_length=2)] | None = Field(
        description="From which row to before which."
    )
    error: str
    attempts: Count
    killed_its_process: bool


class ManifestFile(FileModel):
    """How far a run is: ``manifest.json`` of its folder."""

    schema_: Literal["posekit.batch_manifest/1"] = Field(alias="schema")
    inputs: Count = Field(description="Those that could be opened.")
    shards: Count
    done: Count = Field(description="Shards whose file is there.")
    planned: Count = Field(description="Frames of all shards.")
    frames: Count = Field(description="Of the shards that are done.")
    survivors: Count
    empty: Count = Field(description="Frames without survivors.")
    failed: list[FailureFields]
    digests: dict[str, Digest] = Field(
        default_factory=dict,
        description="SHA-256 of each shard's file, by its name; earlier versions have none.",
    )
