"""From a recovery to what is written."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.formats.own import Result, ResultFrame
from posekit.formats.own.column import Column, columns_in
from posekit.formats.own.frame_answer import FrameAnswer
from posekit.formats.own.paths import FollowedPaths
from posekit.formats.own.survivor_columns import SURVIVOR_COLUMNS, Likelihoods
from posekit.formats.own.units import Unit
from posekit.geometry import Array
from posekit.recovery.recovery import FrameRecovery, Recovery

if TYPE_CHECKING:
    from posekit.answers import Answer, JointRegions
    from posekit.following.following import Following

LIKELIHOOD_COLUMNS: Final = columns_in(Likelihoods)

MAX_DETAILED: Final = 5
"""Representatives of a refined frame of which a result has all columns, where it does not list everything."""


def result_of(
    recovery: Recovery, *, unit: Unit = "m", explain: bool = False, following: Following | None = None
) -> Result:
    """Gather a recovery for `posekit.write_result`.

    Parameters
    ----------
    recovery : Recovery
        What `posekit.recover` returned.
    unit : {"m", "cm", "mm"}
        Of lengths in the file.
    explain : bool
        Whether to list every pruned branch with the finding that killed it.
    following : Following, optional
        Paths through the frames (`posekit.recovery.sequences.follow`).
    """
    margins = list(dict.fromkeys(name for frame in recovery.frames for name in frame.margins))
    nq = recovery.figure.model.nq
    unrecovered = recovery.unrecovered
    every = recovery.settings["asked"]["coverage"] == 1.0
    frames = [
        replace(
            _detailed(
                _frame(frame, margins, nq, explain, probability),
                None if every or frame.refined is None else answer.rows[:MAX_DETAILED],
            ),
            answer=_answer(answer, regions=frame.refined is not None),
        )
        for frame, probability, answer in zip(
            recovery.frames, recovery.probability, recovery.answers, strict=True
        )
    ]
    settings = {**recovery.settings, **({"unrecovered": unrecovered} if unrecovered else {})}
    return Result(
        unit=unit,
        configuration_names=recovery.figure.configuration_names,
        settings=settings,
        frames=frames,
        paths=None if following is None else _paths(following),
    )


def _paths(following: Following) -> FollowedPaths:
    """Gather paths for a file: what is infinite is not known."""
    unknown = np.full(following.survivor.shape, np.nan)
    calibrated = following.scale is None
    smoothed = [following.smoothed(k) for k in range(len(following))] if calibrated else None
    return FollowedPaths(
        survivor=following.survivor.astype(np.int64),
        joints=following.joints,
        smoothed=np.full(following.joints.shape, np.nan) if smoothed is None else np.stack(smoothed),
        interpolated=following.interpolated,
        deviation=np.where(np.isfinite(following.deviation), following.deviation, np.nan),
        cost=following.cost,
        share=following.share,
        scale=unknown if following.scale is None else following.scale,
        lead=following.lead if np.isfinite(following.lead) else np.nan,
        exact=following.exact,
        apart=following.apart,
        compared=not np.isnan(following.lead),
    )


def _frame(
    frame: FrameRecovery, margins: list[str], nq: int, explain: bool, probability: Array
) -> ResultFrame:
    own = frame.margins
    refined = frame.refined
    values: dict[str, Any] = {
        "q": frame.q.reshape(-1, nq),
        "margins": {
            name: np.where(np.isinf(own[name]), np.nan, own[name]) if name in own else np.empty(0)
            for name in margins
        },
        "probability": probability,
        "refined": None
        if refined is None
        else Likelihoods(**{name: getattr(refined, name) for name in LIKELIHOOD_COLUMNS}),
    }
    values |= {name: getattr(frame, name) for name in SURVIVOR_COLUMNS if name not in values}
    return ResultFrame(
        time=frame.time,
        camera=frame.camera,
        levels={
            "joint": frame.level_names,
            **{name: counts.tolist() for name, counts in frame.levels.items()},
        },
        rejected=frame.rejected,
        pruned=[_plain(vars(branch)) for branch in frame.pruned()] if explain else None,
        family=None if frame.family is None else replace(frame.family, mirrored=frame.mirrored),
        root=frame.root,
        posture_set=frame.posture_set,
        unlisted=frame.unlisted,
        unlisted_probability=frame.unlisted_probability,
        **values,
    )


def _answer(answer: Answer, *, regions: bool) -> FrameAnswer:
    """Gather what is to be said of a frame first; regions where joints are not just where they are listed."""
    said: dict[str, Any] = {
        "representatives": answer.rows,
        "probability": answer.probability,
        "near": answer.depth.near,
        "far": answer.depth.far,
    }
    return FrameAnswer(**said | (_regions(answer.regions) if regions else NO_REGIONS))


def _regions(regions: JointRegions) -> dict[str, Array]:
    """Gather where each joint is."""
    # Modes that are nowhere as dense as the region's edge are no part of it.
    reached = regions.radius > 0
    order = np.argsort(~reached, axis=1, kind="stable")[:, : int(reached.sum(axis=1).max(initial=0))]

    def modes(values: Array, unknown: float) -> Array:
        beside = (1,) * (values.ndim - 2)
        known = np.where(reached.reshape(*reached.shape, *beside), values, unknown)
        return np.moveaxis(np.take_along_axis(known, order.reshape(*order.shape, *beside), axis=1), 1, 0)

    return {
        "region_mean": modes(regions.mean, np.nan),
        "region_covariance": modes(regions.covariance, np.nan),
        "region_probability": modes(regions.probability, 0.0),
        "region_level": regions.level,
    }


NO_REGIONS: Final[dict[str, Array]] = {
    "region_mean": np.empty((0, 14, 3)),
    "region_covariance": np.empty((0, 14, 3, 3)),
    "region_probability": np.empty((0, 14)),
    "region_level": np.full(14, np.nan),
}
"""Of frames whose image is exact."""


def _detailed(frame: ResultFrame, rows: NDArray[np.intp] | None) -> ResultFrame:
    """Leave details to some survivors, None for all: of the others they are not known."""
    if rows is None:
        return frame
    others = np.ones(len(frame), dtype=np.bool_)
    others[rows] = False
    refined = frame.refined
    return replace(
        frame,
        **_without(frame, SURVIVOR_COLUMNS, others),
        refined=None
        if refined is None
        else replace(refined, **_without(refined, LIKELIHOOD_COLUMNS, others)),
    )


def _without(table: Any, columns: Mapping[str, Column], others: NDArray[np.bool_]) -> dict[str, Any]:
    """Return the details of a table, not known of some of its survivors."""
    found: dict[str, Any] = {}
    for name, column in columns.items():
        values = getattr(table, name)
        if not column.detail or values is None:
            continue
        if column.kind == "objects":
            found[name] = [{} if gone else one for one, gone in zip(values, others, strict=True)]
        elif column.by_check:
            found[name] = {check: np.where(others, np.nan, each) for check, each in values.items()}
        else:
            found[name] = np.where(others.reshape(-1, *[1] * (np.ndim(values) - 1)), np.nan, values)
    return found


def _plain(record: dict[str, object]) -> dict[str, object]:
    """Write infinite and unknown numbers as None: JSON has neither."""
    return {
        key: None if isinstance(value, float) and not math.isfinite(value) else value
        for key, value in record.items()
    }
