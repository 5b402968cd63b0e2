"""One person of whom it is not known how large: the scale of all lengths under which a sequence fits and moves best."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Final

import numpy as np

from posekit.body import Figure, load_figure
from posekit.errors import InputError, PosekitError
from posekit.following import (
    Following,
    MotionModel,
    Paths,
    ScaleChoice,
    best_paths,
)
from posekit.formats.own import OpenCVModel, ScaledOrthographicModel, View
from posekit.recovery.conductor import recover
from posekit.recovery.person import person_of
from posekit.recovery.recovery import Recovery
from posekit.recovery.sequences import follow, survivor_frames

SPREAD_DEVIATIONS: Final = 2.0
"""Deviations to either side of the lengths that are given within which scales are tried."""

FIRST_SCALES: Final = 5
"""Scales that are tried first, evenly spaced."""

REFINING_ROUNDS: Final = 3
"""How often the scales half-way between the best and its neighbours are tried after that."""

AT_ONE_SCALE: Final = 0.01
"""Relative deviation of lengths with which a scale is tried: with more, every scale would fit."""

BEST_PATH_DEVIATION: Final = 0.01
"""How far off, relatively, scales are that the best path tells (docs, "Sequences"): what it costs says much less."""

MAX_DEVIATION: Final = 0.15
"""The largest deviation of lengths that is taken for one."""

FIXED_ROOTS: Final = ("given", "head")
"""Ways to a neck whose distance does not come from the lengths."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ScaledFollowing:
    """The scale of a person's lengths, and the paths of a person so large.

    Parameters
    ----------
    scale : float
        Of all lengths, as they were given.
    deviation : float
        Of the scale: standard deviation.
    choice : ScaleChoice
        What was tried and left postures, and what the best path under each costs.
    recovery : Recovery
        With lengths of that scale.
    following : Following
        The paths of a person so large.
    """

    scale: float
    deviation: float
    choice: ScaleChoice
    recovery: Recovery
    following: Following

    @property
    def at_the_end(self) -> bool:
        """Whether the best scale is the smallest or the largest that was tried: a farther one may be better."""
        return self.choice.best in (0, len(self.choice.scales) - 1)


