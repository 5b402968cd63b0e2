"""From frames to a `Recovery`: the tables of survivors, frames and answers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from posekit.body import Figure, with_head
from posekit.cameras import View
from posekit.recovery.answer import FrameAnswer
from posekit.recovery.recovery import Answer, Frames, Recovery, Survivors
from posekit.recovery.sight import Sight
from posekit.skeleton import HEAD_POINTS, JOINTS, TREE_SEGMENTS


class Found(NamedTuple):
    """The survivors of one frame, and what became of the rest.

    Attributes
    ----------
    columns : mapping of str to array
        Columns of `Survivors`, the likeliest first.
    answer : FrameAnswer or None
    rejected : mapping
    judged, reason : str
    levels : sequence of int
    unlisted : int
    unlisted_probability : float
    margins : mapping of str to array
        Of each check.
    """

    columns: Mapping[str, Any]
    answer: FrameAnswer | None
    rejected: Mapping[str, int]
    judged: str
    reason: str = ""
    levels: Sequence[int] = ()
    unlisted: int = 0
    unlisted_probability: float = 0.0
    margins: Mapping[str, Any] = {}

    @property
    def size(self) -> int:
        """Number of survivors."""
        return 0 if self.answer is None else len(self.columns["joints"])


NO_ANSWER: Final = FrameAnswer(
    np.full((len(JOINTS), 3), np.nan),
    np.nan,
    -1,
    np.empty(0, dtype=np.intp),
    np.empty(0),
    np.zeros(len(TREE_SEGMENTS), dtype=np.intp),
    np.full(len(TREE_SEGMENTS), np.nan),
)


def gathered(
    view: View,
    sight: Sight,
    person: Figure,
    found: Sequence[Found],
    settings: Mapping[str, Any],
    tolerances: Mapping[str, Any],
) -> Recovery:
    """Put the frames together; configurations are found for all survivors at once.

    Parameters
    ----------
    view : View
    sight : Sight
        What the view shows.
    person : Figure
    found : sequence of F Found
    settings, tolerances : mapping
        What decided the result, as JSON values.
    """
    counts = [one.size for one in found]
    starts = np.concatenate([[0], np.cumsum(counts)])
    tables = [one.columns for one in found if one.size]
    columns: dict[str, Any] = {
        "joints": np.empty((0, len(JOINTS), 3)),
        "head": np.empty((0, len(HEAD_POINTS), 3)),
    }
    margins: dict[str, Any] = {}
    if tables:
        columns = {name: np.concatenate([one[name] for one in tables]) for name in tables[0]}
        judged = [one.margins for one in found if one.size]
        margins = {name: np.concatenate([one[name] for one in judged]) for name in judged[0]}
    survivors = Survivors(
        frame=np.repeat(np.arange(len(found)), counts),
        q=person.inverse_kinematics(with_head(columns["joints"], columns["head"])),
        margins=margins,
        **columns,
    )
    frames = Frames(
        time=view.time,
        pictures=view.pictures,
        camera=sight.cameras,
        rejected=[dict(one.rejected) for one in found],
        levels=[one.levels for one in found],
        unlisted=np.array([one.unlisted for one in found]),
        unlisted_probability=np.array([one.unlisted_probability for one in found]),
        reason=[one.reason for one in found],
        root=[
            root or _root(one, sight, k) for k, (one, root) in enumerate(zip(found, sight.roots, strict=True))
        ],
        judged=[one.judged for one in found],
    )
    answers = [one.answer or NO_ANSWER for one in found]
    nearest = np.array([one.survivor for one in answers], dtype=np.intp)
    answer = Answer(
        joints=np.stack([one.joints for one in answers]),
        sure=np.array([one.sure for one in answers]),
        sure_of=[_sure_of(one, sight, k) for k, one in enumerate(found)],
        survivor=np.where(nearest < 0, -1, nearest + starts[:-1]),
        representatives=[a.representatives + at for a, at in zip(answers, starts[:-1].tolist(), strict=True)],
        represented=[a.represented for a in answers],
        nearer=np.stack([a.nearer for a in answers]),
        nearer_sure=np.stack([a.nearer_sure for a in answers]),
    )
    return Recovery(
        survivors=survivors,
        frames=frames,
        answer=answer,
        settings=settings,
        tolerances=tolerances,
        lengths=dict(person.lengths),
        configuration_names=person.configuration_names,
        unit=view.unit,
        camera=view.camera.fields("m"),
        source=view.source,
    )


def _root(found: Found, sight: Sight, k: int) -> dict[str, Any] | None:
    """Say how the neck's depth was found where the solver placed it."""
    if not sight.camera.perspective or found.judged != "noisy" or not found.size or sight.given[k]:
        return None
    depth, weight = found.columns["joints"][:, 0, 2], found.columns["probability"]
    weight = weight / weight.sum()
    mean, own = float(weight @ depth), found.columns["radius"][:, 0] / 1.96
    return {
        "method": "solver",
        "estimate": mean,
        "deviation": float(np.sqrt(weight @ ((depth - mean) ** 2 + own**2))),
    }


def _sure_of(found: Found, sight: Sight, k: int) -> str:
    if found.answer is None:
        return ""
    deep = sight.camera.perspective and (found.judged != "noisy" or bool(sight.given[k]))
    return "position" if deep else "relative to the neck"
