"""Whether probabilities come true of people that nothing was fitted to, and the weights under which they do.

    python -m benchmarks.studies.calibration CAPTURE.npz PYBULLET.whl [--views 1000] [--fit PRIOR.toml] [--paths]

Files are motion as `benchmarks/people.py` reads it, one a source. Of each source as many frames are drawn evenly over
its clips, each seen by a camera of its own as in `benchmarks/answers.py` (2 px, neck given), by `anatomical` ranges, in
three ways: with each clip's median lengths, of which nothing is said; with lengths that are off by 1 % and by 5 %, the
size and each of them, drawn anew every five frames, of which that is said.

Clips are held out in six groups: some clips, some actions (of both sources), or a whole source. What is held out is
ranked by a prior that was fitted to the others, with weights that were fitted to the others too, each of them ranked by
a prior that knew neither its own group nor the one that is held out. Tables are those of `benchmarks/answers.py`, and
of how far from what is stated a perfect ranking would come. ``--paths`` asks
instead how often the first of two paths is the nearer one where they differ: two seconds of every clip from four sides,
ranked by a prior that does not know the clip.
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.answers import HEAD, Frame, HalfHeld, measured, row
from benchmarks.people import people
from benchmarks.sequence_views import clip_scene, noisy, odds_of_two, odds_table
from benchmarks.studies.people_prior import action_of, prior_of_people
from benchmarks.studies.weight_fitting import fit_weights
from posekit.answers import ListedBodies
from posekit.answers.answer import answers_of
from posekit.evaluate.scores import reliability
from posekit.formats.markdown import table_lines
from posekit.geometry import Array
from posekit.ranking import Prior, Ranking, RankingEvidence, Up, load_prior, rank, write_prior
from posekit.ranking.posture_prior import TERM_NAMES
from posekit.ranking.ranking import softmax
from posekit.recovery import recover
from posekit.recovery.ranked import up_of
from posekit.skeleton import SEGMENT_NAMES
from posekit.synthesis import Capture, mocap_scenes
from posekit.views.builtin import view_of

NOISE_PIXELS: Final = 2.0
LENGTHS: Final = {"as they are": None, "off by 1 %": 0.01, "off by 5 %": 0.05}
PERSON_FRAMES, GROUPS = 5, 6
"""Frames of one draw of lengths, and groups of what is held out."""
PERFECT_DRAWS: Final = 50
SIDES_DEGREES, APART_METRES = (10, 100, 190, 280), 0.25

Held = tuple[NDArray[np.intp], ...]
"""The group of each clip, a source each."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Seen:
    """A frame: its bodies, what ranking needs of them, and the truth."""

    source: int
    clip: int
    lengths: str
    bodies: ListedBodies
    evidence: RankingEvidence
    truth: Array
    up: Array

    @property
    def nearest(self) -> int:
        """The body that is nearest to the truth."""
        return int(np.linalg.norm(self.bodies.joints - self.truth, axis=-1).mean(axis=1).argmin())


def seen(captures: Sequence[Capture], views: int, lengths: str, seed: int = 101) -> Iterator[Seen]:
    """Recover views of all captures: every body that each frame can be."""
    off = LENGTHS[lengths]
    for source, capture in enumerate(captures):
        rng, drawing = np.random.default_rng(seed), np.random.default_rng(seed + 1)
        for clip, scene in enumerate(mocap_scenes(capture, views, rng, sphere=HalfHeld())):
            view = view_of(scene.with_noise(NOISE_PIXELS, drawing))
            image = view.image.copy()
            image[:, 0] = scene.image[:, 0]
            view = replace(view, image=image, deviation=NOISE_PIXELS)
            step = len(scene) if off is None else PERSON_FRAMES
            for start in range(0, len(scene), step):
                part = view.take(slice(start, start + step))
                if off is not None:
                    factors = np.exp(drawing.normal(0, off) + drawing.normal(0, off, len(SEGMENT_NAMES)))
                    named = dict(zip(SEGMENT_NAMES, factors.tolist(), strict=True))
                    part = replace(part, lengths={n: named[n] * v for n, v in (view.lengths or {}).items()})
                found = recover(part, coverage=1.0, length_deviation=off)
                for k, (frame, answer) in enumerate(zip(found.frames, found.answers, strict=True)):
                    if len(frame):
                        yield Seen(
                            source=source,
                            clip=clip,
                            lengths=lengths,
                            bodies=answer.bodies,
                            evidence=RankingEvidence.of(
                                frame.joints,
                                found.figure.lengths,
                                chi2=frame.chi2,
                                deviation=frame.spread,
                                up=up_of(part.camera) or Up.level(),
                            ),
                            truth=scene.joints_cam[start + k],
                            up=scene.R_cam_world[start + k] @ capture.up,
                        )


