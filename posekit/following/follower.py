"""Following a person live: a frame in, the posture of some frames ago out."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from posekit.errors import InputError
from posekit.following.beam import Beam
from posekit.following.bridging import COASTING_SECONDS, bridge
from posekit.following.expected_path import ExpectedPosture
from posekit.following.motion_model import MotionModel
from posekit.following.survivor_frame import SurvivorFrame, check_order
from posekit.following.trellis import Trellis
from posekit.geometry import Array

LIVE_BEAM = Beam(coverage=0.9, survivors=48, width=32)
"""What is looked at live, unless told otherwise."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LiveEstimate:
    """One frame of the path, as far as it was known `lag` frames later.

    Parameters
    ----------
    frame : int
        Its number, from 0.
    time : float
        Seconds.
    survivor : int
        Which of its survivors; -1 where it was passed over.
    joints : array (14, 3)
        Camera frame, metres; NaN where nothing is known.
    interpolated : bool array (14,)
        Which joints are no survivor's: what bridges the gap, or the last known posture moved on.
    confidence : float
        The probability, as far as it was known then, that all joints are within 5 cm of these.
    """

    frame: int
    time: float
    survivor: int
    joints: Array
    interpolated: NDArray[np.bool_]
    confidence: float

    @property
    def bridged(self) -> bool:
        """Whether the frame was passed over."""
        return self.survivor < 0


class Follower:
    """Follows a sequence frame by frame.

    `push` takes a frame and returns the estimate of the frame `lag` frames before it; `finish` returns those that are
    left. With a lag of the whole sequence these are the survivors of `best_paths`'s first path; with a shorter one each
    is the best that was known by then, so that the path may change its mind in between, and memory and time of a frame
    are bounded. Nothing is smoothed.

    Parameters
    ----------
    lag : int
        Frames, zero or more.
    model : MotionModel, optional
        How bodies move: what steps and turns cost.
    beam : Beam, optional
        Which paths are followed: `LIVE_BEAM` unless told otherwise.

    Raises
    ------
    InputError
        Where the lag is no such number.

    Examples
    --------
    >>> follower = Follower(lag=1)
    >>> posture = np.zeros((1, 14, 3)) + [0.0, 0.0, 4.0]
    >>> follower.push(SurvivorFrame(time=0.0, joints=posture)) is None
    True
    >>> follower.push(SurvivorFrame(time=0.03, joints=posture)).frame
    0
    >>> [estimate.frame for estimate in follower.finish()]
    [1]
    """

    def __init__(self, *, lag: int, model: MotionModel | None = None, beam: Beam | None = None) -> None:
        if isinstance(lag, bool) or not isinstance(lag, int) or lag < 0:
            raise InputError(f"lag is {lag!r}; expected a number of frames, zero or more")
        self.lag = lag
        self.model = model or MotionModel()
        self.beam = beam or LIVE_BEAM
        self._trellis = Trellis(self.model, self.beam)
        self._frames: deque[SurvivorFrame] = deque()
        self._known: list[tuple[float, Array]] = []
        self._last = -np.inf
        self._first = 0

    def push(self, frame: SurvivorFrame) -> LiveEstimate | None:
        """Take the next frame; return the estimate of the one `lag` before, or None while there is none.

        Raises
        ------
        InputError
            Where the frame does not come after the last.
        """
        check_order(self._last, frame.time, self._first + len(self._frames))
        self._last = frame.time
        self._trellis.push(frame)
        self._frames.append(frame)
        return self._tell()[0] if len(self._frames) > self.lag else None

    def finish(self) -> list[LiveEstimate]:
        """Return the estimates of the frames that are left. More frames may follow, after these."""
        return self._tell(every=True) if self._frames else []

    def _tell(self, *, every: bool = False) -> list[LiveEstimate]:
        """Estimate the oldest frame that was not told yet, or all."""
        found = self._expected(every=every)
        count = len(found) if every else 1
        window = np.stack([each.joints for each in found])
        missing = np.isnan(window[..., 0])
        whole = window
        if missing[:count].any():
            if not every:  # what comes after helps
                found = self._expected(every=True)
                window = np.stack([each.joints for each in found])
                missing = np.isnan(window[..., 0])
            time = [*(time for time, _ in self._known), *(frame.time for frame in self._frames)]
            known = np.concatenate([*(joints[None] for _, joints in self._known), window])
            whole = bridge(np.array(time), known)[len(self._known) :]
        estimates = []
        for k in range(count):
            frame = self._frames.popleft()
            self._trellis.forget()
            joints, unseen = whole[k].copy(), missing[k].copy()
            joints.flags.writeable = unseen.flags.writeable = False
            estimates.append(
                LiveEstimate(
                    frame=self._first,
                    time=frame.time,
                    survivor=found[k].survivor,
                    joints=joints,
                    interpolated=unseen,
                    confidence=found[k].confidence,
                )
            )
            self._first += 1
            self._remember(frame.time, window[k])
        return estimates

    def _expected(self, *, every: bool) -> list[ExpectedPosture]:
        """Find what is expected of the oldest frame, or of all that were not told yet."""
        stages = self._trellis.stages
        told = zip(self._frames, stages, self._trellis.marginals(), strict=True)
        return [
            ExpectedPosture.of(frame, stage.survivor, share)
            for k, (frame, stage, share) in enumerate(told)
            if every or k == 0
        ]

    def _remember(self, time: float, joints: Array) -> None:
        """Keep what bridges to come start from: the last places of all joints, and the neck's of a while before."""
        if np.isnan(joints).all():
            return
        self._known.append((time, joints))
        needed = []
        lacking = np.ones(len(joints), dtype=np.bool_)
        for at, place in reversed(self._known):
            found = ~np.isnan(place[:, 0])
            if at >= time - COASTING_SECONDS or (found & lacking).any():
                needed.append((at, place))
            lacking &= ~found
        self._known = needed[::-1]
