"""The cheapest path through a sequence, and the next that are different."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from posekit.errors import InputError
from posekit.following.beam import Beam
from posekit.following.motion_model import MotionModel
from posekit.following.states import States
from posekit.following.survivor_frame import SurvivorFrame, check_frames
from posekit.following.survivor_paths import Paths, joints_of
from posekit.following.viterbi import PathStep, advance, trace
from posekit.geometry import Array

PATH_SEPARATION_METRES = 0.25
"""Metres by which a joint must differ for a path to be another one, unless told otherwise."""


def best_paths(
    frames: Sequence[SurvivorFrame],
    *,
    k: int = 1,
    model: MotionModel | None = None,
    beam: Beam | None = None,
    apart: float = PATH_SEPARATION_METRES,
    progress: Callable[[int, int], None] | None = None,
) -> Paths:
    """Find the cheapest paths through the survivors of a sequence.

    A path takes a survivor in each frame, or passes it over. Its cost is the survivors' own, times `model.ranking`,
    that of its steps and turns (see `MotionModel`), and `model.skip` for every frame passed over.

    The first path is the cheapest that the search finds; where `Paths.exact`, of all. Each further one is the cheapest
    of those that in some frame go through a survivor with a joint more than `apart` from where every path found before
    has it.

    Parameters
    ----------
    frames : sequence of SurvivorFrame
        Times ascending, at any rate, even or not.
    k : int
        How many paths; fewer are returned where there are not so many.
    model : MotionModel, optional
        How bodies move: what steps and turns cost.
    beam : Beam, optional
        Which paths are followed while searching.
    apart : float
        Metres.
    progress : callable, optional
        Told after every frame of every search how many there were so far, and how many there will be at most: each path
        takes a search.

    Returns
    -------
    Paths

    Raises
    ------
    InputError
        Where there is no frame, times do not ascend, or a number is impossible.

    Examples
    --------
    >>> import numpy as np
    >>> standing = np.zeros((1, 14, 3)) + [0.0, 0.0, 4.0]
    >>> moved = np.concatenate([standing + [0.3, 0.0, 0.0], standing + [0.01, 0.0, 0.0]])
    >>> best_paths([SurvivorFrame(time=0, joints=standing), SurvivorFrame(time=0.03, joints=moved)]).survivor.tolist()
    [[0, 1]]
    """
    check_frames(frames)
    if isinstance(k, bool) or not isinstance(k, int) or k < 1:
        raise InputError(f"k is {k!r}; expected how many paths, one or more")
    if not (math.isfinite(apart) and apart >= 0):
        raise InputError(f"apart is {apart!r} m; expected zero or a positive length")
    model, beam = model or MotionModel(), beam or Beam()
    chosen: list[NDArray[np.intp]] = []
    costs: list[float] = []
    along: list[tuple[Array, NDArray[np.bool_]]] = []
    exact = False
    for number in range(k):
        # After the first, only paths through a survivor that is new to all paths found before are looked for.
        new = None if number == 0 else [_new(frame, at, along, apart) for at, frame in enumerate(frames)]
        found = _cheapest(frames, model, beam, new, _after(progress, number * len(frames), k * len(frames)))
        if found is None:
            break
        cost, path, dropped = found
        if number == 0:
            # Nothing that was dropped could have become cheaper, as no cost is negative.
            exact = dropped >= cost and _markov(frames)
        costs.append(cost)
        chosen.append(path)
        along.append(joints_of(frames, path))
    order = np.argsort(costs, kind="stable")
    return Paths(
        time=np.array([frame.time for frame in frames]),
        cost=np.array(costs)[order],
        survivor=np.array(chosen)[order],
        joints=np.stack([along[one][0] for one in order]),
        interpolated=np.stack([along[one][1] for one in order]),
        codes=tuple(_codes(frames, chosen[one]) for one in order),
        exact=exact,
    )


def _after(progress: Callable[[int, int], None] | None, before: int, total: int) -> Callable[[int], None]:
    """Tell progress how many frames of a search are done."""
    return lambda done: None if progress is None else progress(before + done, total)


def _cheapest(
    frames: Sequence[SurvivorFrame],
    model: MotionModel,
    beam: Beam,
    new: list[NDArray[np.bool_]] | None,
    tell: Callable[[int], None],
) -> tuple[float, NDArray[np.intp], float] | None:
    """Find the cheapest path, of fresh ones where it is said what is new: cost, survivors, cheapest end dropped."""
    states, steps = States.start(), list[PathStep]()
    for k, frame in enumerate(frames):
        states, step = advance(states, frame, model, beam, fresh=None if new is None else new[k])
        steps.append(step)
        tell(k + 1)
    ends = np.arange(len(states)) if new is None else np.flatnonzero(states.fresh)
    if not len(ends):
        return None
    end = int(ends[np.argmin(states.cost[ends])])
    return float(states.cost[end]), trace(steps, end), min(step.dropped for step in steps)


def _new(
    frame: SurvivorFrame, at: int, along: list[tuple[Array, NDArray[np.bool_]]], apart: float
) -> NDArray[np.bool_]:
    """Tell which survivors (N,) have a joint that is not where any of some paths has it."""
    new = np.ones(len(frame), dtype=np.bool_)
    for joints, _ in along:
        away = np.linalg.norm(frame.joints - joints[at], axis=-1)
        new &= np.fmax.reduce(away, axis=1, initial=0.0) > apart
    return new


def _markov(frames: Sequence[SurvivorFrame]) -> bool:
    """Tell whether no velocity reaches back past the last two survivors, and no cost is negative."""
    seen = [frame for frame in frames if len(frame)]
    if not seen:
        return True
    known = ~np.isnan(seen[0].joints[0, :, 0])
    return all(
        bool((np.isnan(frame.joints[..., 0]) == ~known).all()) and float(frame.cost.min()) >= 0
        for frame in seen
    )


def _codes(frames: Sequence[SurvivorFrame], path: NDArray[np.intp]) -> tuple[str, ...]:
    return tuple(
        frame.branches[one] if one >= 0 and frame.branches else ""
        for frame, one in zip(frames, path.tolist(), strict=True)
    )
