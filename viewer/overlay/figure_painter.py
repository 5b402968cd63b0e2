"""Figures painted into a picture through the camera that took it: capsules by depth, bones, joints, image points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from PIL import Image, ImageDraw

from posekit.body import Figure, with_head
from posekit.body.capsules import Capsule
from posekit.geometry import Array, cross
from posekit.skeleton import HEAD, POINTS, TREE_SEGMENTS
from posekit.viewer.caption import write_caption
from posekit.viewer.scene.colours import POINT_SIDES, SIDE_RGB, side
from posekit.viewer.scene.drawn_subject import Shown
from posekit.viewer.scene.image_sight import ImageSight

FINER_FACTOR: Final = 2
"""How many times larger the part of the picture with figures is painted, for smooth edges."""

MAX_FINER_PIXELS: Final = 8_000_000
"""Pixels of a part that is painted finer: in a larger one edges are smooth enough."""

RIM_POINTS, OUTLINE_CORNERS = 24, 48
"""Points around each end of a capsule, and corners of its outline."""

BODY_OPACITY: Final = 0.5
"""Of the capsules: what is behind them in the photograph is still seen."""

FADED_OPACITY, LEAST_OPACITY = 0.7, 0.12
"""Of another survivor's bones: where it is as likely as the likeliest, and where it is hardly likely."""

MAX_FADED: Final = 40
"""Other survivors of a person that are painted, the likeliest: more are not told apart."""

Colour = tuple[int, int, int]
DARK_COLOUR: Final[Colour] = (20, 20, 20)
LIGHT_COLOUR: Final[Colour] = (255, 255, 255)


@dataclass(frozen=True, kw_only=True, eq=False)
class DrawnPerson:
    """One person in one picture.

    Parameters
    ----------
    shown : Shown
        The postures, the one to be painted as a body first, with their sight.
    figure : Figure
        Whose capsules.
    zoom : float
        Pixels of the picture for each that the sight counts.
    points : bool
        Whether the image points that were detected are ringed.
    """

    shown: Shown
    figure: Figure
    zoom: float = 1.0
    points: bool = True

    @property
    def sight(self) -> ImageSight:
        """What the camera sees; who has none is not painted."""
        assert self.shown.sight is not None
        return self.shown.sight

    def seen(self, row: int) -> Array:
        """Return where the camera sees the points (19, 2) of a posture, in pixels of the picture."""
        return self.projected(self.shown.points[row], row)

    def projected(self, points: Array, row: int) -> Array:
        """Project points (N, 3) of a posture, each posture at its own scale."""
        sight = self.sight
        if self.shown.scales is not None:
            sight = sight.rescaled(float(self.shown.scales[row]))
        return zoomed(sight.camera.project(points[None])[0], self.zoom)


def zoomed(pixels: Array, zoom: float) -> Array:
    """Scale image points whose whole numbers are the middles of pixels."""
    return np.asarray((pixels + 0.5) * zoom - 0.5)


def paint(picture: Image.Image, people: Sequence[DrawnPerson], *, caption: str = "") -> Image.Image:
    """Paint people into a picture.

    Parameters
    ----------
    picture : Image
        RGB.
    people : sequence of DrawnPerson
        The farthest is painted first.
    caption : str
        Written into the upper left corner.

    Returns
    -------
    Image
        Another one, of the same size.
    """
    painted = picture.copy()
    for person in sorted(people, key=_farness, reverse=True):
        _paint_person(painted, person)
    if caption:
        write_caption(painted, caption)
    return painted