def groups(captures: Sequence[Capture], by: str) -> Held:
    """Put clips into groups, a clip or an action each in one."""
    rng = np.random.default_rng(5)
    if by != "action":
        return tuple(rng.permutation(len(one.names)) % GROUPS for one in captures)
    actions = sorted({action_of(name) for one in captures for name in one.actions})
    group = dict(zip(actions, (rng.permutation(len(actions)) % GROUPS).tolist(), strict=True))
    return tuple(np.array([group[action_of(name)] for name in one.actions]) for one in captures)


def held_out(captures: Sequence[Capture], frames: Sequence[Seen], by: str) -> Iterator[tuple[Seen, Array]]:
    """Yield each frame with the probabilities of its bodies, of which nothing was fitted to its like."""
    held = groups(captures, by)

    @cache
    def prior(sources: tuple[int, ...], *without: int) -> Prior:
        kept = [
            ~np.isin(group, without) if k in sources else np.zeros(len(group), dtype=bool)
            for k, group in enumerate(held)
        ]
        return _alike(prior_of_people(captures, kept))

    every = tuple(range(len(captures)))
    for out in every if by == "source" else range(GROUPS):
        rankings, nearest, tried = [], [], []
        for one in frames:
            own = int(held[one.source][one.clip])
            if by == "source":
                others = tuple(k for k in every if k != out)
                known = prior(others) if one.source == out else prior(others, own)
                mine = one.source == out
            else:
                known, mine = prior(every, *sorted({own, out})), own == out
            ranking = rank(one.evidence, prior=known)
            if mine:
                tried.append((one, ranking))
            else:
                rankings.append(ranking)
                nearest.append([one.nearest])
        weights = fit_weights(*_pooled(rankings, nearest), names=_fitted_terms(), astray=True)
        print(
            f"<!-- {by} {out}: " + ", ".join(f"{n} {v:.2f}" for n, v in weights.items()) + " -->", flush=True
        )
        for one, ranking in tried:
            yield one, scored(ranking, weights)


def scored(ranking: Ranking, weights: dict[str, float]) -> Array:
    """Return probabilities of terms that have not been weighted."""
    score = np.sum([weights[name] * ranking.terms[name] for name in weights], axis=0)
    return np.asarray(softmax(score, ranking.frame))


def _alike(prior: Prior) -> Prior:
    """Give a prior weights of one."""
    return replace(prior, weights=dict.fromkeys(prior.weights, 1.0), refined=None)


def _fitted_terms() -> list[str]:
    return [name for name in TERM_NAMES if name != "depth"]


def _pooled(
    rankings: Sequence[Ranking], nearest: Sequence[Sequence[int]]
) -> tuple[list[Ranking], list[Array]]:
    """Put rankings of a frame each into one, so that each frame counts the same."""
    starts = np.cumsum([0, *map(len, rankings)])
    terms = {n: np.concatenate([one.terms[n] for one in rankings]) for n in _fitted_terms()}
    frame = np.repeat(np.arange(len(rankings)), np.diff(starts))
    whole = Ranking(probability=np.zeros(len(frame)), frame=frame, terms=terms)
    return [whole], [np.concatenate(nearest) + starts[:-1]]


def perfect(stated: Array) -> float:
    """Return the calibration error that what is stated has where it is true, by chance alone."""
    rng = np.random.default_rng(0)
    found = [
        reliability(stated, (rng.random(len(stated)) < stated).astype(np.float64))
        for _ in range(PERFECT_DRAWS)
    ]
    return float(np.mean([one.error for one in found if one is not None]))


