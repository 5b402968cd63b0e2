"""Answers in words: how sure the likeliest posture is, which way its limbs point, and what else it can be."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from posekit.answers.answer import REPRESENTED_PROBABILITY, Answer
from posekit.answers.depth_order import ANSWER_SEGMENTS, LEVEL_METRES
from posekit.answers.paths import distinct_paths
from posekit.formats.own.paths import FollowedPaths
from posekit.geometry import Array
from posekit.skeleton import JOINTS

MAX_TOLD: Final = 3
"""Segments, and postures, that are told one by one."""

DOUBT_PROBABILITY: Final = 0.05
"""Probability of the opposite from which on it is worth a word."""

LIMB_NAMES: Final = {"shoulder": "upper arm", "elbow": "forearm", "hip": "thigh", "knee": "lower leg"}
"""What a segment is called that begins at a joint."""

NOTHING_ELSE: Final = "nothing that differs by 5 cm holds more than 5 %"

EVEN_ODDS: Final = 1.1
"""Odds up to which one is about as likely as the other."""

OF_LISTED: Final = " of what is listed"
"""Added where much is not."""


NOT_ASKED: Final = "how sure is not asked (--follow 2)"
"""What is said of the only path that was looked for."""


def answer_lines(answers: Sequence[Answer]) -> list[str]:
    """Tell one person's answers in two lines: the likeliest, and what else it can be; none where there is no posture.

    Of several frames the middle one of how sure they are, and the least sure by its number, counted from 0.
    """
    found = [k for k, answer in enumerate(answers) if len(answer)]
    if not found:
        return []
    sure = [answers[k].sure for k in found]
    count = [len(answers[k]) for k in found]
    least, most = found[int(np.argmin(sure))], found[int(np.argmax(count))]
    limbs = _limbs(answers[least])
    if len(answers) == 1:
        return [
            f"likeliest: {percent(sure[0])} sure, to 5 cm in {_joints(answers)}; {limbs}",
            f"what else it can be: {_others(answers[0])}",
        ]
    others = _nothing_else([answers[k] for k in found])
    if max(count) > 1:
        held, middle = _held([answers[k] for k in found]), sorted(count)[len(count) // 2]
        some = "1 distinct posture holds" if middle == 1 else f"{middle} distinct postures hold"
        others = f"{some} {held} in the median frame, {max(count)} in frame {most}"
    return [
        f"likeliest: {percent(float(np.median(sure)))} sure in the median frame, to 5 cm in {_joints(answers)}; "
        f"least sure is frame {least}, {percent(min(sure))}: {limbs}",
        f"what else it can be: {others}",
    ]


def _joints(answers: Sequence[Answer]) -> str:
    """Say of which joints something is sure: not of those that no picture shows."""
    unseen = [answer.bodies.unseen for answer in answers]
    if not any(unseen):
        return "every joint"
    return f"every joint that is seen ({'' if len(unseen) == 1 else 'up to '}{max(unseen)} of 14 are not)"


def path_words(probability: Sequence[float]) -> str:
    """Say how likely the distinct paths are, of which each has its probability: the first comes first."""
    each = ", ".join(percent(p) for p in probability[:MAX_TOLD])
    if len(probability) == 1:
        return "no other that is 5 cm elsewhere holds 5 %"
    more = ", …" if len(probability) > MAX_TOLD else ""
    odds = probability[0] / probability[1]
    said = "the first is " + (f"{odds:.2g} times" if odds >= EVEN_ODDS else "about") + " as likely as"
    return f"{said} the next that is 5 cm elsewhere; {len(probability)} of them hold 95 % ({each}{more})"


def words_of_paths(paths: FollowedPaths) -> str:
    """Say how sure the first path of a result is, of those that it holds."""
    if len(paths) > 1 or paths.compared:
        return path_words(distinct_paths(paths.joints, paths.share)[1].tolist())
    return "no other path is in the result" if paths.compared is None else NOT_ASKED


def percent(probability: float) -> str:
    """Write a probability for a reader, who takes 100 % for certain: it is not said of less."""
    if 0.99 < probability < 1.0 - 1e-6:
        return "over 99 %"
    return "under 1 %" if 0.0 < probability < 0.01 else f"{100 * probability:.0f} %"


def _limbs(answer: Answer) -> str:
    """Say which way the segments point of the likeliest posture that are least sure."""
    near, far, gap = answer.depth.near, answer.depth.far, _gaps(answer.posture)
    opposite = np.where(gap < 0, far, near)
    opposite[~(np.abs(gap) > LEVEL_METRES)] = 0.0
    order = np.argsort(-np.nan_to_num(opposite), kind="stable").tolist()
    doubtful = [k for k in order if opposite[k] >= DOUBT_PROBABILITY]
    if not doubtful:
        whole = answer.bodies.unlisted <= DOUBT_PROBABILITY
        return (
            f"which way its limbs point that are over 5 cm deep is over 95 % sure{'' if whole else OF_LISTED}"
        )
    which = [(k, bool(gap[k] < 0)) for k in doubtful[:MAX_TOLD]]
    more = f", and {len(doubtful) - MAX_TOLD} more in doubt" if len(doubtful) > MAX_TOLD else ""
    return _directions(which, [float((near if ahead else far)[k]) for k, ahead in which]) + more


def _held(answers: Sequence[Answer]) -> str:
    """Say what representatives hold: 95 %, or in the median frame what is listed."""
    listed = 1.0 - float(np.median([answer.bodies.unlisted for answer in answers]))
    return percent(min(REPRESENTED_PROBABILITY, listed))


def _nothing_else(answers: Sequence[Answer]) -> str:
    """Say that there is nothing else, or that it is not listed."""
    unlisted = max(answer.bodies.unlisted for answer in answers)
    if unlisted <= DOUBT_PROBABILITY:
        return NOTHING_ELSE
    where = "" if len(answers) == 1 else " of a frame"
    return f"what is not listed, which may hold {percent(unlisted)}{where}"


def _others(answer: Answer) -> str:
    """Say how many distinct postures hold 95 %, and what is different in the second."""
    if len(answer) == 1:
        return _nothing_else([answer])
    each = [percent(p) for p in answer.probability[:MAX_TOLD].tolist()]
    more = ", …" if len(answer) > MAX_TOLD else ""
    return (
        f"{len(answer)} distinct postures hold {_held([answer])} ({', '.join(each)}{more}); in the second "
        f"{difference(answer.joints[0], answer.joints[1])}"
    )


def difference(first: Array, second: Array) -> str:
    """Say what differs in a second posture (14, 3): which segments point elsewhere, else which joint moved most."""
    before, after = _gaps(first), _gaps(second)
    turned = np.flatnonzero((before * after < 0) & (np.abs(before - after) > 2 * LEVEL_METRES)).tolist()
    if turned:
        more = f", and {len(turned) - MAX_TOLD} more are turned" if len(turned) > MAX_TOLD else ""
        return _directions([(k, bool(after[k] < 0)) for k in turned[:MAX_TOLD]]) + more
    apart = np.nan_to_num(np.linalg.norm(first - second, axis=-1))
    joint = int(np.argmax(apart))
    return f"the {JOINTS[joint].replace('_', ' ')} is {100 * apart[joint]:.0f} cm elsewhere"


def _directions(which: Sequence[tuple[int, bool]], probability: Sequence[float] = ()) -> str:
    """Say which way segments point: "the right forearm points to the camera (92 %), the left thigh away (75 %)"."""
    words: list[str] = []
    for place, (segment, near) in enumerate(which):
        start, end = (JOINTS[joint] for joint in ANSWER_SEGMENTS[segment])
        side, _, joint = start.partition("_")
        if end == "neck":
            word = f"the trunk leans {'to' if near else 'away from'} the camera"
        elif end.endswith(joint):
            nearer = end if near else start
            word = f"the {nearer.replace('_', ' ')} is the nearer one"
        elif any(" points " in earlier for earlier in words):
            word = f"the {side} {LIMB_NAMES[joint]} {'to it' if near else 'away'}"
        else:
            word = f"the {side} {LIMB_NAMES[joint]} points {'to' if near else 'away from'} the camera"
        words.append(word + (f" ({percent(probability[place])})" if probability else ""))
    return ", ".join(words)


def _gaps(posture: Array) -> Array:
    start, end = np.array(ANSWER_SEGMENTS).T
    return np.asarray(posture[end, 2] - posture[start, 2])
