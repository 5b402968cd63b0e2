"""Open a detector's file: people chosen and followed, sides checked, a camera and lengths given: views."""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from typing import Final

import numpy as np

from posekit.display.plural import plural
from posekit.errors import InputError
from posekit.formats.keypoints import KeyPoints, check_sides, choose, list_people, read_keypoints, swap
from posekit.formats.keypoints.persons import PERSON_RULES
from posekit.formats.skeleton_maps import load_skeleton_map
from posekit.safe_io import shown
from posekit.views.camera import in_pixels, sighting, split_camera
from posekit.views.opened import Opened
from posekit.views.person import person
from posekit.views.person_view import ASSUMED_VIEW_RATE, person_view
from posekit.views.source import Source

MAX_PEOPLE_LISTED: Final = 10
"""Numbers of people that are listed."""


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
        raise InputError(
            f"{path}: nobody was detected in {plural(len(found.pictures), 'picture')}; expected a person; "
            "give another file"
        )
    sighted = sighting(found, source)
    people = list_people(sighted.keypoints)
    figure, of_lengths, length_deviation = person(source, sighted.camera, found.layout, Path(path))
    who = _of_camera(found, source)
    if who != "all":
        chosen = [choose_person(sighted.keypoints, who or "largest")]
    else:
        chosen = [choose(sighted.keypoints, one.person) for one in people]
    opened = []
    for one in chosen:
        number = int(one.person[0]) if len(one) else -1
        try:
            view = person_view(
                one,
                sighted.camera,
                figure,
                rate=source.rate,
                minimum_confidence=source.minimum_confidence,
                deviation=source.deviation,
                length_deviation=length_deviation,
            )
        except InputError as error:
            if len(chosen) == 1:
                raise
            warnings.warn(f"person {number} is left out: {error}", UserWarning, stacklevel=2)
            continue
        _warn_of_sides(one, source)
        says = (
            f"{found.source}: {found.format}, {found.layout.name}, {plural(len(found.pictures), 'picture')}",
            f"{_who(one, who or 'largest', len(people))}: in "
            f"{plural(len(one), 'picture')}{_mean_confidence(one)}",
            sighted.says,
            of_lengths,
            *_assumed_rate(found, source),
        )
        opened.append(Opened(person=number, view=view, says=says, pictures=_pictures(one, len(view))))
    if not opened:
        raise InputError(
            f"{path}: of none of its {len(people)} people both shoulders are seen; expected at least one; choose a "
            "smaller --min-confidence, or another file"
        )
    return opened


def _of_camera(found: KeyPoints, source: Source) -> str:
    """Return who is asked for; of a file of one person before several cameras the number of the camera, if none is."""
    if not found.by_camera or source.person not in ("", "all"):
        return source.person
    there = sorted({str(number) for number in found.person.tolist()}, key=int)
    number = re.search(r"(\d+)\Z", split_camera(source.camera)[1] if source.camera else "")
    if number is None or str(int(number[1])) not in there:
        raise InputError(
            f"{found.source}: what cameras {', '.join(there)} saw; expected one of them; name it with --camera, as "
            f"config.toml:cam_{there[0]}, or say --person {there[0]}"
        )
    return str(int(number[1]))


def _assumed_rate(found: KeyPoints, source: Source) -> list[str]:
    """Say which frame rate is assumed of a recording, where nobody says it."""
    known = source.rate is not None or np.isfinite(found.time).all()
    if known or not found.sequence or len(found.pictures) < 2:
        return []
    return [f"frame rate: not known, {ASSUMED_VIEW_RATE:g} a second is assumed (--fps)"]


def _pictures(one: KeyPoints, frames: int) -> tuple[str, ...]:
    """Name the pictures of a view's frames: all of a sequence, or those in which the person is seen."""
    if frames == len(one.pictures):
        return tuple(one.pictures)
    return tuple(one.pictures[k] for k in one.frame.tolist()) if frames == len(one) else ()


def choose_person(found: KeyPoints, who: str) -> KeyPoints:
    """Choose one person, by the number of `list_people` or by a rule.

    Raises
    ------
    InputError
        Where there is no such rule, or nobody has that number.
    """
    numbers = [str(one.person) for one in list_people(found)]
    if who not in (*PERSON_RULES, *numbers):
        there = ", ".join(numbers[:MAX_PEOPLE_LISTED]) + (", …" if len(numbers) > MAX_PEOPLE_LISTED else "")
        raise InputError(
            f"--person: {shown(who)}; expected {', '.join(PERSON_RULES)}, all, or a number of {found.source} "
            f"({there or 'nobody is in it'}); see who they are with posekit inspect"
        )
    return choose(found, who)


def _warn_of_sides(one: KeyPoints, source: Source) -> None:
    """Warn where left and right seem to be exchanged."""
    for line in check_sides(one).warnings:
        found, swapped, _ = line.partition("; look at a picture")
        undone = f"{found}, as --swap-sides has them; leave it out"
        warnings.warn(undone if swapped and source.swap_sides else line, UserWarning, stacklevel=3)


def _who(one: KeyPoints, rule: str, people: int) -> str:
    """Say who was chosen: of photographs a rule chooses in each."""
    of = f" of {people} people" if people > 1 else ""
    by_rule = rule in PERSON_RULES and not one.sequence and len(one) > 1
    return (
        f"the {rule}{of} in each picture"
        if by_rule
        else f"person {int(one.person[0]) if len(one) else -1}{of}"
    )


def _mean_confidence(one: KeyPoints) -> str:
    known = one.confidence[np.isfinite(one.confidence)]
    return f", mean confidence {float(known.mean()):.2f}" if len(known) else ""
