r"""How fast feet slide that stand.

A foot that stands flat neither rises nor turns: its ankle and its toes have one velocity, which is 0. In recordings of
people it is not: skin and markers move, feet roll, and what is taken for a joint lies above the sole; so the speed of
the slowest point alone, by which skating is often told, calls every other step of a real walk sliding. What real feet
do not do is to go on evenly: a foot slides whose points have for a time one velocity, from frame to frame the same,
and along the ground.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array, runs
from posekit.skeleton import JOINT, SIDES
from posekit.tree import Findings
from posekit.validators.motion.clip import MotionClip
from posekit.validators.motion.ground import LEG_SHARE, ground_of, soles, stature_of
from posekit.validators.motion.motion_check import MotionCheck
from posekit.validators.motion.timeline import norm, timeline_of

DOWN_METRES: Final = 0.04
"""Above the highest level of the ground up to which a foot is down: a swinging foot's toes clear 1 to 6 cm, faster."""

FOOT_POINTS: Final = ([0, 2, 4], [1, 3, 5])
"""Toe, heel and ankle of the right foot and of the left one among `posekit.validators.motion.ground.soles`."""

EVEN_SHARE: Final = 0.3
"""Of a fast slide's own speed, by which it may be uneven: of several points, as one alone says nothing of a roll."""

SWINGING_SPEED: Final = 1.0
"""Metres a second above which a foot swings, where noise hides how uneven a swing is."""

UPRIGHT_SHARE: Final = 0.6
"""Of the legs' length, by which hips are above a foot that stands: who crawls or lies drags feet."""

BEND_FRAMES: Final = 8
"""How far the start of a slide may be from where it was first found."""

VIDEO_RATE: Final = 29.0
SLOW_FACTOR: Final = 2.0
"""Times as long a slide lasts at fewer frames a second than that: medians over `USUAL_FRAMES` hide a foot's roll."""

SLIDING_RATE: Final = 15.0
"""Frames a second at which feet are seen to rest."""

USUAL_FRAMES: Final = 5
"""Frames of which the median velocity is taken: a point that trembles does so from frame to frame."""


@dataclass(frozen=True, kw_only=True)
class Sliding(MotionCheck):
    """Whether a standing foot slides evenly.

    Parameters
    ----------
    fastest : float
        Metres a second that a standing foot may go.
    lasting : float
        Seconds for which it goes on.
    uneven : float
        Metres a second by which velocities of one slide differ at most, between points of the foot and over time.
    rising : float
        Metres a second that a foot on the ground goes up or down at most.
    """

    name = "sliding"
    unit = "m/s"
    meaning = "a foot slides that stands on the ground"
    needs = ("up", "time", "ground")

    fastest: float = 0.04
    lasting: float = 0.4
    uneven: float = 0.02
    rising: float = 0.05

    def places(self, clip: MotionClip) -> tuple[str, ...]:
        """Name the feet; see `MotionCheck`."""
        del clip
        return tuple(f"{side}_foot" for side in SIDES)

    def not_asked(self, clip: MotionClip) -> str:
        """Ask nothing of clips at few frames a second; see `MotionCheck`."""
        few = f"it needs {SLIDING_RATE:g} frames a second" if clip.rate < SLIDING_RATE else ""
        return super().not_asked(clip) or few

    def judge(self, clip: MotionClip) -> Findings:
        """Measure how fast each foot slides; see `MotionCheck`."""
        line, ground = timeline_of(clip), ground_of(clip)
        feet, over = soles(clip)
        up = np.zeros(3) if clip.up is None else clip.up
        base = (ground.low + ground.high + ground.lifted)[:, None]
        hips = clip.height[:, [JOINT[f"{side}_hip"] for side in SIDES]].min(axis=1)[:, None]
        stands = ~(hips - feet @ up < UPRIGHT_SHARE * LEG_SHARE * stature_of(clip))
        down = line.spread((stands & (feet @ up - over < base + DOWN_METRES)).astype(np.float64)) > 0
        spread = line.spread(feet)
        slides = [self._slides(clip, spread[:, foot], down[:, foot], up) for foot in FOOT_POINTS]
        value = np.zeros((len(spread), len(SIDES)))
        count = self._frames(clip)
        for start, stop in runs(np.any(slides, axis=0)):
            sliding = [k for k, slots in enumerate(slides) if slots[start:stop].any()]
            points = spread[:, [point for k in sliding for point in FOOT_POINTS[k]]]
            points = points[:, np.isfinite(points[start:stop]).all(axis=(0, 2))]
            along = (points[stop - 1] - points[start]).mean(axis=0)
            along = along - (along @ up) * up
            way = points @ along / norm(along)
            speed = float(norm(along)) / ((stop - 1 - start) * clip.step)
            rough = _roughly(np.diff(way.mean(axis=1)) - speed * clip.step / 2, start, stop - 1, count)
            first = _bend(way, *rough, count)
            last = len(way) - 1 - _bend(way[::-1], len(way) - 1 - rough[1], len(way) - 1 - rough[0], count)
            value[first + 1 : last + 1, sliding] = speed
        return Findings(value=line.of_frames(value), lower=np.array(-np.inf), upper=np.array(self.fastest))

    def _frames(self, clip: MotionClip) -> int:
        lasting = self.lasting * (SLOW_FACTOR if clip.rate < VIDEO_RATE else 1.0)
        return max(3, round(lasting / clip.step))

    def _slides(
        self, clip: MotionClip, points: Array, down: NDArray[np.bool_], up: Array
    ) -> NDArray[np.bool_]:
        """Say in which slots (S,) a foot (S, 3, 3) slides."""
        count, known = self._frames(clip), np.isfinite(points).all(axis=(0, 2))
        none = np.zeros(len(points), dtype=np.bool_)
        if not known.any():
            return none
        ways = np.diff(points[:, known], axis=0) / clip.step
        if len(ways) < max(count, USUAL_FRAMES):
            return none
        velocity = _usual(ways)
        noise = 3 * np.sqrt(2) * clip.noise / clip.step
        level = velocity - (velocity @ up)[..., None] * up
        mean = level.mean(axis=1)
        flat = (np.abs(velocity @ up).max(axis=1) < self.rising + noise) & (
            norm(level - mean[:, None]).max(axis=1) < self.uneven + noise
        )
        flat &= down[1:, known].any(axis=1)
        windows = np.lib.stride_tricks.sliding_window_view(mean, count, axis=0)
        even = windows.mean(axis=-1)
        differs = norm(np.moveaxis(windows - even[..., None], 1, -1)).max(axis=1)
        share = EVEN_SHARE if known.sum() > 1 else 0.0
        steady = differs < np.maximum(self.uneven, share * norm(even)) + noise
        steady &= np.lib.stride_tricks.sliding_window_view(flat, count).all(axis=1)
        # Where noise lets feet differ by more than they slide, evenness is no evidence.
        steady &= norm(even) > max(self.fastest, noise / EVEN_SHARE)
        if noise > self.uneven:
            steady &= norm(even) < SWINGING_SPEED
        slides = np.zeros(len(points), dtype=np.bool_)
        for window in np.flatnonzero(steady):
            slides[window : window + count + 1] = True
        return slides


