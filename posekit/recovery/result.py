"""From a recovery to what is written."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from posekit.formats.own import Result, ResultFrame
from posekit.formats.own.column import columns_in
from posekit.formats.own.paths import FollowedPaths
from posekit.formats.own.survivor_columns import SURVIVOR_COLUMNS, Likelihoods
from posekit.formats.own.units import Unit
from posekit.geometry import Array
from posekit.recovery.recovery import FrameRecovery, Recovery

if TYPE_CHECKING:
    from posekit.following.following import Following


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
    return Result(
        unit=unit,
        configuration_names=recovery.figure.configuration_names,
        settings={**recovery.settings, **({"unrecovered": unrecovered} if unrecovered else {})},
        frames=[
            _frame(frame, margins, nq, explain, probability)
            for frame, probability in zip(recovery.frames, recovery.probability, strict=True)
        ],
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
        else Likelihoods(**{name: getattr(refined, name) for name in columns_in(Likelihoods)}),
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
        pruned=[_plain(asdict(branch)) for branch in frame.pruned()] if explain else None,
        family=None if frame.family is None else replace(frame.family, mirrored=frame.mirrored),
        root=frame.root,
        **values,
    )


def _plain(record: dict[str, object]) -> dict[str, object]:
    """Write infinite and unknown numbers as None: JSON has neither."""
    return {
        key: None if isinstance(value, float) and not np.isfinite(value) else value
        for key, value in record.items()
    }
