"""The person in a view: a figure with the view's segment lengths, and the uncertainty of these lengths."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import lru_cache
from typing import Final

import numpy as np

from posekit.body import Figure, LengthUncertainty, load_figure
from posekit.body.lengths import stature_from_lengths
from posekit.body.uncertainty import KNOWN_STATURE, STATED_LENGTHS, UNKNOWN_ADULT
from posekit.cameras import ScaledOrthographicCamera, View
from posekit.files import DATA
from posekit.settings import RecoverSettings
from posekit.skeleton import SEGMENT_NAMES

#: Segment lengths as fractions of stature, without the side, and their relative standard deviations between people.
PROPORTIONS: Final = tomllib.loads((DATA / "priors" / "proportions.toml").read_text(encoding="utf-8"))


def by_segment(table: Mapping[str, float]) -> dict[str, float]:
    """Expand a table by segment name without side, so that left and right segments have the same value."""
    sideless = {name: name.replace("right_", "").replace("left_", "") for name in SEGMENT_NAMES}
    return {name: table[bare] for name, bare in sideless.items() if bare in table}


def figure_of_view(view: View, settings: RecoverSettings, figure: Figure | None) -> Figure:
    """Return the person's figure: the given or built-in figure with the view's stature, lengths and head points."""
    head = {
        name: tuple(np.asarray(at, dtype=np.float64).tolist())
        for name, at in (view.head_points or {}).items()
        if name not in view.own_head_names
    }
    stature = settings.stature or view.stature
    base = figure or load_figure()
    lengths = dict(view.lengths)
    people, taylor = PROPORTIONS["people"], PROPORTIONS["taylor"]
    if _of_people(view, settings) and figure is None:
        # Key points of a detector, and photographs of strangers, have the mean proportions of people.
        size = stature or people["stature"]
        lengths = {name: share * size for name, share in by_segment(people["shares"]).items()}
        stature = None
    if settings.proportions == "taylor":
        unit = (stature or stature_from_lengths(base.lengths)) / taylor["stature"]
        lengths |= {name: share * unit for name, share in by_segment(taylor["shares"]).items()}
    return _person(base, stature, tuple(lengths.items()), view.shoulders, tuple(head.items()))


def _of_people(view: View, settings: RecoverSettings) -> bool:
    """Return whether mean proportions of people are used: by default for key points and photographs."""
    if settings.proportions != "auto":
        return settings.proportions == "people"
    unscaled = isinstance(view.camera, ScaledOrthographicCamera) and view.camera.scale is None
    return not view.lengths and (bool(view.derived) or (unscaled and settings.scale in (None, "likely")))


@lru_cache(maxsize=32)
def _person(
    figure: Figure,
    stature: float | None,
    lengths: tuple[tuple[str, float], ...],
    shoulders: str | None,
    head_points: tuple[tuple[str, tuple[float, ...]], ...],
) -> Figure:
    """Return the figure of a person; figures are cached, because a person often appears in several views."""
    if stature is None and not lengths and not shoulders and not head_points:
        return figure
    behind = None if shoulders is None else shoulders == "behind"
    return figure.scaled(dict(lengths), dict(head_points), stature=stature, behind=behind)


@lru_cache(maxsize=32)
def sided(figure: Figure, lengths: LengthUncertainty) -> Figure:
    """Return the figure; if lengths are too uncertain, the side of its shoulders (front, behind) is undecided."""
    return figure.with_side_within(lengths)


def uncertainty_of(view: View, settings: RecoverSettings, *, own_figure: bool) -> LengthUncertainty:
    """Return the stated uncertainty of lengths, or the usual one for lengths from the view, a stature or neither."""
    stated = view.length_deviation if settings.length_deviation is None else settings.length_deviation
    if stated is not None:
        return LengthUncertainty.uniform(stated)
    if own_figure:
        return STATED_LENGTHS
    other = UNKNOWN_ADULT if (settings.stature or view.stature) is None else KNOWN_STATURE
    if _of_people(view, settings):
        return LengthUncertainty(common=other.common, own=by_segment(PROPORTIONS["people"]["deviations"]))
    own = {name: (STATED_LENGTHS if name in view.lengths else other).own[name] for name in SEGMENT_NAMES}
    return LengthUncertainty(common=STATED_LENGTHS.common if view.lengths else other.common, own=own)