def _roughly(gained: Array, start: int, stop: int, most: int) -> tuple[int, int]:
    """Move the ends of a slide, by at most so many slots outward, to where what it gains (S - 1,) sums to most."""
    middle = (start + stop) // 2
    before = np.cumsum(gained[max(start - most, 0) : middle][::-1])
    after = np.cumsum(gained[middle : stop + most])
    return middle - int(np.nanargmax(before)) - 1, middle + int(np.nanargmax(after)) + 1


def _bend(way: Array, start: int, stop: int, most: int) -> int:
    """Find where an even slide of points (S, P) starts: where two lines meet that fit each point's way best."""
    first, last = max(start - most, 0), min(start + most, stop)
    time = np.arange(first, last + 1, dtype=np.float64)
    piece = way[first : last + 1]
    piece, time = piece[np.isfinite(piece).all(axis=1)], time[np.isfinite(piece).all(axis=1)]
    best, least = start, np.inf
    for bend in range(max(first + 2, start - BEND_FRAMES), min(last - 2, start + BEND_FRAMES) + 1):
        lines = np.stack([np.ones(len(time)), time - bend, np.maximum(time - bend, 0)], axis=1)
        left = piece - lines @ np.linalg.lstsq(lines, piece, rcond=None)[0]
        if np.vdot(left, left) < least:
            best, least = bend, float(np.vdot(left, left))
    return best


def _usual(velocity: Array) -> Array:
    """Return the median of each component over `USUAL_FRAMES` frames: edges stay, single frames do not count."""
    room = USUAL_FRAMES // 2
    padded = np.pad(velocity, ((room, room), (0, 0), (0, 0)), mode="reflect")
    a, b, c, d, e = (padded[k : k + len(velocity)] for k in range(USUAL_FRAMES))
    # Of two pairs the least and the greatest are not the median of five; it is that of the two between and the fifth.
    low = np.maximum(np.minimum(a, b), np.minimum(d, e))
    high = np.minimum(np.maximum(a, b), np.maximum(d, e))
    return np.asarray(np.maximum(np.minimum(low, high), np.minimum(np.maximum(low, high), c)))
