"""One person through the frames of a result, as it says it: the survivors that a body can have moved along."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.formats.own.survivor_json import nullable
from posekit.formats.own.units import PER_METRE, Unit, from_metres, to_metres
from posekit.safe_io.refusal import refusal
from posekit.skeleton import JOINTS

Array = NDArray[np.float64]

LENGTH_COLUMNS: Final = ("joints", "smoothed", "deviation")
"""What is in metres, and in files in their unit."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FollowedPaths:
    """K paths through T frames, the cheapest first; NaN for what is not known.

    Parameters
    ----------
    survivor : int array (K, T)
        The posture of each frame; -1 where the path passes the frame over.
    joints : array (K, T, 14, 3)
        Camera frame, metres: the survivors', and what bridges them.
    smoothed : array (K, T, 14, 3)
        The same with smoothed distances from the camera; NaN where the camera is not known.
    interpolated : bool array (K, T, 14)
        Which joints are bridged, or completed without having been seen.
    deviation : array (K, T, 14)
        Of each joint, metres; NaN where it is interpolated.
    cost, share : array (K,)
        Minus the logarithm of each path's likelihood, but for a constant; and of the likelihood of these, its share.
    scale : array (K, T)
        Pixels a metre of the survivors of an uncalibrated view; else NaN.
    lead : float
        Logarithm of the odds of the first path against the next that is different; NaN where there is none.
    exact : bool
        Whether the first path is certain to be the likeliest of all.
    apart : float
        Metres by which some joint is elsewhere in different paths.
    compared : bool, optional
        Whether others than the first were looked for; None where a file of earlier does not say.
    """

    survivor: NDArray[np.int64]
    joints: Array
    smoothed: Array
    interpolated: NDArray[np.bool_]
    deviation: Array
    cost: Array
    share: Array
    scale: Array
    lead: float
    exact: bool
    apart: float
    compared: bool | None = None

    def __post_init__(self) -> None:
        K, T = np.shape(self.survivor) if np.ndim(self.survivor) == 2 else (0, 0)
        shapes = path_shapes(K, T)
        kinds: dict[str, type[np.generic]] = {"survivor": np.int64, "interpolated": np.bool_}
        for name, shape in shapes.items():
            values: NDArray[Any] = np.array(getattr(self, name), dtype=kinds.get(name, np.float64))
            if not K or values.shape != shape or (values.dtype.kind == "f" and np.isinf(values).any()):
                raise refusal(
                    "result",
                    f"paths.{name}",
                    f"shape {values.shape}",
                    f"finite numbers of shape {shape}",
                    "follow the result again",
                )
            values.flags.writeable = False
            object.__setattr__(self, name, values)
        if (self.survivor < -1).any():
            raise refusal(
                "result", "paths.survivor", "a number below -1", "-1 or a posture", "follow it again"
            )

    def __len__(self) -> int:
        """Count the paths."""
        return len(self.cost)

    def check_against(self, counts: list[int]) -> None:
        """Refuse paths that are not of frames with so many postures."""
        if self.survivor.shape[1] != len(counts) or (self.survivor >= np.array(counts)).any():
            raise refusal(
                "result",
                "paths.survivor",
                "a posture that is not there",
                f"{len(counts)} frames, each one of its postures or -1",
                "follow the result again",
            )

    def in_unit(self, unit: Unit) -> dict[str, NDArray[Any]]:
        """Return the arrays as files hold them."""
        values: dict[str, NDArray[Any]] = {}
        values |= {
            item.name: getattr(self, item.name) for item in fields(self) if item.name not in SINGLE_VALUES
        }
        for name in LENGTH_COLUMNS:
            values[name] = from_metres(values[name], unit)
        values["scale"] = values["scale"] / PER_METRE[unit]
        return values

    def told(self, unit: Unit) -> dict[str, Any]:
        """Return what a file says once of all paths."""
        return {
            "lead": None if np.isnan(self.lead) else float(self.lead),
            "exact": bool(self.exact),
            "apart": float(from_metres(self.apart, unit)),
            "compared": self.compared,
        }

    def fields(self, unit: Unit) -> dict[str, Any]:
        """Return what a JSON file says, in its unit: null for what is not known."""
        values = {name: nullable(each) for name, each in self.in_unit(unit).items()}
        return {
            **self.told(unit),
            "paths": [{name: values[name][k] for name in values} for k in range(len(self))],
        }

    @staticmethod
    def of(arrays: Mapping[str, Any], told: Mapping[str, Any], unit: Unit) -> FollowedPaths:
        """Make them of what a file says: arrays with the paths as first axis, and what is said once."""
        values: dict[str, Any] = {
            name: np.array(given, dtype=np.float64)
            for name, given in arrays.items()
            if name not in ("survivor", "interpolated")
        }
        for name in LENGTH_COLUMNS:
            values[name] = to_metres(values[name], unit)
        values["scale"] = values["scale"] * PER_METRE[unit]
        return FollowedPaths(
            survivor=np.asarray(arrays["survivor"]),
            interpolated=np.asarray(arrays["interpolated"]),
            **values,
            lead=np.nan if told["lead"] is None else float(told["lead"]),
            exact=bool(told["exact"]),
            apart=float(to_metres(told["apart"], unit)),
            compared=told["compared"],
        )


def path_shapes(K: int, T: int) -> dict[str, tuple[int, ...]]:
    """Return the shape of each array of K paths through T frames."""
    return {
        "survivor": (K, T),
        "joints": (K, T, len(JOINTS), 3),
        "smoothed": (K, T, len(JOINTS), 3),
        "interpolated": (K, T, len(JOINTS)),
        "deviation": (K, T, len(JOINTS)),
        "cost": (K,),
        "share": (K,),
        "scale": (K, T),
    }


SINGLE_VALUES: Final = ("lead", "exact", "apart", "compared")
"""What is said once of all paths."""
