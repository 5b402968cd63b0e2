"""``posekit.posture_prior/1``: how often real postures have which directions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from posekit.tables.file_model import FileModel, refuse

LEAST_VARIANCE = 1e-9
"""Square of the smallest scale of a block: below it the matrix is as good as singular."""


class SpreadTable(FileModel):
    """How a distance that is mostly small is spread."""

    scale: float = Field(description="Metres.")
    usual: float = Field(description="The average logarithm of its density over real postures.")


class BlockTable(FileModel):
    """A t distribution of some directions, or several that share their scale."""

    directions: list[str]
    mean: list[float] | list[list[float]] = Field(
        description="Of the directions' components, three each; of a mixture one row a distribution."
    )
    share: list[Annotated[float, Field(gt=0)]] | None = Field(
        default=None, description="How much each distribution of a mixture counts; the same if left out."
    )
    scale: list[list[float]] = Field(description="The lower triangle of their scale matrix, row by row.")
    conditional: bool = Field(default=False, description="Whether only `up` is judged, given the others.")

    @model_validator(mode="after")
    def _sizes_fit(self) -> Self:
        size = 3 * len(self.directions)
        rows: list[list[float]] = [row for row in self.mean if isinstance(row, list)]
        counts = [len(row) for row in rows] or [len(self.mean)]
        for count in counts:
            if count != size:
                refuse(f"{size} numbers, 3 a direction", "correct it", at="mean", got=f"{count} numbers")
        if self.share is not None and len(self.share) != len(counts):
            refuse("one share a row of mean", "correct it", at="share", got=f"{len(self.share)} shares")
        if [len(row) for row in self.scale] != list(range(1, size + 1)):
            got = f"{len(self.scale)} rows"
            refuse(f"{size} rows of 1, 2, … {size} numbers", "correct it", at="scale", got=got)
        if size and not float(np.linalg.eigvalsh(self.matrix)[0]) > LEAST_VARIANCE:
            refuse("variances", "correct it", at="scale", got="a matrix that is not positive definite")
        return self

    @property
    def matrix(self) -> np.ndarray:
        """The whole scale matrix (3 D, 3 D)."""
        lower = np.zeros((len(self.scale), len(self.scale)))
        for i, row in enumerate(self.scale):
            lower[i, : i + 1] = row
        return lower + np.tril(lower, -1).T


class PriorTable(FileModel):
    """A prior of postures."""

    hints_at: ClassVar[Mapping[str, str]] = {"block": "give directions, mean and scale in each [[block]]"}

    schema_: Literal["posekit.posture_prior/1"] = Field(alias="schema")
    source: str = ""
    dof: Annotated[float, Field(gt=0, le=1e6)] = Field(description="Degrees of freedom of the distributions.")
    temperature: float = Field(description="Metres.")
    image_temperature: Annotated[float, Field(gt=0)] | None = Field(default=None, description="Metres.")
    weights: dict[str, float]
    refined: dict[str, float] | None = Field(default=None, description="Weights of refined survivors.")
    balance: SpreadTable
    contact: SpreadTable
    block: Annotated[list[BlockTable], Field(min_length=1, max_length=100)]
