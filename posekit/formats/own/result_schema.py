"""The schemas ``posekit.result/2`` and ``/1``, as a JSON file holds them: lengths in its own unit, null for unknown."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal

from pydantic import AfterValidator, FailFast, Field

from posekit.formats.own.frame_answer import FrameAnswer
from posekit.formats.own.inferred import Inferred
from posekit.formats.own.posture_set import PostureSet
from posekit.formats.own.survivor_columns import SurvivorColumns
from posekit.formats.own.survivor_models import Count, model_of, table_model_of
from posekit.formats.own.units import Unit
from posekit.safe_io.refusal import shown
from posekit.skeleton import JOINTS
from posekit.tables.file_model import FEW_ENTRIES, FileModel, refuse

Maybe = float | None
MaybePoint = Annotated[list[Maybe], Field(min_length=3, max_length=3)]
Row = Annotated[list[float], Field(min_length=3, max_length=3)]
Matrix = Annotated[list[Row], Field(min_length=3, max_length=3)]
Names = Annotated[list[str], Field(max_length=1000), FailFast()]


def _tree_order(names: list[str]) -> list[str]:
    if tuple(names) != JOINTS:
        refuse("the 14 joints in tree order", "write them in the order neck, right_shoulder, …, left_ankle")
    return names


def _objects(entries: list[Any]) -> list[Any]:
    for index, entry in enumerate(entries):
        if not isinstance(entry, dict):
            refuse("an object", "write the result again", at=f"[{index}]", got=shown(entry))
    return entries


class ResultCamera(FileModel):
    """What was recovered of the camera; null where it is not known."""

    f: Maybe = Field(description="Lens to image plane, in `unit` (Lee & Chen's camera alone).")
    rotation: Matrix | None = Field(
        description="lee-chen: the matrix [R] of the paper's Table 2. opencv: R of p_cam = R p + t, where p "
        "is in the world if the view gives extrinsics, else in the head's frame."
    )
    position: Row | None = Field(
        description="In `unit`, in the frame of p. lee-chen: the image plane's origin. opencv: the optical "
        "centre."
    )
    residual: Maybe = Field(description="Of the reprojection: in `unit` where there is an f, else in pixels.")


class ResultLevels(FileModel):
    """Survivors per level of the tree (Lee & Chen 1985, Tables 3 and 4)."""

    joint: Names
    physical: Annotated[list[Count], Field(max_length=1000), FailFast()]
    motion: Annotated[list[Count], Field(max_length=1000), FailFast()]


ResultInferred: Any = model_of(Inferred)
"""What is known of the position of a joint that was not seen."""
ResultPosture: Any = model_of(SurvivorColumns)
"""One survivor, as the table of columns has it."""
EarlierPosture: Any = model_of(SurvivorColumns, whole=True)
"""The same in the first version, in which every survivor has every column."""
ResultSet: Any = table_model_of(PostureSet)
"""The complete set of a frame."""
ResultAnswer: Any = table_model_of(FrameAnswer)
"""What a result says of a frame first."""


class ResultMinimum(FileModel):
    """One local minimum of the constraints' residual."""

    s: float
    residual: float


class ResultCurve(FileModel):
    """The constraints' residual against the scale, the least over all flips (Taylor 2000, Figs. 7b and 8b)."""

    s: Annotated[list[float], Field(max_length=100_000), FailFast()]
    residual: Annotated[list[float], Field(max_length=100_000), FailFast()]


class ResultFamily(FileModel):
    """The scales that an uncalibrated frame can have (Taylor 2000, section 2)."""

    how: str = Field(
        description="min, likely, view, value, stature, or the constraints that fixed the scale."
    )
    bound: float = Field(description="The least scale that the lengths allow, pixels a `unit`.")
    segment: str = Field(description="The segment that sets the bound.")
    chosen: Annotated[list[float], Field(max_length=100_000), FailFast()] = Field(
        description="The scales that postures were recovered at, pixels a `unit`."
    )
    deviation: float | None = Field(
        default=None, description="Relative standard deviation of a likely scale."
    )
    minima: Annotated[list[ResultMinimum], Field(max_length=100_000), FailFast()] = Field(
        description="All local minima of the constraints' residual, best first."
    )
    curve: ResultCurve
    mirrored: Count = Field(description="How many survivors have their mirror image among the survivors.")


class ResultDepthMinimum(FileModel):
    """One local minimum of the rigid parts' misfit along the neck's ray."""

    depth: float
    residual: float


class ResultDepthCurve(FileModel):
    """The rigid parts' misfit against the neck's depth, the least over all branches."""

    depth: Annotated[list[float], Field(max_length=100_000), FailFast()]
    residual: Annotated[list[float], Field(max_length=100_000), FailFast()]


