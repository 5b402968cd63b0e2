"""Whose body a view shows: the figure with the view's own lengths, or another with its proportions."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from posekit.body import Figure, LengthUncertainty, stature_from_lengths
from posekit.body.uncertainty import KNOWN_STATURE, STATED_LENGTHS, UNKNOWN_ADULT
from posekit.errors import InputError
from posekit.formats.own import ScaledOrthographicModel, View
from posekit.recovery.body import FigureBody, LiftedBody
from posekit.settings import RecoverSettings, Rooting
from posekit.skeleton import SEGMENT_NAMES

FEWEST_CLIP_FRAMES = 10
"""Frames from which one body is found for all of them, if its lengths are not exact."""

CACHED_PERSONS = 32
"""Figures of persons that are kept: clips and shards of the same person follow each other."""


def person_of(view: View, figure: Figure) -> Figure:
    """Apply a view's own stature, lengths and head points to a figure."""
    head = {
        name: tuple(np.asarray(at, dtype=np.float64).tolist())
        for name, at in (view.head_points or {}).items()
        if name not in view.own_head_names
    }
    return _person(figure, view.stature, tuple(view.lengths.items()), view.shoulders, tuple(head.items()))


@lru_cache(maxsize=CACHED_PERSONS)
def _person(
    figure: Figure,
    stature: float | None,
    lengths: tuple[tuple[str, float], ...],
    shoulders: str | None,
    head_points: tuple[tuple[str, tuple[float, ...]], ...],
) -> Figure:
    """Make the figure of a person: building one takes as long as recovering some hundred frames."""
    if stature is not None:
        figure = figure.from_stature(stature)
    if lengths or head_points or shoulders:
        behind = None if shoulders is None else shoulders == "behind"
        figure = figure.scaled(dict(lengths), dict(head_points), behind=behind)
    return figure


def uncertainty_of(view: View, asked: float | None, *, own_figure: bool) -> LengthUncertainty:
    """Say how well the lengths are known that a view is recovered with.

    What is `asked` comes before what the view says, and that before what can be told from where lengths come from: the
    view's own, or a figure that was made for the person (`own_figure`), a stature, or nobody.
    """
    said = view.length_deviation if asked is None else asked
    if said is not None:
        return LengthUncertainty.uniform(said)
    if own_figure:
        return STATED_LENGTHS
    other = UNKNOWN_ADULT if view.stature is None else KNOWN_STATURE
    own = {name: (STATED_LENGTHS if name in view.lengths else other).own[name] for name in SEGMENT_NAMES}
    return LengthUncertainty(common=STATED_LENGTHS.common if view.lengths else other.common, own=own)


def body_of(view: View, figure: Figure, proportions: str) -> LiftedBody:
    """Choose what the view's points are lifted into."""
    person = person_of(view, figure)
    stature = view.stature or stature_from_lengths(person.lengths)
    if proportions == "taylor":
        from posekit.recovery.taylor_figure.body import TaylorBody

        return TaylorBody.of(stature, figure)
    return FigureBody(figure=person, stature=stature, derived=view.derived)


def refuse_settings(view: View, settings: RecoverSettings) -> None:
    """Refuse settings that say nothing of such a view.

    Raises
    ------
    InputError
        Where a calibrated view is given a scale or Taylor's proportions, or an uncalibrated one a root.
    """
    if isinstance(view.camera, ScaledOrthographicModel):
        if replace(settings.rooting, deviation=None) != Rooting():
            raise InputError(
                "--root: the view's camera is not known, and so no depth is; leave the option out"
            )
    elif settings.proportions == "taylor":
        raise InputError(
            "--proportions: taylor is for uncalibrated views (scaled-orthographic); leave the option out"
        )
    elif settings.scale is not None:
        raise InputError("--scale: the view's camera is calibrated; leave the option out")
