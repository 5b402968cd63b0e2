"""Which lengths are wrong, where no posture explains the frames, and what the data would need instead.

A segment that is stated too short does not reach the ray of its end; one stated too long must point along its ray,
which the other points of torso and hips, or the limits of its joints, forbid. So lengths are varied one by one, both
sides together, and all at once, by factors from a third to three, and those are named that let the data be explained.
The torso and hips are judged first, each limb on what then is their best place.

A limb that is too long can be foreshortened in any one view; it is doubted where eight frames or more never show more
than two thirds of it. With all lengths wrong by a factor it may as well be the root's distance that is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.body import Figure
from posekit.cameras import Camera, PinholeCamera, ScaledOrthographicCamera
from posekit.display.plural import plural
from posekit.errors import InputError, PosekitError
from posekit.refinement.descent import CHI2_PRECISION
from posekit.refinement.figure_numbers import LIMB_ENDS, LIMB_MIDDLES, LIMB_STARTS, TRUNK_SEGMENTS
from posekit.refinement.limb_descent import fit_limbs
from posekit.refinement.limb_terms import Chains, chi2_of_limbs
from posekit.refinement.observed_frames import ObservedFrames
from posekit.refinement.prior import RootPrior
from posekit.refinement.problem import RefinementProblem
from posekit.refinement.refined import REJECTION_PROBABILITY
from posekit.refinement.start import limb_directions, relift, state_of
from posekit.refinement.state import parents
from posekit.refinement.trunks import Trunks, find_trunks
from posekit.skeleton import LIMB_JOINTS, SEGMENT_NAMES, segment_name

MOST_FRAMES: Final = 16
"""Frames that are looked at, evenly chosen."""

COARSE_FACTORS: Final = 2.0 ** (np.arange(-10, 11) / 6)
"""Factors by which lengths are varied."""

FINE_FACTORS: Final = 2.0 ** (np.arange(-4, 5) / 24)
"""And around the best of every second."""

N_FRAMES_COMPARED: Final = 5
"""Frames on which suspects are compared."""

MAX_FRAME_CHI2: Final = 60.0
"""The most that one frame counts, so that a gross mistake in one decides nothing."""

MAX_LIMB_CHI2: Final = 30.0
"""A chi2 that a limb on the best trunk, held, is not expected to have."""

MIN_UNEXPLAINED_SHARE: Final = 0.1
"""Share of frames that must be unexplained before lengths are doubted."""

MAX_STEPS: Final = 8
"""Steps of a limb on a trunk that is held: it has four unknowns."""

MAX_SHOWN_SHARE: Final = 0.65
"""A segment that never shows more than this share of its length, foreshortened in every frame, is doubted..."""

MIN_FRAMES_SHOWN: Final = 8
"""... given as many frames: of random directions one in four shows as little, of eight frames all in 1e-5."""

SUSPECT_SEGMENTS: Final[tuple[tuple[int, ...], ...]] = ((0,), (1,), (0, 1))
"""Segments of a limb that may be wrong together."""

TRUNK_NAMES: Final = tuple(segment_name(pair) for pair in TRUNK_SEGMENTS)


@dataclass(frozen=True, kw_only=True)
class LengthDoubt:
    """A length that the data contradict.

    Parameters
    ----------
    segment : str
        Its name, ``a-b``.
    stated, needed : float
        Metres: the figure's, and the one nearest to it (for torso and hips the likeliest) that the data allow.
    least, most : float
        Metres: the range that the data allow equally well, as far as it was looked at.
    frames, unexplained, left : int
        Frames looked at; those without an acceptable posture of this part as stated, and with `needed`. A segment that
        is never seen nearly as long as it is stated has the least that explains all frames as `needed`.
    """

    segment: str
    stated: float
    needed: float
    least: float
    most: float
    frames: int
    unexplained: int
    left: int

    def __str__(self) -> str:
        """Say it in one line."""
        stated = f"{self.segment} is stated as {self.stated:.3f} m, but"
        if self.needed == self.least and self.needed < self.stated:
            return (
                f"{stated} none of {plural(self.frames, 'frame')} shows more than {self.needed:.3f} m of it"
            )
        need = f"{stated} {self.unexplained} of {plural(self.frames, 'frame')} need {self.needed:.3f} m"
        if self.needed == self.least and self.most > self.needed:
            return f"{need} of it or more"
        return f"{need} or the like ({self.least:.3f} to {self.most:.3f} m)"


def diagnose(observed: ObservedFrames, *, level: float = REJECTION_PROBABILITY) -> list[LengthDoubt]:
    """Say which lengths would have to change, and to what, for the data to be explained.

    Parameters
    ----------
    observed : ObservedFrames
        Frames of one person, those without an acceptable posture among them; the more, the more is told. Its root
        must say where the neck is.
    level : float
        Probability with which noise alone gives a trunk that counts as not explained.

    Returns
    -------
    list of LengthDoubt
        In the order of `posekit.skeleton.SEGMENT_NAMES`; empty where lengths are not what is wrong, or no single cause
        among those above explains the data better.

    Raises
    ------
    InputError
        Where there is no root.
    """
    if observed.root is None:
        raise InputError("diagnose: no root was given; expected a RootPrior that says where necks are")
    known = np.flatnonzero(
        np.isfinite(observed.root.mean).all(axis=1) & np.isfinite(observed.points()).any(axis=(1, 2))
    )
    if not len(known):
        return []
    frames = known[np.linspace(0, len(known) - 1, min(len(known), MOST_FRAMES)).round().astype(np.intp)]
    observed = _of_frames(observed, frames)
    factors, doubts, trunks = _trunk(observed, level)
    figure = observed.figure.scaled({name: observed.figure.lengths[name] * f for name, f in factors.items()})
    if len(trunks):
        held = replace(observed, figure=figure)
        doubts += [doubt for doubt in _limbs(held, trunks) if doubt.segment not in factors]
    return sorted(doubts, key=lambda doubt: SEGMENT_NAMES.index(doubt.segment))


def _of_frames(observed: ObservedFrames, frames: NDArray[np.intp]) -> ObservedFrames:
    """Return some frames, their heads left out."""
    points = observed.points()
    deviation = np.broadcast_to(np.asarray(observed.deviation, dtype=np.float64), points.shape[:2])
    if observed.root is None:
        raise InputError("no root was given")
    root = RootPrior(mean=observed.root.mean[frames], covariance=observed.root.covariance[frames])
    return replace(
        observed,
        camera=_camera_of(observed.camera, frames),
        image=points[frames],
        deviation=deviation[frames],
        root=root,
        head_image=None,
        head_deviation=None,
    )


def _camera_of(camera: Camera, frames: NDArray[np.intp]) -> Camera:
    if isinstance(camera, PinholeCamera) and camera.K.ndim == 3 and len(camera.K) > 1:
        return replace(camera, K=camera.K[frames])
    if isinstance(camera, ScaledOrthographicCamera) and np.size(camera.scale) > 1:
        return replace(camera, scale=np.asarray(camera.scale)[frames])
    return camera


class _Trial(NamedTuple):
    cost: float
    left: int
    trunks: Trunks


def _trunk(observed: ObservedFrames, level: float) -> tuple[dict[str, float], list[LengthDoubt], Trunks]:
    """Vary torso and hips; return the factors of the best explanation, its doubts, and the trunks."""
    given = _judge(observed, observed.figure, level)
    count = len(observed.points())
    if given.left <= MIN_UNEXPLAINED_SHARE * count:
        return {}, [], given.trunks
    few = _of_frames(
        observed, np.unique(np.linspace(0, count - 1, N_FRAMES_COMPARED).round().astype(np.intp))
    )
    tried = {
        (names, f): trial.cost
        for names in _suspects()
        for f in COARSE_FACTORS[::2].tolist()
        if (trial := _try(few, names, f, level)) is not None
    }
    chosen, around = min(tried, key=lambda key: tried[key])
    fine = {f: _try(observed, chosen, f, level) for f in (around * FINE_FACTORS).tolist()}
    of = {f: trial for f, trial in fine.items() if trial is not None}
    factor = min(of, key=lambda f: of[f].cost)
    best = of[factor]
    if not best.left < given.left:
        return {}, [], given.trunks
    allowed = [f for f, trial in of.items() if trial.left <= best.left]
    counts = (count, given.left, best.left)
    doubts = [_doubt(observed.figure, name, factor, allowed, counts) for name in chosen]
    return dict.fromkeys(chosen, factor), doubts, best.trunks


def _suspects() -> list[tuple[str, ...]]:
    """List what may be wrong together: one distance, both sides of one, all lengths."""
    sides = [
        (name, name.replace("right", "left"))
        for name in TRUNK_NAMES
        if "right" in name and "left" not in name
    ]
    return [*((name,) for name in TRUNK_NAMES), *sides, SEGMENT_NAMES]


def _try(observed: ObservedFrames, names: Sequence[str], factor: float, level: float) -> _Trial | None:
    """Find trunks with some lengths changed; None where no torso or hips have such lengths."""
    try:
        figure = observed.figure.scaled({name: observed.figure.lengths[name] * factor for name in names})
    except PosekitError:
        return None
    return _judge(observed, figure, level)


def _judge(observed: ObservedFrames, figure: Figure, level: float) -> _Trial:
    trunks = find_trunks(replace(observed, figure=figure), level=0.0)
    count = len(observed.points())
    chi2, p = np.full(count, MAX_FRAME_CHI2), np.zeros(count)
    np.minimum.at(chi2, trunks.frame, trunks.chi2)
    np.maximum.at(p, trunks.frame, trunks.p)
    return _Trial(float(chi2.sum()), int((p < level).sum()), trunks)


def _limbs(observed: ObservedFrames, trunks: Trunks) -> list[LengthDoubt]:
    """Vary each limb's lengths on the best trunks."""
    judge = _Limbs.on(observed, trunks)
    doubts = []
    for limb, joints in enumerate(LIMB_JOINTS):
        names = [segment_name((joints[k], joints[k + 1])) for k in range(2)]
        stated = judge.explained(limb, (), 1.0)
        seen = judge.seen[limb]
        long = _too_long(observed.figure, judge, limb, names) if seen.sum() >= MIN_FRAMES_SHOWN else []
        if long:
            doubts += long
        elif (seen & ~stated).sum() > MIN_UNEXPLAINED_SHARE * seen.sum():
            doubts += _too_short(observed.figure, judge, limb, names, stated)
    return doubts