class ResultRoot(FileModel):
    """Where the body was put in depth; depths are the neck's z in the camera frame, in `unit`."""

    method: str = Field(
        description="given, head or torso (perspective-n-point), or search along the neck's ray."
    )
    chosen: Annotated[list[float], Field(max_length=100_000), FailFast()] = Field(
        description="The depths that postures were recovered at."
    )
    residual: Maybe = Field(
        description="Reprojection error in pixels, or for a search the least misfit in `unit`."
    )
    residual_unit: str = Field(description="px, or a unit of length.")
    estimate: Maybe = Field(default=None, description="The single most likely depth.")
    deviation: Maybe = Field(description="Standard deviation of the depth, to first order.")
    lower: Maybe = Field(description="Least feasible depth.")
    upper: Maybe = Field(description="Greatest feasible depth.")
    segment: str = Field(description="The segment that sets the greatest: farther away it is too short.")
    intervals: Annotated[
        list[Annotated[list[float], Field(min_length=2, max_length=2)]], Field(max_length=100_000), FailFast()
    ] = Field(description="Where the rigid parts can close within the tolerance.")
    minima: Annotated[list[ResultDepthMinimum], Field(max_length=100_000), FailFast()]
    curve: ResultDepthCurve
    note: str = Field(description="Why another method was not used, where that needs saying.")


class EarlierFrameFields(FileModel):
    """One frame of the first version."""

    time: float = Field(description="Seconds.")
    camera: ResultCamera
    levels: ResultLevels
    postures: Annotated[list[EarlierPosture], FailFast()]
    rejected: Annotated[dict[str, Count], FEW_ENTRIES] = Field(
        description="Pruned branches, by what killed them."
    )
    family: ResultFamily | None = Field(default=None, description="Uncalibrated: the scales it can have.")
    root: ResultRoot | None = Field(
        default=None, description="Calibrated, neck not given: how its depth was found."
    )
    pruned: Annotated[list[Any], AfterValidator(_objects)] | None = Field(
        default=None, description="Detail on pruned branches, an object each."
    )


class ResultFrameFields(EarlierFrameFields):
    """One frame."""

    postures: Annotated[list[ResultPosture], FailFast()] = Field(
        description="The whole bodies that are listed, of which the probabilities are."
    )
    set: ResultSet | None = Field(default=None, description="All that the frame can be.")
    unlisted: Count = Field(
        default=0, description="How many whole bodies of the set are not listed, at most."
    )
    unlisted_probability: Annotated[float, Field(ge=0, le=1)] = Field(
        default=0.0, description="What these hold at most, of the probability of all."
    )
    answer: ResultAnswer | None = Field(default=None, description="What is to be said of the frame first.")


PathPoints = Annotated[
    list[Annotated[list[MaybePoint], Field(min_length=14, max_length=14)]],
    Field(max_length=1_000_000),
    FailFast(),
]


class ResultPath(FileModel):
    """One path through all frames."""

    survivor: Annotated[list[Annotated[int, Field(ge=-1, le=2**53)]], FailFast()] = Field(
        description="The posture of each frame, from 0; -1 where the path passes the frame over."
    )
    joints: PathPoints = Field(description="Its joints, and what bridges them, in `unit`.")
    smoothed: PathPoints = Field(description="The same with smoothed distances from the camera, in `unit`.")
    interpolated: list[list[bool]] = Field(
        description="Joints that are bridged, or completed without being seen."
    )
    deviation: list[list[Maybe]] = Field(description="Standard deviation of each joint, in `unit`.")
    cost: float = Field(description="Minus the logarithm of its likelihood, but for a constant.")
    share: float = Field(description="Its share of the likelihood of these paths.")
    scale: list[Maybe] = Field(description="Uncalibrated: pixels a `unit`.")


class ResultPaths(FileModel):
    """One person through all frames: the survivors that a body can have moved along."""

    lead: Maybe = Field(
        description="Logarithm of the odds of the first path against the next that is different."
    )
    exact: bool = Field(description="Whether the first path is certain to be the cheapest.")
    apart: float = Field(description="By how much some joint is elsewhere in a different path, in `unit`.")
    compared: bool | None = Field(
        default=None, description="Whether other paths were looked for; null where that is not said."
    )
    paths: Annotated[list[ResultPath], Field(min_length=1, max_length=1000), FailFast()]


class ResultPathsTold(FileModel):
    """What an NPZ says once of all paths, as JSON text."""

    lead: Maybe
    exact: bool
    apart: float
    compared: bool | None = None


class ResultDetails(FileModel):
    """What an NPZ keeps as JSON text: families and roots of its frames, and what was inferred in postures."""

    families: list[ResultFamily | None] | None = None
    roots: list[ResultRoot | None] | None = None
    inferred: list[list[dict[str, ResultInferred]] | None] | None = None


class EarlierResultFile(FileModel):
    """Every survivor of every frame of a view."""

    hints: ClassVar[Mapping[str, str]] = {"frames": "write the result again with posekit recover"}

    schema_: Literal["posekit.result/1"] = Field(alias="schema")
    unit: Unit
    joint_names: Annotated[Names, AfterValidator(_tree_order)]
    configuration_names: Names
    settings: dict[str, Any]
    frames: Annotated[list[EarlierFrameFields], Field(min_length=1), FailFast()]
    paths: ResultPaths | None = Field(default=None, description="One person through all frames.")


class ResultFile(EarlierResultFile):
    """The set of every frame of a view, and of its whole bodies those that hold most of the probability."""

    schema_: Literal["posekit.result/2"] = Field(alias="schema")  # type: ignore[assignment]
    frames: Annotated[list[ResultFrameFields], Field(min_length=1), FailFast()]  # type: ignore[assignment]
    decimals: Annotated[int, Field(ge=0, le=15)] | None = Field(
        default=None, description="Of metres, of positions in frames whose noise is known."
    )
