"""What checks of motion ask for from so many frames a second on, at exactly so many and at the next fewer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from posekit.validators.motion.explained import explained
from posekit.validators.motion.ground import _speed_noise, speeds
from posekit.validators.motion.sliding import Sliding
from tests.validators.test_motion_laws import WALK


def at(rate: float) -> tuple[float, float]:
    return rate, float(np.nextafter(rate, 0.0))


def test_an_order_is_told_from_twenty_frames_a_second() -> None:
    order = np.arange(90)
    order[30:50] = 30 + np.random.default_rng(1).permutation(20)
    clip = replace(WALK, joints=WALK.joints[order])
    told = [
        bool(explained(replace(clip, rate=rate, time=np.arange(90) / rate)).displaced.any())
        for rate in at(20.0)
    ]
    assert told == [True, False]


def test_a_speed_is_between_neighbours_from_twenty_frames_a_second() -> None:
    """Of who goes back and forth from frame to frame nothing is seen so; noise is half as much over two frames."""
    joints = np.tile(np.arange(30)[:, None, None] % 2, (1, 14, 3)) / 8.0
    clips = [
        replace(WALK, joints=joints, rate=rate, time=np.arange(30) / rate, noise=0.001) for rate in at(20.0)
    ]
    slow, fast = (np.nanmax(speeds(clip, joints)) for clip in clips)
    assert slow == 0.0 and fast == pytest.approx(np.sqrt(3) / 8.0 * 20.0)
    assert _speed_noise(clips[1]) == pytest.approx(2 * _speed_noise(clips[0]))
    assert _speed_noise(clips[0]) == pytest.approx(np.sqrt(2) * 0.001 / 0.1)


@pytest.mark.parametrize("lasting", [0.4, 1.0])
def test_a_foot_slides_for_twice_as_long_under_a_video_s_rate(lasting: float) -> None:
    frames = [
        Sliding(lasting=lasting)._frames(replace(WALK, rate=rate, time=np.arange(90) / rate))
        for rate in at(29.0)
    ]
    assert frames == [round(29 * lasting), round(2 * 29 * lasting)]
