"""Motion in memory: named points in space over time, as motion capture and triangulation give them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.display.pictured import Pictured
from posekit.display.plural import plural
from posekit.display.short_repr import short
from posekit.display.stick_drawing import points_drawing, posture_drawing
from posekit.errors import InputError
from posekit.formats.distinct import check_distinct
from posekit.formats.own.units import FARTHEST_COORDINATE
from posekit.geometry import Array
from posekit.safe_io import cut, nearest, refusal, shown
from posekit.skeleton import JOINTS

UP_DIRECTIONS: Final = {
    f"{sign}{axis}": (1.0 if sign == "+" else -1.0) * np.eye(3)[k]
    for k, axis in enumerate("xyz")
    for sign in "+-"
}
"""Directions by the name of their axis."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Motion(Pictured):
    """T frames of P named points in space.

    Parameters
    ----------
    names : tuple of str (P,)
        As the file has them.
    points : array (T, P, 3)
        Metres; NaN where a point is missing.
    time : array (T,)
        Seconds, ascending within a clip.
    rate : float
        Frames a second, of the first clip where they differ.
    up : str
        The axis that points up: ``+x`` … ``-z``; empty where the file does not say.
    source : str
        What to call it in errors.
    clip : int array (T,), optional
        The clip of each frame; all 0 where not given.
    clips : tuple of str, optional
        The names of the clips.
    actions : tuple of str, optional
        What is done in each clip; empty where the file does not say.
    rates : array (C,), optional
        Frames a second of each clip; `rate` for all where not given.
    as_recorded : bool
        Whether times may stand still or go back, and times and rates may be NaN, not known: what is judged is taken as
        it is, what is converted is not.
    told : tuple of str
        What the file itself says, of ``unit``, ``up``: the rest was taken for what is customary.
    said : tuple of str
        What was found out about the file, a sentence each.
    pictures : tuple of str (T,), optional
        The picture that each frame was seen in; tables hold it.

    Raises
    ------
    InputError
        Where shapes do not fit, frames are out of order, a coordinate is infinite, a point is known in part, or a name
        comes twice.
    """

    names: tuple[str, ...]
    points: Array
    time: Array
    rate: float
    up: str = ""
    source: str = "motion"
    clip: NDArray[np.intp] = field(default_factory=lambda: np.empty(0, dtype=np.intp))
    clips: tuple[str, ...] = ("",)
    actions: tuple[str, ...] = ()
    rates: Array = field(default_factory=lambda: np.empty(0))
    as_recorded: bool = False
    told: tuple[str, ...] = ()
    said: tuple[str, ...] = ()
    pictures: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        points = np.array(self.points, dtype=np.float64)
        time = np.array(self.time, dtype=np.float64)
        clip = np.array(self.clip, dtype=np.intp)
        if clip.shape == (0,):
            clip = np.zeros(len(time), dtype=np.intp)
        if points.shape != (len(time), len(self.names), 3) or time.ndim != 1 or clip.shape != time.shape:
            raise InputError(
                f"{self.source}: points have shape {points.shape}; expected ({len(time)}, {len(self.names)}, 3): "
                "frames, names, three coordinates"
            )
        if len(self.pictures) not in (0, len(time)):
            raise refusal(self.source, "pictures", str(len(self.pictures)), f"{len(time)}, one a frame")
        known = np.isfinite(time).all() and np.isfinite(self.rate)
        if np.isinf(time).any() or not (self.as_recorded or known) or self.rate <= 0:
            raise refusal(self.source, "rate", shown(float(self.rate)), "a positive rate, finite times")
        check_distinct(self.source, "names", self.names)
        unknown = np.isnan(points)
        bad = (np.abs(points) > FARTHEST_COORDINATE) | (unknown ^ unknown.all(axis=-1, keepdims=True))
        if bad.any():
            frame, point, _ = (int(k) for k in np.argwhere(bad)[0])
            got = str(points[frame, point].tolist())
            expected = "three finite numbers, or a missing point"
            raise refusal(self.source, f"frame {frame}: {self.names[point]}", got, expected)
        rates = np.array(self.rates, dtype=np.float64)
        if rates.shape == (0,):
            rates = np.full(len(self.clips), float(self.rate))
        self._check_clips(clip, rates)
        if not self.as_recorded:
            self._check_order(time, clip)
        for name, values in (("points", points), ("time", time), ("clip", clip), ("rates", rates)):
            values.flags.writeable = False
            object.__setattr__(self, name, values)
        object.__setattr__(self, "actions", self.actions or ("",) * len(self.clips))

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.time)

    def _facts(self) -> list[str]:
        several = [f"{len(self.clips)} clips"] if len(self.clips) > 1 else []
        up = [f"up={self.up!r}"] if self.up else []
        return [
            plural(len(self), "frame"),
            *several,
            f"{self.rate:g} a second",
            plural(len(self.names), "point"),
            *up,
            f"source={short(self.source)}",
        ]

    def _drawing(self) -> str:
        if not len(self):
            return ""
        points = self.points[int(np.isfinite(self.points[..., 0]).sum(axis=1).argmax())]
        up = UP_DIRECTIONS[self.up or "+y"]
        if not set(JOINTS) <= set(self.names):
            return points_drawing(points, up)
        return posture_drawing(points[None, [self.names.index(name) for name in JOINTS]], up)

    def of_clip(self, name: str) -> Motion:
        """Take one clip out of several.

        Raises
        ------
        InputError
            Where there is no such clip, or no frame in it.
        """
        if name not in self.clips:
            near = nearest(name, self.clips)
            raise refusal(self.source, "clips", shown(name), f"one of its {len(self.clips)}", cut(near))
        index = self.clips.index(name)
        rows = np.flatnonzero(self.clip == index)
        if not len(rows):
            raise refusal(
                self.source, f"clip {shown(name)}", "no frame", "one or more", "choose another clip"
            )
        return Motion(
            names=self.names,
            points=self.points[rows],
            time=self.time[rows],
            rate=float(self.rates[index]),
            up=self.up,
            source=self.source,
            clips=(name,),
            actions=(self.actions[index],),
            as_recorded=self.as_recorded,
            told=self.told,
            said=self.said,
            pictures=tuple(self.pictures[k] for k in rows.tolist()) if self.pictures else (),
        )

    def _check_clips(self, clip: NDArray[np.intp], rates: Array) -> None:
        count = len(self.clips)
        if count == 0 or len(set(self.clips)) != count or (self.actions and len(self.actions) != count):
            expected = "each named once, one action a clip"
            raise refusal(self.source, "clips", plural(count, "clip"), expected, "correct the names")
        if clip.size and (clip.min() < 0 or clip.max() >= count):
            first, last = int(clip.min()), int(clip.max())
            raise refusal(
                self.source, "clip", f"clips {first} to {last}", f"0 to {count - 1}, as clips are named"
            )
        known = np.isfinite(rates) | self.as_recorded
        if rates.shape != (count,) or np.isinf(rates).any() or not (known & ~(rates <= 0)).all():
            expected = f"{count} positive rates, one a clip"
            raise refusal(self.source, "rates", shown(rates.tolist()), expected, "correct them")
        if self.up and self.up not in UP_DIRECTIONS:
            raise refusal(self.source, "up", shown(self.up), f"one of {', '.join(UP_DIRECTIONS)}")

    def _check_order(self, time: Array, clip: NDArray[np.intp]) -> None:
        """Refuse times that stand still or go back within a clip."""
        order = np.argsort(clip, kind="stable")
        late = (np.diff(time[order]) <= 0) & (np.diff(clip[order]) == 0)
        if late.any():
            k = int(np.argmax(late))
            before, after = order[k], order[k + 1]
            got = f"time {time[after]:g} s after {time[before]:g} s"
            remedy = "put the frames in order, each once"
            raise refusal(self.source, f"frame {after}", got, "times that ascend", remedy)
