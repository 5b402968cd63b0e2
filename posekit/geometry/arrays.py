"""Arrays of numbers, and runs in arrays of truths."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Numbers in double precision."""


def runs(which: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """List the runs of consecutive True of an array (N,), as slices have them.

    Parameters
    ----------
    which : bool array (N,)
        As frames that something is said of.

    Returns
    -------
    list of (int, int)
        Where each starts, and the first place after it.

    Examples
    --------
    >>> import numpy as np
    >>> runs(np.array([True, True, False, True]))
    [(0, 2), (3, 4)]
    """
    edges = np.flatnonzero(np.diff(which.astype(np.int8), prepend=0, append=0))
    return [(start, stop) for start, stop in edges.reshape(-1, 2).tolist()]
