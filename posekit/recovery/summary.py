"""What the command line prints of a recovery and of a report."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from posekit.answers.paths import distinct_paths
from posekit.answers.wording import NOT_ASKED, answer_lines, path_words, percent
from posekit.display.check_words import check_words
from posekit.display.plural import plural
from posekit.formats.own.result import NOT_LISTED
from posekit.recovery.recovery import FrameRecovery, Recovery
from posekit.safe_io import cut, one_line

if TYPE_CHECKING:
    from posekit.following.following import Following

MAX_SHOWN = 4
"""How many reasons, and how many frames at each end of a long sequence, are printed."""

SURE_CONFIDENCE: Final = 0.5
"""Confidence below which a path is a guess."""

TOLERANCE_WORDS: Final[Mapping[str, str]] = {"given": "as given", "noisy": "from noise"}
"""What the table says of frames that were judged so, where the word alone would be a riddle."""


def summary_lines(recovery: Recovery, pictures: Sequence[str] = ()) -> list[str]:
    """Say what was recovered of a person: in three lines, then frame by frame.

    The lines are how many postures there are, the likeliest and how sure it is, and what else it can be. The table has
    each frame's survivors and losses, and its picture where that has a name beyond the frame's number; of a long
    sequence the first and last frames. Frames are counted from 0.
    """
    frames = list(enumerate(recovery.frames))
    names = telling_names(pictures)
    longest = max(map(len, names), default=0)
    cells = [f"  {name:<{longest}}" for name in names] or [""] * len(frames)
    head = f"  {'picture':<{longest}}" if names else ""
    lines = [
        _count_line(recovery),
        *answer_lines(recovery.answers),
        f"{'frame':>5} {'time':>8} {'postures':>8} {'groups':>6} {'tolerances':>10}{head}  "
        "rejected by (leaves, 8192 a tree)",
    ]
    between = len(frames) - 2 * MAX_SHOWN
    for k, frame in frames:
        if between > 1 and MAX_SHOWN <= k < len(frames) - MAX_SHOWN:
            if k == MAX_SHOWN:
                lines.append(f"{'…':>5} {plural(between, 'frame')} between")
            continue
        lines.append(_frame_line(k, frame, cells[k]))
    return lines + _scale_lines(recovery)


def telling_names(pictures: Sequence[str]) -> tuple[str, ...]:
    """Return the names of pictures, cut; none where each only says the number of its frame."""
    numbers = [re.findall(r"\d+", name) for name in pictures]
    if all(found and int(found[-1]) == k for k, found in enumerate(numbers)):
        return ()
    return tuple(cut(one_line(name)) for name in pictures)


def _count_line(recovery: Recovery) -> str:
    """Say how many postures there are, and in how many frames."""
    counts = [len(frame) for frame in recovery.frames]
    total = plural(sum(counts), "posture")
    if len(counts) == 1:
        return f"{total} in 1 frame{_unlisted(recovery)}"
    middle = f"median {np.median(counts):g}, most {max(counts)}"
    return (
        f"{total} in {plural(len(counts), 'frame')}: {middle}, none in {counts.count(0)}{_unlisted(recovery)}"
    )


def _unlisted(recovery: Recovery) -> str:
    """Say how many more there are that are not listed, and what they hold of a frame at most."""
    unlisted = sum(frame.unlisted for frame in recovery.frames)
    if not unlisted:
        return ""
    most = max(frame.unlisted_probability for frame in recovery.frames)
    share = percent(most) if most else "under 1 %"  # what is less than rounding is not impossible
    return f"; {unlisted} more hold {share} of a frame at most (--coverage 1 lists them)"


def _scale_lines(recovery: Recovery) -> list[str]:
    """Describe the scales of an uncalibrated view, and where its mirror images could not be told apart."""
    families = [frame.family for frame in recovery.frames if frame.family is not None]
    if not families:
        return []
    s = np.concatenate([family.chosen for family in families])
    segment, count = Counter(family.segment for family in families).most_common(1)[0]
    found = sum(len(frame) > 0 for frame in recovery.frames)
    mirrored = sum(frame.mirrored > 0 for frame in recovery.frames)
    return [
        f"scale by {families[0].how}: {s.min():.6g} to {s.max():.6g} pixels a metre; the bound is set by {segment} in "
        f"{count} of {plural(len(families), 'frame')}",
        f"mirror images told apart in {found - mirrored} of {plural(found, 'frame')} with postures"
        + (f"; in {mirrored} a posture and its mirror image both survive" if mirrored else ""),
    ]


def _frame_line(k: int, frame: FrameRecovery, picture: str) -> str:
    groups = "-" if frame.groups is None else str(len(set(frame.groups.tolist())))
    judged = "-" if frame.judged is None else TOLERANCE_WORDS.get(frame.judged, frame.judged)
    if frame.reason:
        return f"{k:>5} {frame.time:>8.3f} {0:>8} {groups:>6} {judged:>10}{picture}  {frame.reason}"
    lost = Counter(
        {reason: count for reason, count in frame.rejected.items() if reason != NOT_LISTED}
    ).most_common()
    if not len(frame):  # what the last ones died of comes first
        lost.sort(key=lambda pair: not pair[0].startswith("noise/"))
    most = ", ".join(f"{check_words(reason)} {count}" for reason, count in lost[:MAX_SHOWN])
    kept = f"; {frame.unlisted} more not listed" if frame.unlisted else ""
    return f"{k:>5} {frame.time:>8.3f} {len(frame):>8} {groups:>6} {judged:>10}{picture}  {most}{kept}"


def following_line(following: Following) -> str:
    """Describe the paths through a recovery in a line."""
    bridged = int(following.bridged[0].sum())
    guessed = int((following.confidence[0] < SURE_CONFIDENCE).sum())
    sure = NOT_ASKED
    if not np.isnan(following.lead):
        _, probability = distinct_paths(following.joints, following.share)
        sure = path_words(probability.tolist())
    return (
        f"{plural(len(following), 'likeliest path')}: {sure}; {bridged} of {plural(len(following.time), 'frame')} "
        f"bridged, {guessed} a guess, {plural(len(following.switches()), 'change')} between near and far"
    )
