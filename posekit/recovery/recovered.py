"""What a result was recovered with, so that its postures are judged by the same."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final, NamedTuple

from posekit.body import Figure, load_figure
from posekit.formats.own import Result
from posekit.recovery.judged import tolerances_of
from posekit.safe_io.refusal import refusal
from posekit.settings import EXACT_TOLERANCE, PHOTOGRAPH_TOLERANCE, RIGID_TOLERANCE, ValidateSettings
from posekit.validators.ranges import NAMED_TABLES
from posekit.validators.walking import THRESHOLDS_BY_WALKERS

MOST_UNDER_NOISE: Final = 3.0
"""Times what photographs are allowed that frames with noise may have been: what is stated is believed up to that."""

SHORTEST_LIMB_METRES: Final = 0.2
"""Metres: by it what positions are off becomes what angles are off."""


class RecoveredWith(NamedTuple):
    """Whose postures a result holds, and settings that judge them by what they were recovered with.

    Of several kinds of frames, by what allowed most; and no more strictly than is usual. No file vouches for itself:
    what it states beyond what posekit allows is cut to that, with a warning.
    """

    figure: Figure
    settings: ValidateSettings


def recovered_with(result: Result) -> RecoveredWith:
    """Return what a result was recovered with, by its settings.

    Where they are mute, it is taken as the built-in figure's, exact, and by the paper.

    Raises
    ------
    InputError
        Where the settings say what is no tolerance, margin or name.
    """
    figure, settings = load_figure(), result.settings
    lengths = settings.get("lengths")
    if isinstance(lengths, dict) and settings.get("figure") != figure.hash:
        behind = _number(settings, "shoulder_offset", 0.0) < 0
        figure = figure.scaled({str(name): float(length) for name, length in lengths.items()}, behind=behind)
    # Results of earlier versions, which are mute of it, did not ask for the side.
    if settings.get("shoulders", "undecided" if isinstance(lengths, dict) else "") == "undecided":
        figure = replace(figure, side_known=False)
    return RecoveredWith(figure, _judged(settings, result.decimals))


def _judged(settings: Mapping[str, Any], decimals: int | None) -> ValidateSettings:
    """Return what frames were judged with, and by how much what a file says of them is off."""
    judged = settings.get("judged")
    kinds = {kind for kind in judged if isinstance(kind, str)} if isinstance(judged, list) else set()
    asked = _number(settings, "contact_margin", 0.0)
    rigid, angles, margins = [RIGID_TOLERANCE], [EXACT_TOLERANCE.angle], [asked]
    for kind, said in tolerances_of(settings).items():
        if kind in kinds:
            within = "tolerance." if kind == "given" else f"{kind}."
            most = MOST_UNDER_NOISE if kind in ("noisy", "refined") else 1.0
            metres, degrees = most * PHOTOGRAPH_TOLERANCE.rigid, most * PHOTOGRAPH_TOLERANCE.angle
            bone = _number(said, "rigid", RIGID_TOLERANCE, within=within)
            rigid.append(_believed(f"{within}rigid", bone, metres))
            angle = _number(said, "angle", EXACT_TOLERANCE.angle, within=within)
            angles.append(_believed(f"{within}angle", angle, degrees))
            overlap = -_number(said, "contact", asked, within=within)
            margins.append(-_believed(f"{within}contact", overlap, metres))
    margins[0] = max(margins[0], -PHOTOGRAPH_TOLERANCE.rigid)
    if decimals is not None:  # what was rounded may be off by that
        step = math.sqrt(3) * 10.0**-decimals
        rigid, margins = [max(rigid) + step], [min(margins) - step]
        angles = [max(angles) + math.degrees(2 * step / SHORTEST_LIMB_METRES)]
    walkers, ranges = settings.get("walkers", "paper"), settings.get("ranges")
    if not (isinstance(walkers, str) and walkers in THRESHOLDS_BY_WALKERS):
        raise refusal(
            "result",
            "settings.walkers",
            repr(walkers)[:40],
            " or ".join(THRESHOLDS_BY_WALKERS),
            "correct what made the result",
        )
    return ValidateSettings(
        rigid_tolerance=max(rigid),
        angle_tolerance=max(angles),
        contact_margin=min(margins),
        noise=0.0,
        lengths="model",
        walkers=walkers,
        **({"ranges": ranges} if ranges in ("urdf", *NAMED_TABLES) else {}),
    )


def _believed(name: str, stated: float, most: float) -> float:
    """Return what a result states that it allowed, or the most that it is believed, with a warning."""
    if stated > most:
        warnings.warn(
            f"the result says that it was judged with {name} of {stated:.4g}, more than posekit allows of itself: "
            f"judged with {most:.4g}; ask for more by an option if it is meant",
            UserWarning,
            stacklevel=2,
        )
    return min(stated, most)


def _number(settings: Mapping[str, Any], name: str, default: float, *, within: str = "") -> float:
    """Return a number of a result's settings, or refuse what is none."""
    value = settings.get(name, default)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise refusal(
            "result",
            f"settings.{within}{name}",
            repr(value)[:40],
            "a finite number",
            "correct what made the result",
        )
    return float(value)
