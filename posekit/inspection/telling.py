"""How counts, shares and settings are said."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posekit.batch import digests
from posekit.display.plural import plural
from posekit.safe_io import cut

OF_FRAMES: Final = ("judged", "unrecovered", "noisy", "refined")
"""Settings that say what became of frames, and not what was asked."""

MAX_REASONS_NAMED: Final = 3
"""Reasons that are named."""


def counts_line(counts: ArrayLike) -> str:
    """Say how many survivors frames have."""
    return histogram_line(np.bincount(np.asarray(counts, dtype=np.int64)))


def histogram_line(frames: NDArray[np.int64]) -> str:
    """Say how many survivors frames have, by the number of `frames` that have 0, 1, 2 and so on."""
    total = int(frames.sum())
    if not total:
        return "no frames"
    values = np.arange(len(frames))
    ranked = np.cumsum(frames)
    low, high = (int(np.searchsorted(ranked, place + 1)) for place in ((total - 1) // 2, total // 2))
    filled = np.flatnonzero(frames)
    return (
        f"{plural(total, 'frame')}, {plural(int((frames * values).sum()), 'posture')}: least {filled[0]:,}, median "
        f"{(low + high) / 2:g}, most {filled[-1]:,}, none in {int(frames[0]):,}"
    )


def tally(words: Iterable[str]) -> str:
    """Say in how many frames each word comes, the most frequent first."""
    counted = Counter(words).most_common()
    last = "frame" if counted and counted[-1][1] == 1 else "frames"
    return ", ".join(f"{word} in {count:,}" for word, count in counted) + f" {last}"


def judged_line(words: Iterable[str]) -> str:
    """Say how frames were judged, by the words that results have for it."""
    return f"judged as {tally('the given tolerances allow' if word == 'given' else word for word in words)}"


def reason_lines(reasons: Mapping[str, int]) -> list[str]:
    """Say why nothing was grown in frames, the most frequent reasons first."""
    ranked = sorted(reasons.items(), key=lambda pair: -pair[1])
    lines = [
        f"not recovered, {plural(count, 'frame')}: {cut_long(reason)}"
        for reason, count in ranked[:MAX_REASONS_NAMED]
    ]
    return lines + (
        [f"and {len(ranked) - MAX_REASONS_NAMED} more reasons"] if len(ranked) > MAX_REASONS_NAMED else []
    )


def cut_long(text: str, most: int = 200) -> str:
    """Put a text on one line, and shorten it where it is very long."""
    text = " ".join(text.split())
    return text if len(text) <= most else text[: most - 1] + "…"


def settings_line(settings: Mapping[str, Any]) -> str:
    """Say by what postures were judged, with which versions, and the hash of what was asked.

    Two results whose hash is the same were asked for alike; it leaves out what became of their frames.
    """
    asked = {name: value for name, value in settings.items() if name not in OF_FRAMES}
    told = [f"settings {digests.of_values(asked)}"]
    checks, ranges, versions = (settings.get(name) for name in ("checks", "ranges", "versions"))
    if isinstance(checks, Sequence) and not isinstance(checks, str):
        told.append(f"checks {', '.join(cut(str(check)) for check in checks[:8]) or 'none'}")
    if isinstance(ranges, str):
        told.append(f"ranges {cut(ranges)}")
    if isinstance(settings.get("figure"), str):
        told.append(f"figure {cut(settings['figure'])[:8]}")
    if isinstance(versions, Mapping) and isinstance(versions.get("posekit"), str):
        told.append(f"posekit {cut(versions['posekit'])}")
    return "; ".join(told)