def follow_scaled(
    view: View,
    recovering: Callable[[View], Recovery] | None = None,
    *,
    deviation: float = 0.05,
    figure: Figure | None = None,
    k: int = 2,
    model: MotionModel | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> ScaledFollowing:
    r"""Follow a person whose lengths are known up to a common factor, and tell the factor.

    The view is recovered with lengths of several scales s. Each costs what its best path does, survivors half their
    :math:`\chi^2`, and :math:`(\ln s)^2 / 2 \sigma^2` for the deviation :math:`\sigma` of the lengths. The scale is the
    minimum of the parabola through the best and its neighbours, which halve their distance three times.

    Where the neck is must be known: with a neck whose distance follows from the lengths, a larger person farther away
    looks the same.

    Parameters
    ----------
    view : View
        With a calibrated camera.
    recovering : callable, optional
        Recovers a view; `posekit.recover` with refinement if not given, for which the view has to say its noise.
        Survivors that are not refined cost nothing there, and the scale is told by motion and by frames without any
        alone, about half as well.
    deviation : float
        Relative, of the lengths that are given.
    figure : Figure, optional
        What the view's lengths are applied to; the built-in one if not given.
    k, model
        As of `posekit.recovery.sequences.follow`, for the paths at the end; what else that takes, say to it with the
        recovery that is found.
    progress : callable, optional
        Told how many scales were tried, and how many will be at most.

    Returns
    -------
    ScaledFollowing

    Raises
    ------
    InputError
        Where the camera or the noise is not known, the neck's distance follows from the lengths, or a number is
        impossible.
    PosekitError
        Where no scale leaves a posture: what is said of the lengths as they are.
    """
    if not (math.isfinite(deviation) and 0 < deviation <= MAX_DEVIATION):
        raise InputError(
            f"deviation of the lengths: {deviation!r}; expected a fraction above 0, at most {MAX_DEVIATION:g}"
        )
    if isinstance(view.camera, ScaledOrthographicModel):
        raise InputError(
            "the scale of the lengths: the view is uncalibrated, so that sizes are relative; expected a calibrated "
            "camera; give --camera"
        )
    if recovering is None and view.deviation is None and not view.derived:
        raise InputError(
            "the scale of the lengths: nobody says how far off the image points are; expected a standard deviation in "
            "pixels; give --deviation, 1 for points that are all but exact"
        )
    person = person_of(view, figure or load_figure())
    refine = True if isinstance(view.camera, OpenCVModel) else None
    trial = _Trials(
        view=view,
        lengths=dict(person.lengths),
        recovering=recovering
        or partial(recover, figure=figure, refine=refine, length_deviation=AT_ONE_SCALE),
        deviation=deviation,
        model=model,
        progress=progress,
    )
    spread = SPREAD_DEVIATIONS * deviation
    for scale in [1.0, *np.linspace(1 - spread, 1 + spread, FIRST_SCALES).tolist()]:
        trial.run(round(scale, 6))
    if not any(trial.paths.values()):
        if trial.refusal is not None:
            raise trial.refusal
        follow(trial.recover(1.0))  # says that no frame has a posture
    for _ in range(REFINING_ROUNDS):
        for scale in trial.between():
            trial.run(scale)
    choice = trial.choice()
    recovery = trial.recover(choice.between)
    following = follow(recovery, k=k, model=model)
    return ScaledFollowing(
        scale=choice.between,
        deviation=math.hypot(choice.deviation, BEST_PATH_DEVIATION),
        choice=choice,
        recovery=recovery,
        following=following,
    )


@dataclass(kw_only=True, eq=False)
class _Trials:
    """Scales that were tried; those without any posture cost as much as passing all frames over."""

    view: View
    lengths: dict[str, float]
    recovering: Callable[[View], Recovery]
    deviation: float
    model: MotionModel | None
    progress: Callable[[int, int], None] | None

    def __post_init__(self) -> None:
        self.cost: dict[float, float] = {}
        self.paths: dict[float, Paths | None] = {}
        self.refusal: PosekitError | None = None

    def recover(self, scale: float) -> Recovery:
        """Recover the view with scaled lengths."""
        scaled = {name: length * scale for name, length in self.lengths.items()}
        return self.recovering(replace(self.view, lengths=scaled))

    def run(self, scale: float) -> None:
        """Try a scale, unless it was."""
        if scale in self.cost:
            return
        self.cost[scale], self.paths[scale] = self._tried(scale)
        self.cost[scale] += 0.5 * (math.log(scale) / self.deviation) ** 2
        if self.progress is not None:
            self.progress(len(self.cost), FIRST_SCALES + 2 * REFINING_ROUNDS)

    def _tried(self, scale: float) -> tuple[float, Paths | None]:
        model = self.model or MotionModel()
        nothing = model.skip * len(self.view.time)
        try:
            recovery = self.recover(scale)
        except PosekitError as error:
            if self.refusal is None:
                self.refusal = error
            return nothing, None
        _check(recovery)
        if not any(map(len, recovery.frames)):
            return nothing, None
        misfit = [
            np.zeros(len(frame)) if frame.chi2 is None else -frame.chi2 / 2 for frame in recovery.frames
        ]
        paths = best_paths(survivor_frames(recovery.frames, misfit), model=model)
        return float(paths.cost[0]), paths

    def between(self) -> list[float]:
        """Return the scales half-way from the best to its neighbours."""
        tried = sorted(self.cost)
        at = tried.index(min(tried, key=self.cost.__getitem__))
        return [(tried[at] + tried[k]) / 2 for k in (at - 1, at + 1) if 0 <= k < len(tried)]

    def choice(self) -> ScaleChoice:
        """Return what was tried and has paths."""
        tried = [scale for scale in sorted(self.cost) if self.paths[scale] is not None]
        return ScaleChoice(
            scales=np.array(tried),
            cost=np.array([self.cost[scale] for scale in tried]),
            paths=tuple(paths for scale in tried if (paths := self.paths[scale]) is not None),
        )


def _check(recovery: Recovery) -> None:
    """Refuse what does not tell a scale."""
    for number, frame in enumerate(recovery.frames):
        placement = frame.placement
        if placement is not None and placement.method not in (*FIXED_ROOTS, "none"):
            raise InputError(
                f"the scale of the lengths: frame {number} has its neck by {placement.method}, from the lengths "
                "themselves; expected a neck that is given, or a head of six points; give root in every frame"
            )
