"""When the equations are solved by compiled loops, and what those take."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from posekit.cameras import Array
from posekit.refinement import kernels
from posekit.tree.compiled import compiled, is_fast

if TYPE_CHECKING:
    from posekit.refinement.equations import Equations

FRAMES = 3
"""Leaves whose refinement takes about as long as growing one frame's tree, of those that are few."""


def count(leaves: int) -> None:
    """Count leaves that are about to be refined: after enough of them compiled loops pay."""
    is_fast(leaves // FRAMES)


def loops() -> Any:
    """Return compiled kernels where they are used; None where arrays are."""
    return compiled(kernels) if is_fast(0) else None


def arrow_of(here: Equations) -> tuple[Array, ...]:
    """Lay out equations for the kernels; what is left out has no unknowns."""
    trunk, limbs, head = here.trunk, here.limbs, here.head
    n = len(trunk.chi2)
    if limbs is None:
        of_limbs: tuple[Array, ...] = tuple(
            np.zeros(shape) for shape in ((0, 0, 4, n), (0, 6, 4, n), (0, 4, n), (6, 6, 4, n), (6, 4, n))
        )
    else:
        of_limbs = (limbs.matrix, limbs.coupling, limbs.gradient, limbs.start, limbs.start_gradient)
    if head is None:
        of_head: tuple[Array, ...] = tuple(
            np.zeros(shape) for shape in ((0, 0, n), (0, 6, n), (0, n), (6, 6, n), (6, n))
        )
    else:
        of_head = (head.matrix, head.coupling, head.gradient, head.trunk, head.trunk_gradient)
    of_trunk = (trunk.matrix, trunk.gradient, trunk.points, trunk.pull, trunk.ways, trunk.offsets)
    turns = np.array([turn.start for turn in trunk.turns], dtype=np.int64)
    return tuple(np.ascontiguousarray(array) for array in (*of_limbs, *of_trunk, turns, *of_head))
