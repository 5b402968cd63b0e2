"""How the views of an evaluation are recovered and their survivors ordered."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any, Final, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from posekit.body import Figure, load_figure
from posekit.errors import InputError, PosekitError
from posekit.evaluate.followed_sequences import Chooser
from posekit.evaluate.survivor_order import Ranker, by_probability
from posekit.formats.own import View
from posekit.recovery.body import loaded, ranges_of
from posekit.recovery.conductor import recover
from posekit.recovery.person import person_of
from posekit.recovery.recovery import FrameRecovery
from posekit.settings import MEASURED_TOLERANCE, RecoverSettings

RootFrom = Literal["given", "auto"]

NOISE_LEVELS_PIXELS: Final = (0.0, 1.0, 2.0, 5.0, 10.0)
"""Standard deviations of image points, pixels. Wang et al. (2014, section 4.3.2) add ten levels of Gaussian noise, the
largest as long as the lower leg; pixels are what detectors are measured in."""


@dataclass(frozen=True, kw_only=True)
class Method:
    """What is done with every view.

    Parameters
    ----------
    noise : tuple of float
        Levels: standard deviation of each coordinate of the image points, pixels.
    root : {"given", "auto"}, optional
        Whether the neck is the true one, or placed from the image (`posekit.settings.Rooting`). By default it is given
        for virtual cameras, and views stay as they are.
    settings : RecoverSettings
        What is asked of every recovery.
    seed : int
        Of the noise and of the random survivors.
    rank : Ranker
        Orders the survivors of each frame.
    choose : Chooser, optional
        Follows sequences, as `by_path` does. With it, frames are taken in a row.

    Raises
    ------
    InputError
        Where one of them is impossible.
    """

    noise: tuple[float, ...] = NOISE_LEVELS_PIXELS
    root: RootFrom | None = None
    settings: RecoverSettings = field(default_factory=RecoverSettings)
    seed: int = 0
    rank: Ranker = by_probability
    choose: Chooser | None = field(default=None)

    def __post_init__(self) -> None:
        object.__setattr__(self, "settings", loaded(self.settings))
        if self.root is not None and self.root not in get_args(RootFrom):
            raise InputError(f"--root: {self.root!r}; expected {' or '.join(get_args(RootFrom))}")
        if not self.noise or not all(0 <= level < math.inf for level in self.noise):
            raise InputError(
                f"--noise: {list(self.noise)}; expected one or more finite numbers of pixels >= 0"
            )
        if len(set(self.noise)) != len(self.noise):
            raise InputError(
                f"--noise: {list(self.noise)}; expected each level once; leave out what is repeated"
            )
        if self.seed < 0:
            raise InputError(f"--seed: {self.seed}; expected zero or more")

    def recover(self, view: View) -> list[FrameRecovery]:
        """Recover all frames of a view; what `posekit.recover` refuses as impossible is a frame without survivors.

        A view is refused as a whole where none of its frames can be: so it is halved until those that can be are
        recovered.
        """
        with warnings.catch_warnings():
            # Noise makes heads misfit and necks lie beside their rays, thousands of times: that is counted, not said.
            warnings.simplefilter("ignore", UserWarning)
            frames: list[FrameRecovery] = []
            for part in self._parts(*_person(view), np.arange(len(view))):
                frames += part
        return frames

    def document(self) -> dict[str, Any]:
        """List what decides the results, as plain values."""
        asked = self.settings
        tolerance = asked.tolerance_for(MEASURED_TOLERANCE)
        return {
            "noise_px": list(self.noise),
            "root": self.root,
            "length_deviation": asked.length_deviation,
            "coverage": asked.coverage,
            "checks": list(asked.check_names),
            "ranges": ranges_of(asked).name,
            "rules": list(asked.rules) if "walking" in asked.check_names else [],
            "walkers": asked.walkers,
            "tolerance": "exact, else measured" if tolerance is None else vars(tolerance),
            "seed": self.seed,
            "ranking": _name(self.rank),
            "sequences": None if self.choose is None else _name(self.choose),
        }

    def _parts(self, view: View, figure: Figure, rows: NDArray[np.intp]) -> Iterator[list[FrameRecovery]]:
        try:
            part = view if len(rows) == len(view) else view.take(rows)
            yield recover(part, self.settings, figure=figure).frames
        except PosekitError as error:
            if len(rows) == 1:
                yield [FrameRecovery(time=float(view.time[rows[0]]), batch=None, index=0, reason=str(error))]
                return
            for half in np.array_split(rows, 2):
                yield from self._parts(view, figure, half)


@lru_cache(maxsize=32)
def scaled(lengths: tuple[tuple[str, float], ...]) -> Figure:
    """Return the figure with some lengths (m, by segment), made once."""
    return load_figure().scaled(dict(lengths))


def figure_of(view: View) -> Figure:
    """Return a view's person: made once for all parts of a clip."""
    if view.stature is None and not view.head_points:
        return scaled(tuple(view.lengths.items()))
    return person_of(view, load_figure())


def _person(view: View) -> tuple[View, Figure]:
    """Take the lengths out of a view and put them into a figure, whose model is then built once."""
    if view.stature is None and not view.head_points:
        return replace(view, lengths={}), figure_of(view)
    return view, load_figure()


def _name(function: object) -> str:
    return str(getattr(function, "__qualname__", type(function).__qualname__))
