"""The schema ``posekit.report/1``: what each check found in each posture."""

from __future__ import annotations

from typing import Annotated, Any, Final, Literal, get_args

from pydantic import FailFast, Field

from posekit.tables.file_model import FEW_ENTRIES, FileModel

REPORT_SCHEMA = "posekit.report/1"

Verdict = Literal["valid", "invalid", "undecided"]
VERDICT_NAMES: Final[tuple[Verdict, ...]] = get_args(Verdict)


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


class WorstFields(FileModel):
    """The place with the least margin of a posture; a centimetre counts as one degree."""

    check: str
    where: str
    margin: float
    unit: str
    value: float | None = Field(default=None, description="What was found there, in `unit`.")
    bound: float | None = Field(default=None, description="The bound that it is nearest to.")


class SpanFields(FileModel):
    """Neighbouring frames of a clip that one check rejects, or says nothing about."""

    check: str
    where: str = Field(description="The worst place; empty where the check says nothing.")
    unit: str
    verdict: Literal["invalid", "undecided"]
    first: Annotated[int, Field(ge=0)] = Field(description="Its first frame, counted from 0 in the clip.")
    last: Annotated[int, Field(ge=0)] = Field(description="Its last frame, of the span too.")
    frames: Annotated[int, Field(ge=1)] = Field(description="How many of them are rejected or undecided.")
    worst_frame: Annotated[int, Field(ge=0)]
    start: float | None = Field(default=None, description="Seconds of the first frame.")
    end: float | None = Field(default=None, description="Seconds of the last frame.")
    value: float | None = Field(default=None, description="What was found in the worst frame, in `unit`.")
    bound: float | None = Field(default=None, description="The bound that it is beyond.")
    margin: float | None = Field(default=None, description="By how much; negative.")
    places: list[str] = Field(default=[], description="All its places, the worst first; ten at most.")


class ClipFields(FileModel):
    """One clip."""

    file: str
    clip: str = Field(description="Its name in the file; empty where it has none.")
    verdict: Verdict
    frames: Annotated[int, Field(ge=0)]
    invalid: Annotated[int, Field(ge=0)] = Field(description="Frames that are rejected.")
    undecided: Annotated[int, Field(ge=0)]
    seconds: float | None = None
    first_frame: Annotated[int, Field(ge=0)] | None = Field(
        default=None, description="The first frame that is not valid."
    )
    first_by: list[str] = Field(default=[], description="What does not let it pass: check/where.")
    good: Annotated[list[int], Field(max_length=2)] = Field(
        default=[],
        description="First and last frame of the longest span of valid frames; empty where none is.",
    )
    spans: Annotated[list[SpanFields], FailFast()] = Field(
        default=[], description="What is behind the verdict, the worst first."
    )
    more_spans: Annotated[int, Field(ge=0)] = Field(default=0, description="Spans that are not listed.")


class PostureFields(FileModel):
    """One posture."""

    verdict: Verdict
    fk_distance: float | None = Field(
        description="Metres from the posture to the figure's nearest configuration; null where there is none."
    )
    findings: Annotated[list[FindingFields], FailFast()]
    index: Annotated[int, Field(ge=0)] | None = Field(
        default=None, description="Which posture of the file, from 0; absent where all are listed."
    )
    worst: WorstFields | None = None
    residual: dict[str, float | None] | None = Field(
        default=None,
        description="Metres that each joint of the robot's fit is off; null where it is unknown.",
    )
    undecided_by: list[str] | None = Field(
        default=None,
        description="Of an undecided posture: checks that say nothing; joints, where some are unknown.",
    )
    clip: Annotated[int, Field(ge=0)] | None = Field(
        default=None, description="Which of `clips` it is of, from 0."
    )
    frame: Annotated[int, Field(ge=0)] | None = Field(
        default=None, description="Its frame in that clip, from 0."
    )
    time: float | None = Field(default=None, description="Seconds.")


class SummaryFields(FileModel):
    """How many postures have each verdict."""

    valid: Annotated[int, Field(ge=0)]
    invalid: Annotated[int, Field(ge=0)]
    undecided: Annotated[int, Field(ge=0)]


class CheckFields(FileModel):
    """What one check said about the file."""

    rejected: Annotated[int, Field(ge=0)] = Field(description="Postures that it rejects.")
    undecided: Annotated[int, Field(ge=0)] = Field(description="Postures about which it says nothing.")
    places: Annotated[dict[str, int], FEW_ENTRIES] = Field(
        description="Violations by place, the most frequent first."
    )


class RepairSpanFields(FileModel):
    """A joint, or the body, that was moved in neighbouring frames."""

    remedy: str = Field(description="What was done: turned, interpolated, shifted back.")
    place: str
    first: Annotated[int, Field(ge=0)]
    last: Annotated[int, Field(ge=0)] = Field(description="Its last frame, of the span too.")
    most: float = Field(description="The most by which it was moved, in `unit`.")
    unit: str


class LeftFields(FileModel):
    """What a fresh validation of the repaired file still rejects."""

    frame: Annotated[int, Field(ge=0)]
    check: str
    place: str
    left: float = Field(description="How far it is beyond its bound, in `unit`.")
    unit: str


class RepairFields(FileModel):
    """What was changed in a clip, and what is left."""

    file: str
    written: str = Field(description="The repaired file.")
    clip: str = Field(description="Its name in the file; empty where it has none.")
    frames: Annotated[int, Field(ge=0)]
    changed: Annotated[int, Field(ge=0)]
    valid: Annotated[int, Field(ge=0)] = Field(description="Frames of the repaired file that are valid.")
    spans: Annotated[list[RepairSpanFields], FailFast()]
    left: Annotated[list[LeftFields], FailFast()]


class ReportFile(FileModel):
    """The verdict on every posture of a file, with the findings behind it."""

    schema_: Literal["posekit.report/1"] = Field(alias="schema")
    settings: dict[str, Any]
    summary: SummaryFields
    checks: Annotated[dict[str, CheckFields], FEW_ENTRIES] | None = None
    listed: str | None = Field(default=None, description="Which postures are listed, where not all are.")
    verdicts: Annotated[str, Field(pattern="^[viu]*$")] | None = Field(
        default=None, description="One letter for every posture of the file, where not all are listed."
    )
    refused: list[str] = Field(
        default=[], description="Of several files those that could not be judged, each with why."
    )
    clips: Annotated[list[ClipFields], FailFast()] = Field(
        default=[], description="Of frames in time: the verdict on every clip."
    )
    repair: Annotated[list[RepairFields], FailFast()] = Field(
        default=[], description="Of a repair, what was changed in each clip and what is left."
    )
    postures: Annotated[list[PostureFields], FailFast()]
