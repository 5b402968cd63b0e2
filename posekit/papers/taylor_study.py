"""The study of Taylor 2000 on posekit's figure: which flips the checks leave, and how near the truth they are."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from posekit.body import load_figure
from posekit.papers.taylor_protocol import Accuracy, accuracy, accuracy_lines
from posekit.papers.taylor_survival import Survival, survival, survival_lines
from posekit.papers.taylor_views import Proportions, Scale, exact_views, photographs
from posekit.recovery.taylor_figure.human import Human, taylor_human
from posekit.settings import MEASURED_TOLERANCE, PHOTOGRAPH_TOLERANCE
from posekit.synthesis import CameraSphere, SyntheticScene, random_views

CAMERA_SPHERE = CameraSphere(distance=(3.0, 6.0))
"""Where the cameras stand: anywhere around the person, 3 to 6 m away."""

NOISE_PIXELS = 2.0
"""Pixels, standard deviation of each coordinate."""

STATURE_METRES = 1.75
"""Metres: the synthetic person's."""

LENGTH_SOURCES: dict[Proportions, str] = {
    "figure": "the person's own lengths",
    "taylor": "Table 1's proportions",
}
SCALE_SOURCES: dict[Scale, str] = {
    "stature": "s from the stature in pixels, raised to the bound where it is below",
    "flat": "s from the stature in pixels, too short segments flat",
    "min": "s at its lower bound",
}


@dataclass(frozen=True, kw_only=True)
class Photographed:
    """What is measured on photographs with one choice of proportions and s.

    Parameters
    ----------
    proportions, scale
        See `posekit.papers.taylor_views.photographs`.
    short : float
        Share of the pictures in which s as told is below its lower bound.
    survival : tuple of Survival
        What each check leaves.
    accuracy : tuple of Accuracy
        How near the truth the answers are.
    """

    proportions: Proportions
    scale: Scale
    short: float
    survival: tuple[Survival, ...]
    accuracy: tuple[Accuracy, ...]

    def lines(self) -> list[str]:
        """Lay both tables out in Markdown."""
        title = f"{LENGTH_SOURCES[self.proportions]}, {SCALE_SOURCES[self.scale]}"
        below = "" if self.scale == "min" else f"; below its bound in {self.short:.1%} of the pictures"
        return [
            f"### {title[0].upper()}{title[1:]}",
            "",
            f"Survivors of the 2048 flips{below}:",
            "",
            *survival_lines(self.survival),
            "Six points against the truth (section 3.2):",
            "",
            *accuracy_lines(self.accuracy),
        ]


@dataclass(frozen=True, kw_only=True)
class Study:
    """Taylor's human on some postures.

    Parameters
    ----------
    title : str
        What postures, and what they are.
    pictures : int
        How many pictures there are.
    exact : tuple of Survival
        Scaled orthographic pictures, true s, the frame's own lengths.
    photographs : tuple of Photographed
        A perspective camera, noise.
    """

    title: str
    pictures: int
    exact: tuple[Survival, ...]
    photographs: tuple[Photographed, ...]

    def lines(self) -> list[str]:
        """Lay the study out in Markdown."""
        lines = [
            f"# {self.title}",
            "",
            f"{self.pictures} pictures.",
            "",
            "## Exact scaled orthographic pictures, the true s, the frame's own lengths",
            "",
            f"Tolerances: rigid parts {MEASURED_TOLERANCE.rigid * 100:g} cm, angles "
            f"{MEASURED_TOLERANCE.angle:g} degrees.",
            "",
            *survival_lines(self.exact),
        ]
        lines += [
            f"## Photographs: a perspective camera {CAMERA_SPHERE.distance[0]:g} to {CAMERA_SPHERE.distance[1]:g} m "
            f"away, {NOISE_PIXELS:g} px of noise",
            "",
            f"Tolerances: rigid parts {PHOTOGRAPH_TOLERANCE.rigid * 100:g} cm, angles "
            f"{PHOTOGRAPH_TOLERANCE.angle:g} degrees.",
            "",
        ]
        for one in self.photographs:
            lines += one.lines()
        return lines


def synthetic_study(pictures: int = 300, seed: int = 0) -> Study:
    """Study random legal postures of the figure: uniform inside all its limits, free of collision.

    Parameters
    ----------
    pictures : int
        How many postures are drawn, each for one picture.
    seed : int
        Of postures, cameras and noise.
    """
    person = load_figure().from_stature(STATURE_METRES)
    scenes = (random_views(person, pictures, np.random.default_rng(seed), CAMERA_SPHERE, "urdf"),)
    human = taylor_human()
    return Study(
        title="Synthetic: random legal postures",
        pictures=pictures,
        exact=tuple(survival(human, exact_views(human, scenes), ranges=("urdf",))),
        photographs=tuple(photographed(human, scenes, seed, ("urdf",))),
    )


def photographed(
    human: Human, scenes: Sequence[SyntheticScene], seed: int, ranges: Sequence[str]
) -> Iterator[Photographed]:
    """Measure photographs of scenes with each choice of lengths and of s; `seed` is that of their noise."""
    for proportions, scale in product(LENGTH_SOURCES, SCALE_SOURCES):
        seen = photographs(
            human,
            scenes,
            noise=NOISE_PIXELS,
            rng=np.random.default_rng(seed),
            proportions=proportions,
            scale=scale,
        )
        yield Photographed(
            proportions=proportions,
            scale=scale,
            short=float(np.concatenate([pictures.short for pictures in seen]).mean()),
            survival=tuple(survival(human, seen, tolerance=PHOTOGRAPH_TOLERANCE, ranges=ranges)),
            accuracy=tuple(accuracy(human, seen, tolerance=PHOTOGRAPH_TOLERANCE)),
        )