def _too_short(
    figure: Figure, judge: _Limbs, limb: int, names: list[str], stated: NDArray[np.bool_]
) -> list[LengthDoubt]:
    """Name the segments of a limb that let more frames be explained: one rather than both, as little as will do."""
    left = {
        (parts, f): int((~judge.explained(limb, parts, f)).sum())
        for parts in SUSPECT_SEGMENTS
        for f in COARSE_FACTORS.tolist()
    }
    parts, coarse = min(left, key=lambda key: (left[key], len(key[0]), abs(np.log(key[1]))))
    least = left[parts, coarse]
    if not least < (~stated).sum():
        return []
    near = coarse * (COARSE_FACTORS[1] / COARSE_FACTORS[0]) ** (np.sign(-np.log(coarse)) * np.arange(8) / 8)
    allowed = [f for f in near.tolist() if (~judge.explained(limb, parts, f)).sum() <= least]
    factor = min(allowed, key=lambda f: abs(np.log(f)))
    allowed += [f for f in COARSE_FACTORS.tolist() if left[parts, f] <= least]
    counts = (judge.number, int((~stated).sum()), least)
    return [_doubt(figure, names[k], factor, allowed, counts) for k in parts]


def _too_long(figure: Figure, judge: _Limbs, limb: int, names: list[str]) -> list[LengthDoubt]:
    """Name the segments of a limb that a much shorter one explains in every frame."""
    seen = judge.seen[limb]
    frames = int(seen.sum())
    unexplained = int((seen & ~judge.explained(limb, (), 1.0)).sum())
    doubts = []
    for part, name in enumerate(names):
        short = [
            f
            for f in COARSE_FACTORS[COARSE_FACTORS < MAX_SHOWN_SHARE].tolist()
            if judge.explained(limb, (part,), f)[seen].all()
        ]
        if short:
            longer = COARSE_FACTORS[(COARSE_FACTORS >= MAX_SHOWN_SHARE) & (COARSE_FACTORS <= 1.0)].tolist()
            allowed = short + [f for f in longer if judge.explained(limb, (part,), f)[seen].all()]
            doubts.append(_doubt(figure, name, min(short), allowed, (frames, unexplained, 0)))
    return doubts


