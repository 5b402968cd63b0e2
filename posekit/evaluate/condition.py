"""The numbers of one condition: what is told of its frames."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.evaluate.evaluated_frames import EvaluatedFrames
from posekit.evaluate.scores import correct_poses, correct_poses_score, reliability
from posekit.evaluate.work import SURVIVOR_ROLES
from posekit.geometry import Array

NEAR_METRES: Final = 0.010
"""Metres of mean joint error within which a survivor is the truth."""

NEAR_NOISY: Final = 0.035
"""The same where image points carry noise."""

TOLD_ERRORS: Final = ("mpjpe", "centred", "pa")


def roles_of(frames: EvaluatedFrames) -> tuple[str, ...]:
    """Return whose errors there are: without a choice through sequences there is no path."""
    followed = np.isfinite(frames.error("path", "mpjpe")).any()
    return SURVIVOR_ROLES if followed else SURVIVOR_ROLES[:-1]


def numbers(frames: EvaluatedFrames, rows: NDArray[np.intp]) -> dict[str, Any]:
    """Return the numbers of some frames, plain: shares of 1, millimetres, degrees; None where there is nothing to tell.

    Shares are of all frames, those without survivors included; errors are means, medians and 95 % over frames that
    have survivors.
    """
    found = frames.measured
    survivors = found.survivors[rows]
    best = frames.error("best", "mpjpe")[rows]
    branch = found.branch[rows]
    return {
        "frames": len(rows),
        "frames_without_survivor": int((survivors == 0).sum()),
        "retained_within_10mm": plain((best <= NEAR_METRES).mean()),
        "retained_within_35mm": plain((best <= NEAR_NOISY).mean()),
        "retained_branch": _mean(branch),
        "survivors": {
            "mean": plain(survivors.mean()),
            "median": plain(np.median(survivors)),
            "p95": plain(np.quantile(survivors, 0.95)),
        },
        "error_mm": _errors(frames, rows),
        "cps_mm": {
            role: {
                "aligned": plain(correct_poses_score(frames.error(role, "worst_pa")[rows])),
                "placed": plain(correct_poses_score(frames.error(role, "worst")[rows])),
            }
            for role in roles_of(frames)
        },
        "limbs_right": {role: _mean(found.limbs[role][rows]) for role in roles_of(frames)},
        **({"bridged": _mean(found.bridged[rows])} if "path" in roles_of(frames) else {}),
        "calibration": _calibration(frames, rows),
        "violations": {
            "certified": int(found.certified["all"][rows].sum()),
            "lengths": int(found.certified["lengths"][rows].sum()),
            "ranges": int(found.certified["ranges"][rows].sum()),
            "length_excess_mm": _most(found.excess["length"][rows] * 1000),
            "range_excess_deg": _most(found.excess["angle"][rows]),
            "witness_turned_deg": _most(found.excess["turned"][rows]),
        },
    }


def curves(frames: EvaluatedFrames, rows: NDArray[np.intp]) -> dict[str, Any]:
    """Return the curves of some frames: correct poses at each millimetre from 0 to 300, and the reliability table."""
    return {
        "correct_poses": {
            role: {
                "aligned": plains(correct_poses(frames.error(role, "worst_pa")[rows])),
                "placed": plains(correct_poses(frames.error(role, "worst")[rows])),
            }
            for role in roles_of(frames)
        },
        "reliability": _tables(frames, rows),
    }


def lost_to(frames: EvaluatedFrames, rows: NDArray[np.intp]) -> dict[str, int]:
    """Count what pruned the true branch, most first."""
    return dict(
        Counter(frames.measured.killer[k] for k in rows.tolist() if frames.measured.killer[k]).most_common()
    )


def plain(value: float) -> float | None:
    """Return a number as JSON has it, six digits of it; None where it is none."""
    return float(f"{float(value):.6g}") if math.isfinite(value) else None


def plains(values: Array) -> list[float | None]:
    """Return numbers as JSON has them."""
    return [plain(value) for value in values.tolist()]


def _errors(frames: EvaluatedFrames, rows: NDArray[np.intp]) -> dict[str, Any]:
    told: dict[str, Any] = {measure: {} for measure in TOLD_ERRORS}
    for role in roles_of(frames):
        values = np.stack([frames.error(role, measure)[rows] for measure in TOLD_ERRORS], axis=1) * 1000
        values = values[np.isfinite(values).all(axis=1)]
        if len(values):
            lines = [values.mean(axis=0), *np.quantile(values, (0.5, 0.95), axis=0)]
        else:
            lines = [np.full(len(TOLD_ERRORS), np.nan)] * 3
        for k, measure in enumerate(TOLD_ERRORS):
            told[measure][role] = {
                name: plain(line[k]) for name, line in zip(("mean", "median", "p95"), lines, strict=True)
            }
    return told


def events(frames: EvaluatedFrames, rows: NDArray[np.intp]) -> dict[str, Array]:
    """Return what the first-ranked survivor's probability may be of, 1 or 0 a frame.

    That its branch code is the truth's, and that its mean joint error is below 35 mm.
    """
    near = frames.error("first", "mpjpe")[rows]
    return {
        "branch": frames.measured.first_branch[rows],
        "within_35mm": np.where(np.isfinite(near), near <= NEAR_NOISY, np.nan),
    }


def _calibration(frames: EvaluatedFrames, rows: NDArray[np.intp]) -> dict[str, Any] | None:
    stated = frames.measured.probability[rows]
    found = {name: reliability(stated, event) for name, event in events(frames, rows).items()}
    told = {
        name: {"ece": plain(one.error), "brier": plain(one.brier), "frames": int(one.frames.sum())}
        for name, one in found.items()
        if one is not None
    }
    return told or None


def _tables(frames: EvaluatedFrames, rows: NDArray[np.intp]) -> dict[str, Any] | None:
    stated = frames.measured.probability[rows]
    found = {name: reliability(stated, event) for name, event in events(frames, rows).items()}
    told = {
        name: {
            "from": plains(one.lower),
            "frames": one.frames.tolist(),
            "probability": plains(one.probability),
            "share": plains(one.share),
        }
        for name, one in found.items()
        if one is not None
    }
    return told or None


def _mean(values: Array) -> float | None:
    known = values[np.isfinite(values)]
    return plain(known.mean()) if len(known) else None


def _most(values: Array) -> float | None:
    known = values[np.isfinite(values)]
    return plain(known.max()) if len(known) else None
