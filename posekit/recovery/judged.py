"""What a result says of how its frames were judged, and what is read from that again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import cache
from importlib.metadata import version
from typing import Any, Final

import numpy as np

from posekit.body import Figure, LengthUncertainty
from posekit.geometry import Array
from posekit.ranking.prior_file import BUILT_IN
from posekit.ranking.upright import Up
from posekit.recovery.body import ranges_of
from posekit.recovery.noise import Noise, contact_under_noise
from posekit.settings import (
    EXACT_TOLERANCE,
    MEASURED_TOLERANCE,
    PHOTOGRAPH_TOLERANCE,
    Judged,
    RecoverSettings,
    Tolerance,
)

USUAL_TOLERANCES: Final[Mapping[Judged, Tolerance]] = {
    "exact": EXACT_TOLERANCE,
    "measured": MEASURED_TOLERANCE,
    "photograph": PHOTOGRAPH_TOLERANCE,
}
"""What frames are judged with that are judged as the name says."""

RECORDED_PACKAGES: Final = ("posekit", "pin", "coal", "numpy")
"""Packages whose versions decide a result."""


def record_of(
    asked: RecoverSettings,
    tolerance: Tolerance | None,
    figure: Figure,
    frames: Sequence[tuple[Judged | None, Tolerance | None]],
    noise: Mapping[str, Any] | None,
    up: Up,
) -> dict[str, Any]:
    """Gather the ``settings`` of a result: everything that decided it, besides the view.

    Parameters
    ----------
    asked : RecoverSettings
        With loaded ranges.
    tolerance : Tolerance or None
        What was given, without gaps.
    figure : Figure
        The person's.
    frames : sequence of (str or None, Tolerance or None)
        How each frame was judged, and with what; None where nothing was grown.
    noise : mapping or None
        What noise frames were refined with.
    up : Up
        Which way is up in the camera's frame.
    """
    ranges = ranges_of(asked)
    return {
        "checks": [one.to_json() if one.parameters else one.name for one in asked.checks],
        "ranges": ranges.name,
        "range_limits": {where: list(bounds) for where, bounds in ranges.limits.items()},
        "rules": list(asked.rules) if "walking" in asked.check_names else [],
        "walkers": asked.walkers,
        "tolerance": "exact, else measured" if tolerance is None else asdict(tolerance),
        **{kind: asdict(usual) for kind, usual in USUAL_TOLERANCES.items()},
        "contact_margin": asked.contact_margin,
        "group": asked.group,
        "figure": figure.hash,
        "lengths": dict(figure.lengths),
        "moved_lengths": dict(figure.moved_lengths),
        "shoulder_offset": figure.shoulder_offset,
        "shoulders": _shoulder_side(
            asked, figure, noise if any(judged == "refined" for judged, _ in frames) else None
        ),
        "judged": [judged for judged, _ in frames],
        "noisy": _widest([used for judged, used in frames if judged == "noisy"]),
        "refined": _widest(
            [used for judged, used in frames if judged == "refined"],
            contact=contact_under_noise(
                asked.contact_margin, *(() if noise is None else (noise["overlap"],))
            ),
        ),
        "noise": noise,
        "ranking": {"up": up.says, "prior": BUILT_IN[0]},
        "versions": {name: _version(name) for name in RECORDED_PACKAGES},
        "asked": asked.to_json(),
    }


def _shoulder_side(asked: RecoverSettings, figure: Figure, noise: Mapping[str, Any] | None) -> str:
    """Say on which side the shoulders lie, as frames were judged.

    Undecided where the lengths of refined frames are too uncertain to tell, or distances alone were compared.
    """
    if any(one.parameters.get("rigid_mode") == "distances" for one in asked.checks):
        return "undecided"
    known = LengthUncertainty() if noise is None else Noise.from_document(noise).lengths
    return figure.with_side_within(known).shoulder_side


def tolerances_of(settings: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """Return what the frames of each kind were judged with, by `posekit.settings.Judged`, as a result's settings say.

    Results of earlier versions may be mute of the usual tolerances, which were the same.
    """
    said = {kind: settings.get(kind) for kind in (*USUAL_TOLERANCES, "noisy", "refined")}
    said["given"] = settings.get("tolerance")
    usual = {str(kind): asdict(tolerance) for kind, tolerance in USUAL_TOLERANCES.items()}
    return usual | {kind: values for kind, values in said.items() if isinstance(values, Mapping)}


def rigid_of(settings: Mapping[str, Any], count: int) -> Array:
    """Return the tolerance of rigid distances that a result's frames were judged with (F,), metres."""
    judged = settings.get("judged")
    kinds = judged if isinstance(judged, list) and len(judged) == count else [None] * count
    rigid = {kind: said.get("rigid") for kind, said in tolerances_of(settings).items()}
    known = {kind: float(value) for kind, value in rigid.items() if isinstance(value, int | float)}
    return np.array([known.get(str(kind), EXACT_TOLERANCE.rigid) for kind in kinds])


def _widest(tolerances: Sequence[Tolerance | None], **also: float) -> dict[str, Any] | None:
    """Return the widest of some tolerances, and what was `also` allowed; None where there is none."""
    known = [asdict(one) for one in tolerances if one is not None]
    return {name: max(one[name] for one in known) for name in known[0]} | also if known else None


@cache
def _version(name: str) -> str:
    """Return the version of an installed package: reading it takes a millisecond."""
    return version(name)
