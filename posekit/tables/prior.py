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
    """A t distribution of some directions."""

    directions: list[str]
    mean: list[float] = Field(description="Of the directions' components, three each.")
    scale: list[list[float]] = Field(description="The lower triangle of their scale matrix, row by row.")

    @model_validator(mode="after")
    def _sizes_fit(self) -> Self:
        size = 3 * len(self.directions)
        if len(self.mean) != size:
            refuse(f"{size} numbers, 3 a direction", "correct it", at="mean", got=f"{len(self.mean)} numbers")
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
    weights: dict[str, float]
    balance: SpreadTable
    contact: SpreadTable
    block: Annotated[list[BlockTable], Field(min_length=1, max_length=100)]