def outlines(person: DrawnPerson, row: int = 0) -> list[tuple[float, str, Array]]:
    """Return the outlines of a posture's capsules, the farthest first: distance (m), link, corners (48, 2).

    An outline is the convex hull of what is seen of the capsule's two spheres, by its support in 48 directions. Seen
    from the centre of projection, a sphere of radius r at c covers the circle about c (1 - r^2 / c^2), across c, of
    radius r sqrt(1 - r^2 / c^2); in parallel rays, the circle about c itself.
    """
    points = with_head(np.asarray(person.shown.points[row], dtype=np.float64)[None])[0]
    capsules = person.figure.capsules
    placed = [_ends(capsule, points) for capsule in capsules]
    rims = np.stack(
        [_rims(ends, one.radius, person.sight) for ends, one in zip(placed, capsules, strict=True)]
    )
    seen = person.projected(rims.reshape(-1, 3), row).reshape(len(capsules), -1, 2)
    turns = 2 * np.pi * np.arange(OUTLINE_CORNERS) / OUTLINE_CORNERS
    support = np.argmax(seen @ np.stack([np.cos(turns), np.sin(turns)]), axis=1)
    corners = np.take_along_axis(seen, support[:, :, None], axis=1)
    found = [
        (float(ends[:, 2].mean()), capsule.link, outline)
        for ends, capsule, outline in zip(placed, capsules, corners, strict=True)
        if np.isfinite(outline).all()
    ]
    return sorted(found, key=lambda one: one[0], reverse=True)


def _ends(capsule: Capsule, points: Array) -> Array:
    """Return the ends (2, 3) of a capsule's axis."""
    middle, axis = capsule.place(points[None, list(capsule.points)])
    return np.concatenate([middle - capsule.half_length * axis, middle + capsule.half_length * axis])


def _rims(ends: Array, radius: float, sight: ImageSight) -> Array:
    """Return the circles (2 RIM_POINTS, 3) that are seen of the spheres at a capsule's ends; NaN from inside of one."""
    squared = (ends * ends).sum(axis=1)
    if sight.parallel:
        forward, shrunk = np.tile([0.0, 0.0, 1.0], (2, 1)), np.ones(2)
    else:
        inside = (ends[:, 2] <= radius) | (squared <= radius * radius)
        forward = ends / np.sqrt(squared)[:, None]
        shrunk = np.where(inside, np.nan, 1.0 - radius * radius / squared)
    across = cross(
        forward, np.array([0.0, 1.0, 0.0]) if abs(forward[0, 1]) < 0.9 else np.array([1.0, 0.0, 0.0])
    )
    across /= np.linalg.norm(across, axis=1)[:, None]
    up = cross(forward, across)
    turns = 2 * np.pi * np.arange(RIM_POINTS) / RIM_POINTS
    ring = np.cos(turns)[:, None, None] * across + np.sin(turns)[:, None, None] * up
    return np.asarray(ends * shrunk[:, None] + radius * np.sqrt(shrunk)[:, None] * ring).reshape(-1, 3)


def _farness(person: DrawnPerson) -> float:
    depth = person.shown.points[0, :, 2]
    known = np.isfinite(depth)
    return float(depth[known].mean()) if known.any() else 0.0


def _paint_person(picture: Image.Image, person: DrawnPerson) -> None:
    """Paint a person into a picture, of which only the part around him is worked on."""
    bodies = outlines(person)
    others = range(1, min(len(person.shown), 1 + MAX_FADED))
    bones = [person.seen(row) for row in (0, *others)]
    detected = zoomed(person.sight.image, person.zoom)
    everything = np.concatenate([*(outline for _, _, outline in bodies), *bones, detected])
    everything = everything[np.isfinite(everything).all(axis=1)]
    if not len(everything):
        return
    # What is far outside is cut off: a picture is no larger for it.
    low = np.clip(everything.min(axis=0) - 12, 0, picture.size).astype(int)
    high = np.clip(everything.max(axis=0) + 13, 0, picture.size).astype(int)
    if (high <= low).any():
        return
    box = (int(low[0]), int(low[1]), int(high[0]), int(high[1]))
    part = picture.crop(box)
    finer = FINER_FACTOR if part.width * part.height <= MAX_FINER_PIXELS else 1
    fine = part.resize((part.width * finer, part.height * finer), Image.Resampling.NEAREST)
    body = np.concatenate([np.empty((0, 2)), *(outline for _, _, outline in bodies), bones[0]])
    known = body[np.isfinite(body).all(axis=1)]
    height = float((known.max(axis=0) - known.min(axis=0)).max()) if len(known) else 100.0
    brush = _Brush(fine, low, max(1.0, 0.006 * height), finer)
    probability = person.shown.probability
    for row in others:
        share = (
            1.0 if probability is None or not probability[0] > 0 else float(probability[row] / probability[0])
        )
        opacity = LEAST_OPACITY + (FADED_OPACITY - LEAST_OPACITY) * min(share, 1.0)
        brush.bones(bones[row], opacity=opacity)
    solid = fine.copy()
    capsules = _Brush(solid, low, brush.width, finer)
    for _, link, outline in bodies:
        capsules.body(outline, _colour(side(link)))
    fine.paste(Image.blend(fine, solid, BODY_OPACITY))
    unseen = set(person.shown.inferred[0]) if person.shown.inferred else set()
    brush.bones(bones[0], opacity=1.0, joints=True, hollow=unseen)
    if person.points:
        brush.rings(detected)
    picture.paste(fine.reduce(finer), box)


