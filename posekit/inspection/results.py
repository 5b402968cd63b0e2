"""What is in a result."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from posekit.answers.wording import answer_lines, words_of_paths
from posekit.display.plural import plural
from posekit.formats.own import Result
from posekit.formats.own.paths import FollowedPaths
from posekit.inspection.telling import (
    counts_line,
    cut_long,
    judged_line,
    reason_lines,
    settings_line,
    tally,
)
from posekit.recovery.answered import result_answers
from posekit.recovery.summary import telling_names

NAMES_SHOWN: Final = 4
"""Pictures that are named."""


def result_lines(result: Result) -> list[str]:
    """Describe survivors, what they were judged as and refined with, ranking, paths and settings."""
    frames, settings = result.frames, result.settings
    lines = [counts_line([len(frame.joints) for frame in frames]), *reason_lines(_unrecovered(settings))]
    if pictures := telling_names(result.pictures):
        more = f", … to {pictures[-1]}" if len(pictures) > NAMES_SHOWN else ""
        lines.append(f"pictures: {', '.join(pictures[:NAMES_SHOWN])}{more}")
    lines += _sets(result)
    judged = settings.get("judged")
    kinds = [one for one in judged if isinstance(one, str)] if isinstance(judged, list) else []
    if kinds:
        lines.append(judged_line(map(cut_long, kinds)))
    roots = [frame.root.method for frame in frames if frame.root is not None and frame.root.method != "none"]
    if roots:
        lines.append(f"neck placed by {tally(roots)}")
    families = [frame.family.how for frame in frames if frame.family is not None]
    if families:
        lines.append(f"scale by {tally(map(cut_long, families))}")
    inferred = [frame.inferred for frame in frames if frame.inferred and any(frame.inferred)]
    if inferred:
        names = {name for one in inferred for posture in one for name in posture}
        lines.append(
            f"joints not seen, and inferred in {plural(len(inferred), 'frame')}: {', '.join(sorted(names))}"
        )
    lines += [_refined(result), _ranked(result)]
    if all(frame.probability is not None for frame in frames):
        lines += answer_lines(result_answers(result))
    lines.append("no paths through the frames" if result.paths is None else _paths(result.paths))
    return [*lines, settings_line(settings)]


def _unrecovered(settings: Mapping[str, Any]) -> dict[str, int]:
    """Return in how many frames nothing was grown, by the reason."""
    said = settings.get("unrecovered")
    return {
        str(reason): len(frames)
        for reason, frames in (said.items() if isinstance(said, dict) else ())
        if isinstance(frames, list)
    }


def _sets(result: Result) -> list[str]:
    """Say what the sets are made of, and what is not listed of them."""
    sets = [frame.posture_set for frame in result.frames if frame.posture_set is not None]
    if not sets:
        return []
    trunks, limbs = (
        int(np.median([len(getattr(one, name)) for one in sets])) for name in ("trunks", "limb_kind")
    )
    made = f"sets of {plural(trunks, 'trunk')} with {plural(limbs, 'limb')} (median)"
    unlisted = sum(frame.unlisted for frame in result.frames)
    share = max(frame.unlisted_probability for frame in result.frames)
    told = f"{unlisted} at most are not listed, with at most {share:.2g} of a frame's probability"
    return [f"{made}; {told if unlisted else 'all whole postures are listed'}"]


def _refined(result: Result) -> str:
    refined = [frame.refined for frame in result.frames if frame.refined is not None and len(frame.refined)]
    noise = result.settings.get("noise")
    if not refined:
        return "not refined"
    chi2 = np.concatenate([one.chi2 / np.maximum(one.dof, 1) for one in refined])
    told = f"; chi2 a degree of freedom: median {np.nanmedian(chi2):.2g}" if np.isfinite(chi2).any() else ""
    deviation = noise.get("deviation") if isinstance(noise, dict) else None
    of_points = f" with a deviation of {deviation:g} px" if isinstance(deviation, int | float) else ""
    size = noise.get("size") if isinstance(noise, dict) else None
    of_lengths = f", the body's size known to {size:.2g} of itself" if isinstance(size, int | float) else ""
    return f"refined in {plural(len(refined), 'frame')}{of_points}{of_lengths}{told}"


def _ranked(result: Result) -> str:
    likeliest = [
        float(frame.probability.max()) * (1.0 - frame.unlisted_probability)
        for frame in result.frames
        if frame.probability is not None and len(frame.probability)
    ]
    if not likeliest:
        return "without probabilities"
    ranking = result.settings.get("ranking")
    by = ranking.items() if isinstance(ranking, dict) else ()
    how = ", ".join(f"{cut_long(str(name))}: {cut_long(str(value))}" for name, value in list(by)[:5])
    return f"ranked ({how or 'by default'}); the likeliest has a probability of {np.median(likeliest):.2g} (median)"


def _paths(paths: FollowedPaths) -> str:
    count, frames = paths.survivor.shape
    certain = "certain to be" if paths.exact else "not certain to be"
    sure = f"the first is {certain} the likeliest"
    if count > 1 or paths.compared:
        sure = f"{words_of_paths(paths)}; {sure}"
    elif not paths.exact:
        sure = words_of_paths(paths)
    return (
        f"{plural(count, 'path')}: {sure}, "
        f"{int((paths.survivor[0] < 0).sum())} of {plural(frames, 'frame')} bridged"
    )
