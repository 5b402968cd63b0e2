"""The person: a figure with the view's lengths, and how well these lengths are known."""

from __future__ import annotations

import tomllib
from functools import lru_cache
from typing import Any, Final

import numpy as np

from posekit.body import Figure, LengthUncertainty, load_figure
from posekit.body.lengths import stature_from_lengths
from posekit.body.uncertainty import KNOWN_STATURE, STATED_LENGTHS, UNKNOWN_ADULT
from posekit.cameras import ScaledOrthographicCamera, View
from posekit.files import DATA
from posekit.settings import RecoverSettings
from posekit.skeleton import SEGMENT_NAMES

#: Relative lengths of Taylor 2000, Table 1, of a stature of 70.
TAYLOR_LENGTHS: Final = {
    "shoulder-elbow": 15,
    "elbow-wrist": 14,
    "hip-knee": 19,
    "knee-ankle": 20,
    "right_shoulder-left_shoulder": 18,
    "right_hip-left_hip": 14,
}


def _key_points() -> dict[str, Any]:
    """Read the body between a detector's key points: shares of stature and deviations of the 17 lengths."""
    path = DATA / "priors" / "key_points.toml"
    table = tomllib.loads(path.read_text(encoding="utf-8"))
    sideless = {name: name.replace("right_", "").replace("left_", "") for name in SEGMENT_NAMES}
    parts = {
        part: {name: table[part][bare] for name, bare in sideless.items()}
        for part in ("shares", "deviations")
    }
    return {"stature": table["stature"], **parts}


KEY_POINTS: Final = _key_points()


def person_of(view: View, settings: RecoverSettings, figure: Figure | None) -> Figure:
    """Return the person's figure: the given or built-in one with the view's stature, lengths and head points."""
    head = {
        name: tuple(np.asarray(at, dtype=np.float64).tolist())
        for name, at in (view.head_points or {}).items()
        if name not in view.own_head_names
    }
    stature = settings.stature or view.stature
    base = figure or load_figure()
    lengths = dict(view.lengths)
    if _of_people(view, settings) and figure is None:
        # Another body than the figure's lies between a detector's points, and in a stranger's photograph.
        lengths = {
            name: share * (stature or KEY_POINTS["stature"]) for name, share in KEY_POINTS["shares"].items()
        }
        stature = None
    if settings.proportions == "taylor":
        unit = (stature or stature_from_lengths(base.lengths)) / 70
        for name in SEGMENT_NAMES:
            sideless = name.replace("right_", "").replace("left_", "")
            if found := TAYLOR_LENGTHS.get(name, TAYLOR_LENGTHS.get(sideless)):
                lengths[name] = found * unit
    return _person(base, stature, tuple(lengths.items()), view.shoulders, tuple(head.items()))


def _of_people(view: View, settings: RecoverSettings) -> bool:
    """Tell whether the person has the proportions of people: those of key points, and of photographs by default."""
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
    """Make the figure of a person: shards of one person follow each other."""
    if stature is None and not lengths and not shoulders and not head_points:
        return figure
    behind = None if shoulders is None else shoulders == "behind"
    return figure.scaled(dict(lengths), dict(head_points), stature=stature, behind=behind)


@lru_cache(maxsize=32)
def sided(figure: Figure, lengths: LengthUncertainty) -> Figure:
    """Return the figure as far as its lengths are known: the side of the shoulders may be open."""
    return figure.with_side_within(lengths)


def uncertainty_of(view: View, settings: RecoverSettings, *, own_figure: bool) -> LengthUncertainty:
    """Return how well lengths are known: as stated, else as their origin tells (view, stature, or none)."""
    stated = view.length_deviation if settings.length_deviation is None else settings.length_deviation
    if stated is not None:
        return LengthUncertainty.uniform(stated)
    if own_figure:
        return STATED_LENGTHS
    if _of_people(view, settings):
        size = UNKNOWN_ADULT if (settings.stature or view.stature) is None else KNOWN_STATURE
        return LengthUncertainty(common=size.common, own=KEY_POINTS["deviations"])
    other = UNKNOWN_ADULT if (settings.stature or view.stature) is None else KNOWN_STATURE
    own = {name: (STATED_LENGTHS if name in view.lengths else other).own[name] for name in SEGMENT_NAMES}
    return LengthUncertainty(common=STATED_LENGTHS.common if view.lengths else other.common, own=own)