class _Brush:
    """Paints into a part of a picture that was made finer."""

    def __init__(self, fine: Image.Image, low: Array, width: float, finer: int) -> None:
        self.pen = ImageDraw.Draw(fine, "RGBA")
        self.finer = finer
        self.low = low
        self.width = width

    def place(self, pixels: Array) -> Array:
        """Turn pixels of the picture (N, 2) into those of the part."""
        return zoomed(pixels - self.low, self.finer)

    def body(self, outline: Array, colour: Colour) -> None:
        corners = [(float(x), float(y)) for x, y in np.clip(self.place(outline), -1e5, 1e5)]
        edge = (colour[0] * 2 // 5, colour[1] * 2 // 5, colour[2] * 2 // 5)
        self.pen.polygon(corners, fill=colour)
        self.pen.line([*corners, corners[0]], fill=edge, width=max(1, round(0.5 * self.finer * self.width)))

    def bones(
        self,
        points: Array,
        *,
        opacity: float,
        joints: bool = False,
        hollow: set[str] | frozenset[str] = frozenset(),
    ) -> None:
        placed, alpha = self.place(points), round(255 * opacity)
        for start, end in TREE_SEGMENTS:
            ends = placed[[start, end]]
            if np.isfinite(ends).all():
                thin = bool({POINTS[start], POINTS[end]} & hollow)
                width = max(1, round((0.6 if thin else 1.3) * self.finer * self.width))
                line = [(float(x), float(y)) for x, y in np.clip(ends, -1e5, 1e5)]
                self.pen.line(line, fill=(*_colour(POINT_SIDES[end]), alpha), width=width)
        if not joints:
            return
        for index, point in enumerate(POINTS):
            radius = self.finer * self.width * (1.1 if index in HEAD else 1.7)
            inside = (*LIGHT_COLOUR, 90) if point in hollow else (*_colour(POINT_SIDES[index]), 255)
            self._circle(placed[index], radius, inside, DARK_COLOUR, max(1, round(0.5 * self.finer)))

    def rings(self, points: Array) -> None:
        """Ring the image points."""
        for point in self.place(points):
            self._circle(point, 3.6 * self.finer * self.width, None, DARK_COLOUR, 3 * self.finer)
            self._circle(point, 3.6 * self.finer * self.width - self.finer, None, LIGHT_COLOUR, self.finer)

    def _circle(
        self, middle: Array, radius: float, inside: tuple[int, ...] | None, edge: Colour, width: int
    ) -> None:
        if np.isfinite(middle).all() and np.abs(middle).max() < 1e5:
            x, y = (float(value) for value in middle)
            self.pen.ellipse(
                (x - radius, y - radius, x + radius, y + radius), fill=inside, outline=edge, width=width
            )


def _colour(whose: str) -> Colour:
    red, green, blue = (round(255 * part) for part in SIDE_RGB[whose])
    return red, green, blue
