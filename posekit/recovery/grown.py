"""Where a frame's trees are: in which batch, and which of its hypotheses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from posekit.recovery.fit_camera import CameraFit
from posekit.recovery.trees import Batch


@dataclass(frozen=True, kw_only=True)
class Grown:
    """The trees of one frame.

    Parameters
    ----------
    batch : Batch or None
        None where nothing was grown.
    index, hypotheses : int
        The place in the batch of the frame's first hypothesis, and how many there are.
    fit : CameraFit
        Where the necks came from.
    """

    batch: Batch | None
    index: int
    hypotheses: int
    fit: CameraFit


def grown_of(batch: Batch, fit: CameraFit, rows: NDArray[np.intp]) -> dict[int, Grown]:
    """Say for each frame of a batch, which was grown of some hypotheses, where its own are."""
    frames, first, count = np.unique(fit.frame[rows], return_index=True, return_counts=True)
    return {
        frame: Grown(batch=batch, index=index, hypotheses=hypotheses, fit=fit)
        for frame, index, hypotheses in zip(frames.tolist(), first.tolist(), count.tolist(), strict=True)
    }