def table(name: str, frames: Sequence[tuple[Seen, Frame]]) -> list[str]:
    """Return a row of the table."""
    told = [frame for _, frame in frames]
    stated, true = (np.mean([f.numbers[f"5 cm {part}"] for f in told]) for part in ("stated", "true"))
    chance = perfect(np.array([frame.numbers["5 cm stated"] for frame in told]))
    return [*row(name, told), f"{stated:.2f}", f"{true:.2f}", f"{chance:.3f}"]


def paths_table(captures: Sequence[Capture]) -> list[str]:
    """Return how often the first of two paths that are 25 cm apart somewhere is the nearer one, by what is stated."""
    odds: list[tuple[float, bool]] = []
    for source, capture in enumerate(captures):
        for clip, name in enumerate(capture.names):
            kept = [np.ones(len(one.names), dtype=bool) for one in captures]
            kept[source][clip] = False
            prior = prior_of_people(captures, kept)
            for yaw in SIDES_DEGREES:
                scene = clip_scene(capture, name, yaw)
                rng = np.random.default_rng(1000 * source + 10 * clip + yaw)
                found = noisy(scene.with_noise(NOISE_PIXELS, rng), NOISE_PIXELS, real=True)
                odds += odds_of_two(found.ranked(prior), scene.joints_cam, APART_METRES)
    return table_lines(*odds_table(odds))


def fit(captures: Sequence[Capture], frames: Sequence[Seen], path: Path) -> None:
    """Write the built-in prior with weights that are fitted to frames whose action the prior did not know."""
    held = groups(captures, "action")

    @cache
    def prior(out: int) -> Prior:
        return _alike(prior_of_people(captures, [group != out for group in held]))

    rankings = [rank(one.evidence, prior=prior(int(held[one.source][one.clip]))) for one in frames]
    found = fit_weights(
        *_pooled(rankings, [[one.nearest] for one in frames]), names=_fitted_terms(), astray=True
    )
    built_in = load_prior()
    write_prior(path, replace(built_in, refined={**(built_in.refined or {}), **found}))
    print(f"written: {path}, " + ", ".join(f"{name} {value:.3f}" for name, value in found.items()))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sources", type=Path, nargs="*")
    parser.add_argument("--views", type=int, default=1000)
    parser.add_argument("--fit", type=Path)
    parser.add_argument("--paths", action="store_true")
    given = parser.parse_args()
    if len(given.sources) < 2:
        print("no motion given: python -m benchmarks.studies.calibration FILE FILE [--fit PRIOR.toml]")
        return
    warnings.simplefilter("ignore", UserWarning)
    captures = [people(path) for path in given.sources]
    if given.paths:
        print("\n".join(paths_table(captures)))
        return
    frames = [one for lengths in LENGTHS for one in seen(captures, given.views, lengths)]
    if given.fit is not None:
        fit(captures, frames, given.fit)
        return
    whose: dict[str, Callable[[Seen], bool]] = {"all": lambda one: True}
    whose |= {path.name[:12]: partial(_is_of, source=k) for k, path in enumerate(given.sources)}
    for by in ("clip", "action", "source"):
        rng = np.random.default_rng(1)
        told = [
            (one, measured(answers_of([replace(one.bodies, probability=p)])[0], one.truth, one.up, rng))
            for one, p in held_out(captures, frames, by)
        ]
        rows = [
            table(f"{lengths}, {name}", part)
            for lengths in LENGTHS
            for name, chosen in whose.items()
            if (part := [pair for pair in told if pair[0].lengths == lengths and chosen(pair[0])])
        ]
        rows += [
            table(
                f"{lengths}, {way}",
                [pair for pair in told if (pair[0].lengths, pair[1].direction) == (lengths, way)],
            )
            for lengths in LENGTHS
            for way in ("front", "back", "side")
        ]
        print(f"\nHeld out by {by}\n")
        print(
            "\n".join(table_lines([*HEAD, "5 cm: stated", "came true", "a perfect one's ECE"], rows)),
            flush=True,
        )


def _is_of(one: Seen, source: int) -> bool:
    return one.source == source


if __name__ == "__main__":
    main()
