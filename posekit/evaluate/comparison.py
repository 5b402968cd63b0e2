"""How far the survivors are from the truth: the best, the first-ranked, the path, and how many there are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from posekit.display.plural import plural
from posekit.formats.markdown import table_lines
from posekit.formats.own import Result, ResultFrame
from posekit.formats.own.frame_answer import likeliest_order
from posekit.geometry import Array
from posekit.measures import mpjpe, pa_mpjpe
from posekit.recovery.ranked import probabilities
from posekit.recovery.recovered import recovered_with
from posekit.recovery.recovery import FrameRecovery, Recovery
from posekit.skeleton import JOINT

MEASURE_LABELS: Final = ("where it is", "moved to the true middle", "turned and scaled onto it")


@dataclass(frozen=True, kw_only=True, eq=False)
class Comparison:
    """Errors of F frames in three measures: mean distance of the joints that are known in both, and were seen, metres.

    The measures: in the camera frame as it is; after moving the middle of its joints onto the truth's; after a
    similarity (`posekit.measures.pa_mpjpe`).

    Parameters
    ----------
    survivors : int array (F,)
        How many survivors each frame has.
    best, first, middle, path : array (F, 3)
        Of the best survivor by that measure, of the one that the answer begins with, the median over all, and of the
        first path where the person was followed; NaN where there is none or no truth.
    """

    survivors: Array
    best: Array
    first: Array
    middle: Array
    path: Array

    @property
    def lines(self) -> list[str]:
        """The report: millimetres, over frames."""
        known = np.isfinite(self.best[:, 0])
        if not known.any():
            return ["no frame has both survivors and a truth"]
        rows = []
        told = {
            "best of N": self.best,
            "first-ranked": self.first,
            "path": self.path,
            "median of N": self.middle,
        }
        told = {name: values for name, values in told.items() if np.isfinite(values).any()}
        for k, name in enumerate(MEASURE_LABELS):
            row = [name]
            for values in told.values():
                median, most = np.nanquantile(values[:, k] * 1000, (0.5, 0.95))
                row.append(f"{median:.0f} / {most:.0f}")
            rows.append(row)
        counts = self.survivors[known]
        return [
            f"against the truth, {int(known.sum())} of {plural(len(known), 'frame')} (median / 95 %); N "
            "survivors: median "
            f"{np.median(counts):g}, 95 % {np.quantile(counts, 0.95):g}",
            *table_lines(["mean joint error, mm", *told], rows),
        ]


def compare(recovery: Recovery | Result, truth: Array) -> Comparison:
    """Compare the survivors of every frame with the truth (F, 14, 3), camera frame, metres."""
    frames: Sequence[FrameRecovery | ResultFrame] = recovery.frames
    count = len(frames)
    found = {name: np.full((count, 3), np.nan) for name in ("best", "first", "middle", "path")}
    first, path = _first(recovery), None
    if isinstance(recovery, Result) and recovery.paths is not None:
        path = recovery.paths.joints[0]
    for k, frame in enumerate(frames):
        joints = frame.joints
        known = np.isfinite(truth[k, :, 0])
        # What was not seen is inferred, one of many places: its distance says nothing of the picture.
        known[[JOINT[name] for name in (frame.inferred or [{}])[0]]] = False
        true = np.where(known[:, None], truth[k], np.nan)
        if path is not None and (np.isfinite(path[k, :, 0]) & known).any():
            found["path"][k] = np.stack(_errors(path[k][None], true), axis=-1)[0]
        both = np.isfinite(joints[..., 0]) & known
        if not both.any(axis=1).all() or not len(
            frame
        ):  # the joints that are known are the same in all survivors
            continue
        errors = np.stack(_errors(joints, true), axis=-1)
        found["best"][k] = np.nanmin(errors, axis=0)
        found["first"][k] = errors[first[k]]
        found["middle"][k] = np.nanmedian(errors, axis=0)
    return Comparison(survivors=np.array([len(frame) for frame in frames]), **found)


def _first(recovery: Recovery | Result) -> list[int]:
    """Return which survivor of each frame its answer begins with; 0 where it has none."""
    if isinstance(recovery, Recovery):
        return [int(answer.rows[0]) if len(answer) else 0 for answer in recovery.answers]
    probability = probabilities(recovery, recovered_with(recovery).figure.lengths)
    return [
        int(likeliest_order(each, frame.answer)[0]) if len(frame) else 0
        for each, frame in zip(probability, recovery.frames, strict=True)
    ]


def _errors(joints: Array, truth: Array) -> tuple[Array, Array, Array]:
    """Return the three measures of all survivors (N,)."""
    target = np.broadcast_to(truth, joints.shape)
    shift = np.nanmean(np.where(np.isnan(joints), np.nan, target) - joints, axis=1, keepdims=True)
    return (
        mpjpe(joints, target).value,
        mpjpe(joints + shift, target).value,
        pa_mpjpe(joints, target).value,
    )