def _doubt(
    figure: Figure, name: str, factor: float, allowed: Sequence[float], counts: tuple[int, int, int]
) -> LengthDoubt:
    stated = figure.lengths[name]
    frames, unexplained, left = counts
    return LengthDoubt(
        segment=name,
        stated=stated,
        needed=stated * factor,
        least=stated * min(allowed),
        most=stated * max(allowed),
        frames=frames,
        unexplained=unexplained,
        left=left,
    )


class _Limbs(NamedTuple):
    """Limbs on H trunks, each near and far: four columns a trunk.

    Attributes
    ----------
    problem : RefinementProblem
        Of 4 H columns, lengths held.
    chains : Chains
    far : bool array (4, 2, 4 H)
    frame : int array (4 H,)
        As numbers from zero.
    number : int
        Frames with a trunk.
    """

    problem: RefinementProblem
    chains: Chains
    far: NDArray[np.bool_]
    frame: NDArray[np.intp]
    number: int

    @staticmethod
    def on(observed: ObservedFrames, trunks: Trunks) -> _Limbs:
        """Set limbs on trunks that are explained, or the best there are."""
        n = len(trunks)
        column = np.repeat(np.arange(n), 4)
        postures = np.full((n, 14, 3), np.nan)
        postures[:, :6] = trunks.joints
        problem = replace(observed, length_deviation=0.0).problem(trunks.frame, trunks.root)
        state = state_of(problem.anatomy, postures)
        directions = limb_directions(postures, np.tile(np.arange(n), (4, 1)), state)
        start = np.ascontiguousarray(trunks.joints[:, list(LIMB_STARTS)].transpose(1, 2, 0))
        chains = Chains(start, parents(state), directions, state.limbs).take(column)
        choice = np.tile(np.arange(4), n)
        far = np.broadcast_to(np.stack([choice & 1, choice >> 1])[None] > 0, (4, 2, 4 * n))
        _, frame = np.unique(trunks.frame, return_inverse=True)
        return _Limbs(problem.take(column), chains, far, frame[column], int(frame.max()) + 1)

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Which frames show the ends of both segments (4, number)."""
        weight = self.problem.weight
        both = (weight[list(LIMB_MIDDLES)] > 0) & (weight[list(LIMB_ENDS)] > 0)
        seen = np.zeros((4, self.number), dtype=np.bool_)
        seen[:, self.frame] = both
        return seen

    def explained(self, limb: int, parts: Sequence[int], factor: float) -> NDArray[np.bool_]:
        """Return which frames (number,) a limb with some of its segments changed explains."""
        lengths = self.chains.lengths.copy()
        for part in parts:
            lengths[limb, part] *= factor
        chains = relift(self.problem, self.chains._replace(lengths=lengths), self.far)
        chi2 = chi2_of_limbs(self.problem, chains)
        used = np.zeros(chi2.shape, dtype=np.bool_)
        used[limb] = True
        fit_limbs(
            self.problem,
            chains,
            chi2,
            used,
            steps=MAX_STEPS,
            precision=CHI2_PRECISION,
            hopeless=10.0 * MAX_LIMB_CHI2,
        )
        best = np.full(self.number, np.inf)
        np.minimum.at(best, self.frame, chi2[limb])
        return np.asarray(best <= MAX_LIMB_CHI2)
