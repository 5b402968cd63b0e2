"""The interpretation tree of a frame, as far as it was grown: living nodes and pruned ones."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from posekit.errors import ViewerError
from posekit.formats.own.result import ResultFrame

MOST_TIPS: Final = 160
"""Ends of branches beside each other that can still be told apart in a drawing."""


@dataclass(frozen=True, kw_only=True)
class Tip:
    """Where a drawn branch ends.

    Parameters
    ----------
    branch : str
        The near (0) and far (1) choices from the root; its length is its level.
    reason : str
        What pruned it, ``check/where``; empty where it lives.
    survivors : int
        Surviving leaves at or below it; 0 where it was pruned.
    """

    branch: str
    reason: str
    survivors: int


def tips(frame: ResultFrame, levels: int) -> list[Tip]:
    """Return where the branches of a frame's tree end, from the nearest to the farthest.

    Of a frame that was recovered at several scales it is the union of their trees.

    Parameters
    ----------
    frame : ResultFrame
        With the detail on pruned branches.
    levels : int
        Levels below the root that are looked at: a branch that goes on below ends there.

    Raises
    ------
    ViewerError
        Where the detail is missing or is no tree's.
    """
    alive: dict[str, int] = {}
    for code in frame.branches:
        _check(code, frame)
        alive[code[:levels]] = alive.get(code[:levels], 0) + 1
    found = [Tip(branch=branch, reason="", survivors=count) for branch, count in alive.items()]
    pruned = pruned_branches(frame)
    inner = {code[:level] for code in frame.branches for level in range(len(code) + 1)}
    deeper: set[str] = set()
    if scale_count(frame) > 1:  # what one scale prunes may grow on at another: drawn is what grew at any
        deeper = inner | {branch[:level] for branch, _ in pruned for level in range(len(branch))}
    cut: dict[str, Tip] = {}
    for branch, reason in pruned:
        shown = branch[:levels]
        if branch in deeper:
            continue
        if branch in inner:
            raise ViewerError(f"pruned: branch {branch} also leads to a survivor; expected one or the other")
        if len(branch) <= levels:
            cut[shown] = Tip(branch=shown, reason=reason, survivors=0)
        elif shown not in inner:
            # Everything below dies, but deeper than is drawn: the branch ends without a reason of its own.
            cut.setdefault(shown, Tip(branch=shown, reason="", survivors=0))
    return sorted([*found, *cut.values()], key=lambda tip: tip.branch)


def scale_count(frame: ResultFrame) -> int:
    """Count the trees that were grown: one, or one a scale of an uncalibrated frame."""
    return 1 if frame.family is None else max(1, len(frame.family.chosen))


def readable_levels(frame: ResultFrame) -> int:
    """Return the largest number of levels at which the tips can be told apart."""
    depth = len(frame.levels["joint"]) - 1
    return max((n for n in range(1, depth + 1) if len(tips(frame, n)) <= MOST_TIPS), default=1)


def pruned_branches(frame: ResultFrame) -> list[tuple[str, str]]:
    """Return branch and reason of every pruned branch.

    Raises
    ------
    ViewerError
        Where the result does not list them.
    """
    if frame.pruned is None:
        raise ViewerError(
            "the result does not list its pruned branches; make it with: posekit recover … --explain"
        )
    found = []
    for entry in frame.pruned:
        branch, reason = entry.get("branch"), entry.get("reason")
        if not isinstance(branch, str) or not isinstance(reason, str):
            raise ViewerError("pruned: got an entry without branch and reason; recover the view again")
        _check(branch, frame)
        found.append((branch, reason))
    return found


def _check(branch: str, frame: ResultFrame) -> None:
    depth = len(frame.levels["joint"]) - 1
    if not 1 <= len(branch) <= depth or set(branch) - {"0", "1"}:
        raise ViewerError(f"branch: got {branch[:40]!r}; expected 1 to {depth} choices, 0 near or 1 far")
