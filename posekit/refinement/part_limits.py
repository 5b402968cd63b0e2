"""The limits of pelvis and neck: the figure's, or walls in their place."""

from __future__ import annotations

from posekit.geometry import Array
from posekit.refinement.figure_numbers import Bounds
from posekit.refinement.limits import Ball, Signs, ball_limits
from posekit.refinement.problem import RefinementProblem
from posekit.refinement.state import PostureState
from posekit.refinement.walls import ball_walls


def pelvis_limits(problem: RefinementProblem, state: PostureState, watch: Signs | None = None) -> Ball:
    """Judge the hips under the torso; see `ball_limits`."""
    return _judged(problem, "pelvis", state.torso, state.hips, problem.anatomy.pelvis_bounds, watch)


def neck_limits(problem: RefinementProblem, state: PostureState, watch: Signs | None = None) -> Ball:
    """Judge the head on the torso."""
    return _judged(problem, "neck", state.torso, state.head, problem.anatomy.neck_bounds, watch)


def _judged(
    problem: RefinementProblem, part: str, parent: Array, child: Array, bounds: Bounds, watch: Signs | None
) -> Ball:
    if problem.walls is not None:
        walled = ball_walls(problem.walls, part, parent, child, watch)
        if walled is not None:
            return walled
    return ball_limits(parent, child, bounds, watch)
