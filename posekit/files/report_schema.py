"""The schema ``posekit.report/1``: what each check found in each posture."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import FailFast, Field

from posekit.files.validation import FileModel

SCHEMA = "posekit.report/1"

Verdict = Literal["valid", "invalid", "undecided"]


class FindingFields(FileModel):
    """One judged quantity."""

    check: str = Field(description="The validator, joint_range.")
    where: str = Field(description="The place it judged, right_elbow.flexion.")
    value: float | None = Field(description="What was found, in `unit`; null where it is undecided.")
    lower: float | None = Field(description="The lower bound; null where there is none.")
    upper: float | None = Field(description="The upper bound; null where there is none.")
    margin: float | None = Field(
        description="Distance to the nearer bound, negative outside; null if undecided."
    )
    unit: str
    verdict: Verdict


class PostureFields(FileModel):
    """One posture."""

    verdict: Verdict
    fk_distance: float | None = Field(
        description="Metres from the posture to the figure's nearest configuration; null where there is none."
    )
    findings: Annotated[list[FindingFields], FailFast()]


class SummaryFields(FileModel):
    """How many postures have each verdict."""

    valid: Annotated[int, Field(ge=0)]
    invalid: Annotated[int, Field(ge=0)]
    undecided: Annotated[int, Field(ge=0)]


class ReportFile(FileModel):
    """The verdict on every posture of a file, with the findings behind it."""

    schema_: Literal["posekit.report/1"] = Field(alias="schema")
    settings: dict[str, Any]
    summary: SummaryFields
    postures: Annotated[list[PostureFields], FailFast()]
