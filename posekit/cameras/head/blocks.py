"""Many heads placed block by block: their equations stay in a core's cache, and several threads take blocks.

The numbers do not depend on how many threads there are.
"""

from __future__ import annotations

from contextvars import copy_context
from typing import Any

import numpy as np

from posekit.cameras import PinholeCamera
from posekit.cameras.head.estimate import HeadEstimate, estimate
from posekit.cameras.head.points import HeadPoints
from posekit.cameras.head.sighting import HeadSighting
from posekit.geometry import Array

BLOCK_HEADS = 1000
"""Heads a block. From 500 to 2,000 a head costs the same; with fewer, calls cost more than what they do."""


def estimate_blocks(
    head: HeadPoints, sighting: HeadSighting, known: tuple[PinholeCamera, Array] | None, threads: int = 1
) -> HeadEstimate:
    """Place the head in every frame, as `posekit.cameras.head.estimate.estimate` does, on some threads."""
    frames = [slice(k, k + BLOCK_HEADS) for k in range(0, len(sighting.reasons), BLOCK_HEADS)]
    if len(frames) < 2:
        return estimate(head, sighting, known)

    def one(part: slice) -> HeadEstimate:
        seen = HeadSighting(sighting.image[part], sighting.seen[part], sighting.reasons[part])
        return estimate(head, seen, None if known is None else _known(*known, part))

    if threads > 1:
        from concurrent.futures import ThreadPoolExecutor

        with ThreadPoolExecutor(min(threads, len(frames))) as pool:
            # Each in a copy of this context: what NumPy shall not warn of holds there too.
            waiting = [pool.submit(copy_context().run, one, part) for part in frames]
            estimates = [future.result() for future in waiting]
    else:
        estimates = [one(part) for part in frames]
    columns: Any = zip(*estimates, strict=True)
    reasons, *arrays = columns
    return HeadEstimate(
        [reason for part in reasons for reason in part], *(np.concatenate(parts) for parts in arrays)
    )


def _known(camera: PinholeCamera, normalized: Array, part: slice) -> tuple[PinholeCamera, Array]:
    """Return the camera and the normalised image points of some frames."""
    if camera.K.ndim == 3:
        camera = PinholeCamera(K=camera.K[part], distortion=camera.distortion)
    return camera, normalized[part]
