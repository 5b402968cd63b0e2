"""What the studies look at: postures seen by a camera, and what is told of the body and of s."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from posekit.body import Figure, stature_from_lengths
from posekit.errors import InputError
from posekit.geometry import Array
from posekit.recovery.taylor_figure.human import Human
from posekit.recovery.taylor_figure.proportions import figure_of
from posekit.synthesis import SyntheticScene

Proportions = Literal["figure", "taylor"]
Scale = Literal["stature", "flat", "min"]

PIXELS_PER_METRE = 300.0
"""Pixels a metre of the exact views: any number would do, the flips do not know it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyPictures:
    """F pictures of one person, with the truth.

    Parameters
    ----------
    figure : Figure
        Whose shape and limits the checks judge by.
    lengths : array (S,) or (F, S)
        What is taken for the lengths of the eleven segments, metres.
    image : array (F, 12, 2)
        Pixels.
    scale : array (F,)
        What is taken for s, pixels a metre.
    truth : array (F, 12, 3)
        The true points, camera frame, metres.
    short : bool array (F,)
        Whether s was told, and is below its lower bound: some segment is too short for its image.
    """

    figure: Figure
    lengths: Array
    image: Array
    scale: Array
    truth: Array
    short: NDArray[np.bool_]

    def __post_init__(self) -> None:
        for name in ("lengths", "image", "scale", "truth", "short"):
            values = np.array(getattr(self, name))
            values.flags.writeable = False
            object.__setattr__(self, name, values)

    def __len__(self) -> int:
        """Return the number of pictures."""
        return len(self.image)

    def parts(self, size: int) -> Iterator[StudyPictures]:
        """Cut the pictures into parts of at most `size`."""
        for first in range(0, len(self), size):
            rows = slice(first, first + size)
            lengths = self.lengths[rows] if self.lengths.ndim == 2 else self.lengths
            per_picture = {name: getattr(self, name)[rows] for name in ("image", "scale", "truth", "short")}
            yield replace(self, lengths=lengths, **per_picture)


def exact_views(human: Human, scenes: Iterable[SyntheticScene]) -> list[StudyPictures]:
    """View every frame by a scaled orthographic camera, with its own lengths and the true s.

    Parameters
    ----------
    human : Human
        Taylor's human: its points and segments.
    scenes : iterable of SyntheticScene
        Their cameras' axes are the directions of view; their figures are judged by.
    """
    seen = []
    for scene in scenes:
        truth = np.asarray(scene.joints_cam[:, human.joints])
        n = len(truth)
        seen.append(
            StudyPictures(
                figure=scene.figure,
                lengths=human.measure(truth),
                image=truth[..., :2] * PIXELS_PER_METRE,
                scale=np.full(n, PIXELS_PER_METRE),
                truth=truth,
                short=np.zeros(n, dtype=bool),
            )
        )
    return seen


def photographs(
    human: Human,
    scenes: Iterable[SyntheticScene],
    *,
    noise: float,
    rng: np.random.Generator,
    proportions: Proportions = "figure",
    scale: Scale = "stature",
) -> list[StudyPictures]:
    """View every frame by its scene's perspective camera, with noise, and find s as Taylor does.

    Parameters
    ----------
    human : Human
        Taylor's human: its points and segments.
    scenes : iterable of SyntheticScene
        Their figures are the people; the stature follows from the limbs (`posekit.body.stature_from_lengths`).
    noise : float
        Standard deviation of each image coordinate, pixels.
    rng : Generator
        Draws the noise.
    proportions : {"figure", "taylor"}
        Take the person's own lengths, or those of Table 1 at the person's stature.
    scale : {"stature", "flat", "min"}
        ``stature``: the stature in pixels over the stature (section 3.2), raised to the lower bound where it is less.
        The stature is seen at the mean depth of the twelve points, both its ends with noise. ``flat``: the same, not
        raised; a segment that is too short for its image lies flat. ``min``: the lower bound (section 3.1).

    Raises
    ------
    InputError
        Where the noise is negative or not finite, or a choice is another word.
    """
    if not (np.isfinite(noise) and noise >= 0):
        raise InputError(f"noise is {noise:g} px; expected a standard deviation of zero or more")
    if proportions not in ("figure", "taylor"):
        raise InputError(f"proportions: {proportions!r}; expected figure or taylor")
    if scale not in ("stature", "flat", "min"):
        raise InputError(f"scale: {scale!r}; expected stature, flat or min")
    seen = []
    for scene in scenes:
        stature = stature_from_lengths(scene.figure.lengths)
        figure = scene.figure if proportions == "figure" else figure_of(stature)
        lengths = human.lengths_of(figure)
        truth = np.asarray(scene.joints_cam[:, human.joints])
        image = scene.image[:, human.joints]
        image = image + noise * rng.standard_normal(image.shape)
        pixels = scene.camera.K[..., 1, 1] * stature / truth[..., 2].mean(axis=1)
        pixels = pixels + noise * np.sqrt(2.0) * rng.standard_normal(len(truth))
        told, bound = pixels / stature, human.bound(image, lengths)
        seen.append(
            StudyPictures(
                figure=figure,
                lengths=lengths,
                image=image,
                scale={"stature": np.maximum(told, bound), "flat": told, "min": bound}[scale],
                truth=truth,
                short=np.zeros(len(truth), dtype=bool) if scale == "min" else told < bound,
            )
        )
    return seen
