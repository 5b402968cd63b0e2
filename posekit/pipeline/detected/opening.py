"""Open a detector's file: people chosen and followed, sides checked, a camera and lengths given: views."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from posekit.cameras import Array
from posekit.errors import InputError
from posekit.files import View
from posekit.keypoints import KeyPoints, check_sides, choose, list_people, read_keypoints, swap
from posekit.pipeline.detected.camera import in_pixels, sighting
from posekit.pipeline.detected.person import person
from posekit.pipeline.detected.person_view import person_view
from posekit.pipeline.detected.source import Source
from posekit.skeleton_map import load_skeleton_map


@dataclass(frozen=True, kw_only=True)
class Opened:
    """One person's view.

    Parameters
    ----------
    person : int
        The number to choose them by.
    view : View
    says : tuple of str
        What it was made of, a line each: format, person, camera, lengths.
    """

    person: int
    view: View
    says: tuple[str, ...]


def read_detections(path: str | Path, source: Source) -> KeyPoints:
    """Read a detector's file as a user says it is to be read; points in pixels where that can be known."""
    layout = load_skeleton_map(source.skeleton) if source.skeleton else None
    found = read_keypoints(path, source.format or None, layout)
    return in_pixels(swap(found) if source.swap_sides else found, source.size)


def open_views(path: str | Path, source: Source) -> list[Opened]:
    """Make a view of one person, or one of each.

    Raises
    ------
    InputError
        Where the file cannot be read, nobody is in it, or what is said of camera, person and lengths does not fit.
    """
    found = read_detections(path, source)
    if not len(found):
        raise InputError(f"{path}: nobody was detected in {len(found.pictures)} pictures; expected a person")
    sighted = sighting(found, source)
    people = list_people(sighted.keypoints)
    chosen: list[int | str] = [source.person or "largest"]
    if source.person == "all":
        chosen = [one.person for one in people]
    figure, of_lengths = person(source, sighted.camera, found.layout)
    opened = []
    for who in chosen:
        one = choose(sighted.keypoints, who)
        number = int(one.person[0]) if len(one) else -1
        view = person_view(
            one,
            sighted.camera,
            figure,
            rate=source.rate,
            minimum_confidence=source.minimum_confidence,
            deviation=source.deviation,
        )
        _warn_of_sides(one, source)
        others = f" of {len(people)} people" if len(people) > 1 else ""
        says = (
            f"{found.source}: {found.format}, {found.layout.name}, {len(found.pictures)} pictures",
            f"person {number}{others}: in {len(one)} pictures, mean confidence {_mean(one.confidence):.2f}",
            sighted.says,
            of_lengths,
        )
        opened.append(Opened(person=number, view=view, says=says))
    return opened


def _warn_of_sides(one: KeyPoints, source: Source) -> None:
    """Warn where left and right seem to be exchanged."""
    for line in check_sides(one).warnings:
        remedy = "; leave --swap-sides out" if source.swap_sides else " (--swap-sides)"
        warnings.warn(f"{line}{remedy if 'exchange' in line else ''}", UserWarning, stacklevel=3)


def _mean(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else float("nan")
