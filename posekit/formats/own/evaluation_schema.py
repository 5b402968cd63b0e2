"""The schema ``posekit.evaluation/1``: how good recovery is where the truth is known."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import FailFast, Field

from posekit.tables.file_model import FileModel

EVALUATION_SCHEMA = "posekit.evaluation/1"

Count = Annotated[int, Field(ge=0)]
Share = Annotated[float, Field(ge=0, le=1)]
Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Role = Literal["best", "first", "random", "path"]
"""Whose errors: the survivor nearest to the truth, the first-ranked, one at random; and the path through a sequence."""

Event = Literal["branch", "within_35mm"]
"""What the first survivor's probability may be of: its branches are the truth's; its mean joint error is small."""


class ToleranceFields(FileModel):
    """Tolerances that were given."""

    rigid: NotNegative = Field(description="Metres.")
    tangent: NotNegative = Field(description="Metres.")
    placement: bool
    angle: NotNegative = Field(description="Degrees.")
    hips: Share = Field(description="What part of `rigid` the hips' distance may be off.")


class EvaluationSettingsFields(FileModel):
    """What decided the results; those of virtual cameras are there where motion was seen through them."""

    source: str = Field(description="The motion or the view.")
    noise_px: Annotated[list[NotNegative], Field(min_length=1)] = Field(
        description="Standard deviations of what was added to image points, pixels."
    )
    root: Literal["given", "auto"] | None = Field(
        description="Whether the neck is the true one, or placed from the image; null: as the view has it."
    )
    length_deviation: NotNegative | None = Field(
        default=None, description="How far lengths were said to be off; null: as is usual for the view."
    )
    coverage: Annotated[float, Field(gt=0, le=1)] = Field(
        default=1.0, description="Which share of the probability the postures hold that were compared."
    )
    checks: list[str]
    ranges: str
    rules: list[int]
    walkers: str
    tolerance: ToleranceFields | Literal["exact, else measured"]
    seed: Count
    ranking: str
    sequences: str | None = Field(description="How a path through each sequence was chosen; null: none was.")
    versions: dict[str, str]
    frames_per_clip: Annotated[int, Field(ge=1)] | None = None
    clips: list[str] | None = Field(default=None, description="Only these; empty for all.")
    actions: list[str] | None = Field(default=None, description="Only these; empty for all.")
    consecutive: bool | None = None
    yaws: list[float] | None = Field(default=None, description="Of the cameras, degrees.")
    heights: list[float] | None = Field(default=None, description="Of the cameras over the ground, metres.")
    distance: Positive | None = Field(default=None, description="From the body's middle, metres.")
    f: Positive | None = Field(default=None, description="Pixels.")
    size: Annotated[list[int], Field(min_length=2, max_length=2)] | None = Field(
        default=None, description="Of the pictures, pixels."
    )
    lengths: str | None = Field(default=None, description="Whose segment lengths.")
    shank_px: NotNegative | None = Field(
        default=None,
        description="The lower leg where it is parallel to the picture, pixels: noise is counted in it.",
    )


class SpreadFields(FileModel):
    """A quantity over frames; null where there is none."""

    mean: float | None
    median: float | None
    p95: float | None


class ErrorFields(FileModel):
    """Errors over the frames with survivors, millimetres: mean over the joints."""

    mpjpe: dict[Role, SpreadFields] = Field(description="Where the postures are.")
    centred: dict[Role, SpreadFields] = Field(description="The middle of the joints moved onto the truth's.")
    pa: dict[Role, SpreadFields] = Field(description="After a similarity.")


class PosesScoreFields(FileModel):
    """The area under the curve of correct poses, from 0 to 300 mm: 300 is perfect; null without survivors."""

    aligned: float | None
    placed: float | None


class CalibrationFields(FileModel):
    """How far the stated probabilities are from what happened."""

    ece: NotNegative | None = Field(description="Expected calibration error.")
    brier: NotNegative | None = Field(description="Brier score.")
    frames: Count


class ViolationFields(FileModel):
    """What independent code found in the survivors; excess is beyond what the tolerances allow, negative inside."""

    certified: Count = Field(description="Survivors that were certified.")
    lengths: Count = Field(description="Of those, with a wrong length.")
    ranges: Count = Field(description="Of those, outside a range.")
    length_excess_mm: float | None = Field(description="By how much the worst length is off.")
    range_excess_deg: float | None = Field(description="Likewise the worst angle.")
    witness_turned_deg: float | None = Field(
        description="The most between a limb's segment and that of the angles which prove it inside the ranges."
    )


class NumbersFields(FileModel):
    """The numbers of some frames: shares of all frames, those without survivors included."""

    frames: Annotated[int, Field(ge=1)]
    frames_without_survivor: Count
    retained_within_10mm: Share | None = Field(description="Frames with a survivor so near to the truth.")
    retained_within_35mm: Share | None
    retained_branch: Share | None = Field(description="Frames whose true branches survive.")
    survivors: SpreadFields
    error_mm: ErrorFields
    cps_mm: dict[Role, PosesScoreFields]
    limbs_right: dict[Role, Share | None] = Field(
        description="Of the four limbs, those that take the true branch."
    )
    bridged: Share | None = Field(
        default=None, description="Frames of followed sequences that the path passes over."
    )
    calibration: dict[Event, CalibrationFields] | None
    violations: ViolationFields


class ByNoiseFields(NumbersFields):
    """Those of one noise."""

    noise: NotNegative = Field(description="Pixels that were added.")


class ByActionFields(ByNoiseFields):
    """Those of one action and noise."""

    action: str


class ByYawFields(ByNoiseFields):
    """Those of one direction and noise."""

    yaw: float | None = Field(description="Degrees; null of a view as it is.")


class ByHeightFields(ByNoiseFields):
    """Those of one height and noise."""

    height: float | None = Field(description="Metres; null of a view as it is.")


class ConditionFields(ByActionFields, ByYawFields, ByHeightFields):
    """Those of one condition."""


class PosesCurveFields(FileModel):
    """The share of correct poses at each millimetre from 0."""

    aligned: list[float | None]
    placed: list[float | None]


class ReliabilityFields(FileModel):
    """Stated probabilities against what happened, by bins."""

    from_: list[float] = Field(alias="from", description="Lower ends.")
    frames: list[Count]
    probability: list[Share | None] = Field(description="What was stated, mean.")
    share: list[Share | None] = Field(description="Of frames in which it happened.")


class CurvesFields(FileModel):
    """Curves of one noise."""

    noise: NotNegative
    correct_poses: dict[Role, PosesCurveFields]
    reliability: dict[Event, ReliabilityFields] | None


class LostFields(FileModel):
    """What pruned the true branch, at one noise: frames by check and place, most first."""

    noise: NotNegative
    by: dict[str, Count]


class EvaluationFile(FileModel):
    """What `posekit evaluate` writes."""

    schema_: Literal["posekit.evaluation/1"] = Field(alias="schema")
    settings: EvaluationSettingsFields
    frames: Annotated[int, Field(ge=1)] = Field(
        description="Views that were recovered: frames, cameras, noises."
    )
    out_of_picture: Count = Field(description="Views left out because the person leaves the picture.")
    left_out: list[str] = Field(description="What else was left out, and why.")
    all: NumbersFields
    by_noise: list[ByNoiseFields]
    by_action: list[ByActionFields]
    by_yaw: list[ByYawFields]
    by_height: list[ByHeightFields]
    curves: list[CurvesFields]
    truth_lost_to: list[LostFields]
    conditions: Annotated[list[ConditionFields], FailFast()]
