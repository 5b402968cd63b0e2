"""What a survivor is, once: the table of its columns.

Each field is one. From this table follow JSON (`posekit.formats.own.result_json`), NPZ
(`posekit.formats.own.result_npz`), the published schema (`posekit.formats.own.result_schema`), the Parquet of batches
(`posekit.batch.columns`) and flat tables of survivors (`posekit.recovery.result_sequence`): a new column is one
field here, and a property of the same name where it is calculated (`posekit.recovery.recovery.FrameRecovery`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from posekit.display.short_repr import ShortRepr
from posekit.formats.own.column import column, columns_in
from posekit.formats.own.inferred import Inferred
from posekit.geometry import Array
from posekit.skeleton import JOINTS

JOINTS_SHAPE: Final = (len(JOINTS), 3)


@dataclass(frozen=True, kw_only=True, eq=False)
class Likelihoods:
    """What refinement says of N survivors: a table of columns, in memory in metres, NaN where nothing is known."""

    schema_title: ClassVar = ("ResultRefined", "How likely and how sure a survivor is that was refined.")

    chi2: Array = column(
        "Sum of squares of what is off over its standard deviations.", digits=5, batch_place=4
    )
    dof: Array = column("Its degrees of freedom.", whole=True)
    p: Array = column(
        "The probability that noise alone gives a chi2 as large.", digits=5, detail=True, null="number"
    )
    merged: Array = column("How many other branches became the same posture.", whole=True)
    covariance: Array = column(
        "Of every joint: xx, xy, xz, yy, yz, zz, in the square of `unit`.",
        shape=(len(JOINTS), 6),
        length_power=2,
        symmetric=True,
        detail=True,
        null="row",
    )
    size: Array | None = column(
        "By what factor the body is larger than the lengths say, as its neck's depth tells; 1 where nothing does.",
        digits=6,
        detail=True,
        null="number",
        default=None,
    )
    size_deviation: Array | None = column(
        "Standard deviation of the logarithm of that, beside what the covariance has of it.",
        digits=5,
        detail=True,
        null="number",
        default=None,
    )

    def __post_init__(self) -> None:
        for name, each in columns_in(Likelihoods).items():
            values = getattr(self, name)
            if values is not None:
                object.__setattr__(self, name, each.checked(values, len(self.chi2), "refined."))

    def __len__(self) -> int:
        """Count the survivors."""
        return len(self.chi2)

    @staticmethod
    def unknown(count: int) -> Likelihoods:
        """Say of some survivors that nothing is known."""
        number = np.full(count, np.nan)
        covariance = np.full((count, len(JOINTS), 3, 3), np.nan)
        return Likelihoods(
            chi2=number,
            dof=number,
            p=number,
            merged=number,
            covariance=covariance,
            size=number,
            size_deviation=number,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class SurvivorColumns(ShortRepr):
    """The N survivors of one frame: a table of columns, in memory in metres and radians, in arrays (N, …)."""

    schema_title: ClassVar = ("ResultPosture", "One survivor.")

    joints: Array = column(
        "In tree order, OpenCV camera frame, in `unit`.",
        shape=JOINTS_SHAPE,
        length_power=1,
        decimals=0,
        null="number",
    )
    q: Array = column(
        "Configuration in Pinocchio's order: metres and radians whatever the unit.",
        shape=(None,),
        decimals=1,
        detail=True,
        null="number",
        flat_prefix="q",
        batch_place=7,
        asked_by="q",
    )
    branches: Sequence[str] = column("Near (0) or far (1), segment by segment.", kind="str", longest=64)
    groups: NDArray[np.int64] | None = column(
        "The group of similar survivors it is in.", key="group", kind="int", everywhere=True, default=None
    )
    margins: Mapping[str, Array] = column(
        "By validator: the distance to the nearest bound, in the validator's own unit.",
        by_check=True,
        digits=5,
        detail=True,
        null="number",
        flat_prefix="margin",
        batch_place=5,
        asked_by="margins",
        in_motion=True,
    )
    fk_distance: Array = column(
        "From the joints to the forward kinematics of q, in `unit`.",
        length_power=1,
        digits=5,
        detail=True,
        null="number",
        batch_place=6,
        asked_by="q",
    )
    length_residual: Array = column(
        "Length lost where a ray is tangent, in `unit`.",
        length_power=1,
        digits=5,
        detail=True,
        null="number",
        batch_place=3,
        in_motion=True,
    )
    scales: Array | None = column(
        "Uncalibrated: pixels a `unit` that it was recovered at.",
        key="scale",
        digits=7,
        length_power=-1,
        null="number",
        batch_place=2,
        default=None,
    )
    inferred: Sequence[Mapping[str, Inferred]] | None = column(
        "Joints that were not seen; those of `joints` are in the middle of their sets.",
        kind="objects",
        of=Inferred,
        detail=True,
        default=None,
    )
    probability: Array | None = column(
        "That it is the one nearest to the truth; over a frame they sum to one.",
        digits=5,
        lower=0,
        upper=1,
        everywhere=True,
        batch_place=1,
        asked_by="rank",
        default=None,
    )
    refined: Likelihoods | None = column(
        "How likely and how sure, where the noise is known.", kind="table", of=Likelihoods, default=None
    )

    def __post_init__(self) -> None:
        count = len(self.joints)
        for name, each in columns_in(SurvivorColumns).items():
            values = getattr(self, name)
            if values is not None:
                object.__setattr__(self, name, each.checked(values, count))

    def __len__(self) -> int:
        """Count the survivors."""
        return len(self.joints)

    @property
    def chi2(self) -> Array | None:
        """How badly each survivor fits what was seen (N,), where they were refined."""
        return None if self.refined is None else self.refined.chi2


SURVIVOR_COLUMNS: Final = columns_in(SurvivorColumns)
"""The columns of a survivor by name, in the order in which JSON holds them."""
