"""What the tests of recovery share: how far the answers are from the truth."""

from collections.abc import Callable

import numpy as np
import pytest

from posekit.recovery.recovery import Recovery


@pytest.fixture(scope="session")
def truth_at() -> Callable[[Recovery, np.ndarray], list[float]]:
    """Return how far the nearest survivor of each frame is from the truth, over the joints it knows, metres."""

    def truth_at(recovery: Recovery, truth: np.ndarray) -> list[float]:
        nearest = []
        for frame, joints in zip(recovery.frames, truth, strict=True):
            apart = np.linalg.norm(frame.joints - joints, axis=-1)
            nearest.append(float(np.fmax.reduce(apart, axis=1).min()) if len(frame) else np.inf)
        return nearest

    return truth_at
