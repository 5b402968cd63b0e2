"""The studies of Taylor 2000 on posekit's figure: synthetic postures, and real ones given a capture."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np

from posekit.body import load_figure
from posekit.formats.markdown import table_lines
from posekit.papers.taylor_protocol import Accuracy, accuracy, accuracy_lines
from posekit.papers.taylor_survival import Survival, survival, survival_lines
from posekit.papers.taylor_views import Proportions, Scale, StudyPictures, exact_views, photographs
from posekit.recovery.taylor_figure.human import Human, taylor_human
from posekit.settings import MEASURED_TOLERANCE, PHOTOGRAPH_TOLERANCE, Tolerance
from posekit.synthesis import CameraSphere, SyntheticScene, mocap_scenes, random_views, read_capture

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
class Swept:
    """What all checks together leave at one tolerance."""

    tolerance: Tolerance
    rigid: Survival
    all: Survival


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
    rigid : tuple of Swept
        Exact pictures at several tolerances of rigid parts; may be empty.
    swept : tuple of Swept
        Photographs, own lengths, s from the stature, at several tolerances; may be empty.
    """

    title: str
    pictures: int
    exact: tuple[Survival, ...]
    photographs: tuple[Photographed, ...]
    rigid: tuple[Swept, ...] = ()
    swept: tuple[Swept, ...] = ()

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
        if self.rigid:
            lines += ["The tolerance of rigid parts:", "", *_swept_lines(self.rigid)]
        lines += [
            f"## Photographs: a perspective camera {CAMERA_SPHERE.distance[0]:g} to {CAMERA_SPHERE.distance[1]:g} m "
            f"away, {NOISE_PIXELS:g} px of noise",
            "",
            f"Tolerances: rigid parts {PHOTOGRAPH_TOLERANCE.rigid * 100:g} cm, angles "
            f"{PHOTOGRAPH_TOLERANCE.angle:g} degrees.",
            "",
        ]
        if self.swept:
            lines += [
                "The tolerances (the person's own lengths, s from the stature):",
                "",
                *_swept_lines(self.swept),
            ]
        for photographed in self.photographs:
            lines += photographed.lines()
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
    scenes = (random_views(person, pictures, np.random.default_rng(seed), CAMERA_SPHERE),)
    human = taylor_human()
    return Study(
        title="Synthetic: random legal postures",
        pictures=pictures,
        exact=tuple(survival(human, exact_views(human, scenes), ranges=("urdf",))),
        photographs=tuple(_photographs(human, scenes, seed, ("urdf",))),
    )


def capture_study(capture: Path, pictures: int = 1000, seed: int = 0) -> Study:
    """Study real postures, drawn evenly over the clips of a capture, each seen by a camera of its own.

    Parameters
    ----------
    capture : Path
        An NPZ as `posekit.synthesis.read_capture` reads it.
    pictures : int
        How many frames are drawn, each for one picture.
    seed : int
        Of cameras and noise.

    Raises
    ------
    InputError
        Where the file is not a capture or has too few frames with all joints.
    """
    scenes = mocap_scenes(read_capture(capture), pictures, np.random.default_rng(seed), sphere=CAMERA_SPHERE)
    human = taylor_human()
    exact = exact_views(human, scenes)
    seen = photographs(human, scenes, noise=NOISE_PIXELS, rng=np.random.default_rng(seed))
    return Study(
        title="Real motion capture",
        pictures=pictures,
        exact=tuple(survival(human, exact)),
        photographs=tuple(_photographs(human, scenes, seed, ("urdf", "table1"))),
        rigid=tuple(_sweep(human, exact, MEASURED_TOLERANCE, (0.005, 0.01, 0.02, 0.03, 0.04, 0.06), (2.0,))),
        swept=tuple(
            _sweep(human, seen, PHOTOGRAPH_TOLERANCE, (0.03, 0.06, 0.10, 0.15), (2.0, 5.0, 10.0, 15.0))
        ),
    )


def _photographs(
    human: Human, scenes: Sequence[SyntheticScene], seed: int, ranges: Sequence[str]
) -> Iterator[Photographed]:
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


def _sweep(
    human: Human,
    seen: Sequence[StudyPictures],
    base: Tolerance,
    rigid: Sequence[float],
    angle: Sequence[float],
) -> Iterator[Swept]:
    for metres, degrees in product(rigid, angle):
        tolerance = replace(base, rigid=metres, angle=degrees)
        table = {row.checks: row for row in survival(human, seen, tolerance=tolerance, ranges=("urdf",))}
        yield Swept(tolerance=tolerance, rigid=table["rigid parts"], all=table["all, urdf"])


def _swept_lines(table: Sequence[Swept]) -> list[str]:
    head = (
        "rigid parts, cm",
        "angles, deg",
        "rigid parts alone: survivors, median",
        "truth among them",
        "all checks, urdf: survivors, median",
        "mean",
        "truth among them",
        "truth and mirror image",
    )
    rows = [
        (
            f"{one.tolerance.rigid * 100:g}",
            f"{one.tolerance.angle:g}",
            f"{np.median(one.rigid.count):g}",
            f"{one.rigid.truth.mean():.1%}",
            f"{np.median(one.all.count):g}",
            f"{one.all.count.mean():.1f}",
            f"{one.all.truth.mean():.1%}",
            f"{one.all.pair.mean():.1%}",
        )
        for one in table
    ]
    return table_lines(head, rows)
