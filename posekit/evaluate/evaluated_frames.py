"""All frames of an evaluation as one table, and its rows by condition."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.evaluate.joint_errors import ERROR_NAMES
from posekit.evaluate.work import Measured, Work
from posekit.geometry import Array

CONDITION_KEYS: Final = ("action", "yaw", "height", "noise")
"""What a condition is."""


class Condition(NamedTuple):
    """Frames of one condition.

    Attributes
    ----------
    key : mapping
        Some of `CONDITION_KEYS`, with their values; None where there is none.
    rows : int array
        Its frames.
    """

    key: dict[str, Any]
    rows: NDArray[np.intp]


@dataclass(frozen=True, kw_only=True, eq=False)
class EvaluatedFrames:
    """What was found of all frames, a column each.

    Parameters
    ----------
    keys : mapping of str to array (F,)
        ``clip``, ``frame``, ``action`` (names), ``yaw``, ``height`` (NaN where there is none), ``noise``.
    measured : Measured
        Of all frames.
    """

    keys: dict[str, NDArray[Any]]
    measured: Measured

    @classmethod
    def of(cls, works: Sequence[Work], found: Sequence[Measured], actions: Sequence[str]) -> EvaluatedFrames:
        """Put the pieces together, in their order."""
        keys = {
            name: np.concatenate([getattr(work, name) for work in works])
            for name in ("frame", "yaw", "height")
        }
        for name in ("clip", "noise"):
            keys[name] = np.concatenate([np.full(len(work), getattr(work, name)) for work in works])
        keys["action"] = np.array([actions[clip] for clip in keys["clip"].tolist()])
        columns = {
            field.name: _joined([getattr(one, field.name) for one in found]) for field in fields(Measured)
        }
        return cls(keys=keys, measured=Measured(**columns))

    def __len__(self) -> int:
        """Count the frames."""
        return len(self.measured.survivors)

    def error(self, role: str, measure: str) -> Array:
        """Return one measure of one role (F,), metres."""
        return self.measured.errors[role][:, ERROR_NAMES.index(measure)]

    def conditions(self, names: Sequence[str]) -> Iterator[Condition]:
        """Yield the rows that share some of `CONDITION_KEYS`, ordered by them; all rows where none is named."""
        found: dict[tuple[Any, ...], list[int]] = {}
        columns = [self.keys[name].tolist() for name in names]
        for row in range(len(self)):
            key = tuple(None if column[row] != column[row] else column[row] for column in columns)
            found.setdefault(key, []).append(row)
        for key in sorted(found, key=lambda key: tuple((one is not None, one) for one in key)):
            yield Condition(dict(zip(names, key, strict=True)), np.array(found[key], dtype=np.intp))


def _joined(parts: list[Any]) -> Any:
    if isinstance(parts[0], dict):
        return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    if isinstance(parts[0], list):
        return [one for part in parts for one in part]
    return np.concatenate(parts)
