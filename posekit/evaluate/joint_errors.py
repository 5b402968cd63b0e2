"""How far survivors are from the truth: every survivor, and the best, the first and a random one of every frame."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.measures import align

ERROR_NAMES: Final = ("mpjpe", "centred", "pa", "worst", "worst_pa")
"""Mean error of the joints where they are; after moving the middle of the joints onto the truth's; after the similarity
of `posekit.measures.align`; and the error of the worst joint, where it is and after the similarity."""

AT_ONCE: Final = 50_000
"""Survivors that are measured together."""


def survivor_errors(joints: Array, truth: Array) -> Array:
    """Return the five `ERROR_NAMES` of survivors (N, 5), metres; NaN where nothing is known in both.

    Parameters
    ----------
    joints, truth : array (N, 14, 3)
        Camera frame, metres; NaN where not known.
    """
    parts = range(0, len(joints), AT_ONCE)
    found = [_errors(joints[k : k + AT_ONCE], truth[k : k + AT_ONCE]) for k in parts]
    return np.concatenate(found) if found else np.empty((0, len(ERROR_NAMES)))


def _errors(joints: Array, truth: Array) -> Array:
    known = np.asarray(np.isfinite(joints + truth).all(axis=-1))
    target = np.where(known[..., None], truth, np.nan)
    count = np.maximum(known.sum(axis=1), 1)[:, None, None]
    shift = np.where(known[..., None], target - joints, 0.0).sum(axis=1, keepdims=True) / count
    mean, worst = [], []
    for moved in (joints, joints + shift, align(joints, target).apply(joints)):
        away = np.linalg.norm(moved - target, axis=-1)
        worst.append(np.fmax.reduce(away, axis=1))
        measured = np.isfinite(away)
        total = np.where(measured, away, 0.0).sum(axis=1)
        mean.append(np.where(measured.any(axis=1), total / np.maximum(measured.sum(axis=1), 1), np.nan))
    return np.stack([*mean, worst[0], worst[2]], axis=1)


def best_of_frames(errors: Array, offsets: NDArray[np.intp]) -> Array:
    """Return the smallest of each measure over each frame's survivors (F, 5); NaN where a frame has none.

    Parameters
    ----------
    errors : array (N, 5)
        The five measures of every survivor, metres, frame by frame.
    offsets : int array (F + 1,)
        Where each frame's survivors start and the last ends.
    """
    best = np.full((len(offsets) - 1, errors.shape[1]), np.nan)
    some = np.flatnonzero(np.diff(offsets))
    if len(some):
        best[some] = np.fmin.reduceat(errors, offsets[some], axis=0)
    return best


def best_rows(error: Array, offsets: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return which of each frame's survivors has the least error (F,); -1 where none has one.

    Parameters
    ----------
    error : array (N,)
        One measure of every survivor, frame by frame; NaN where it is not known.
    offsets : int array (F + 1,)
        Where each frame's survivors start and the last ends.
    """
    counts = np.diff(offsets)
    frame = np.repeat(np.arange(len(counts)), counts)
    # Sorted by frame and then by error, the first of each frame is its best.
    known = np.flatnonzero(np.isfinite(error))
    order = known[np.lexsort((error[known], frame[known]))]
    frames, first = np.unique(frame[order], return_index=True)
    best = np.full(len(counts), -1, dtype=np.intp)
    best[frames] = order[first] - offsets[frames]
    return best


def of_chosen(errors: Array, offsets: NDArray[np.intp], chosen: NDArray[np.intp]) -> Array:
    """Return the errors of one survivor a frame (F, 5); NaN where -1 was chosen."""
    rows = offsets[:-1] + np.maximum(chosen, 0)
    found = np.full((len(chosen), errors.shape[1]), np.nan)
    taken = chosen >= 0
    found[taken] = errors[rows[taken]]
    return found
