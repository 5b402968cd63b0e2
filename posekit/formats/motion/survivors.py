"""Whole sets of survivors as a table: all postures behind each view, a row each, as pandas' users want them.

Columns: ``frame``, ``time``, ``survivor`` (its number in the frame), ``neck_x``, ``neck_y``, ``neck_z``,
``right_shoulder_x``, … for the 14 joints in metres, then any numbers of a survivor by name (``scale``,
``probability``, ``margin.collision``, …), then ``branches`` and ``picture``, the name of the frame's picture. Then
``table.groupby("frame")`` gives the sets, and ``table.query("frame == 3").filter(like="wrist")`` the wrists.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.display.short_repr import ShortRepr
from posekit.geometry import Array
from posekit.safe_io import cut, one_line, refusal, shown
from posekit.skeleton import JOINTS

COORDINATE_COLUMNS: Final = tuple(f"{joint}_{axis}" for joint in JOINTS for axis in "xyz")
KEY_COLUMNS: Final = ("frame", "time", "survivor")
TEXT_COLUMNS: Final = ("branches", "picture")


@dataclass(frozen=True, kw_only=True, eq=False)
class SurvivorTable(ShortRepr):
    """N survivors of some frames, a row each.

    Parameters
    ----------
    frame : int array (N,)
        The frame of each, ascending.
    time : array (N,)
        Seconds; NaN where it is not known.
    survivor : int array (N,)
        Its number in its frame.
    joints : array (N, 14, 3)
        In tree order, metres; NaN where a joint is not known.
    values : mapping, optional
        Numbers (N,) by name: probability, scale, margins.
    branches : tuple of str (N,), optional
        The branch taken at each joint; empty where not known.
    pictures : tuple of str (N,), optional
        The picture that each was seen in; empty where not known.
    source : str
        What to call it in errors.

    Raises
    ------
    InputError
        Where shapes do not fit, a coordinate is infinite, frames are out of order, or a survivor comes twice.
    """

    frame: NDArray[np.int64]
    time: Array
    survivor: NDArray[np.int64]
    joints: Array
    values: Mapping[str, Array] = field(default_factory=dict)
    branches: tuple[str, ...] = ()
    pictures: tuple[str, ...] = ()
    source: str = "survivors"

    def __post_init__(self) -> None:
        count = len(self.frame)
        arrays: dict[str, NDArray[Any]] = {
            "frame": _whole(self.source, "frame", self.frame),
            "time": np.array(self.time, dtype=np.float64),
            "survivor": _whole(self.source, "survivor", self.survivor),
            "joints": np.array(self.joints, dtype=np.float64),
        }
        values = {name: np.array(one, dtype=np.float64) for name, one in self.values.items()}
        shapes = dict.fromkeys([*arrays, *values], (count,)) | {"joints": (count, len(JOINTS), 3)}
        for name, array in {**values, **arrays}.items():
            if array.shape != shapes[name]:
                raise refusal(
                    self.source, cut(name), f"shape {array.shape}", f"shape {shapes[name]}", "reshape it"
                )
            if np.isinf(array).any():
                raise refusal(self.source, cut(name), "an infinite number", "finite numbers, or NaN")
            array.flags.writeable = False
        taken = {*KEY_COLUMNS, *COORDINATE_COLUMNS, *TEXT_COLUMNS} & values.keys()
        if taken or not all(name and name.isprintable() for name in values):
            got = shown(min(taken, default="a name that does not print"))
            raise refusal(self.source, "values", got, "names of their own", "rename the value")
        for name, texts in (("branches", self.branches), ("picture", self.pictures)):
            if len(texts) not in (0, count):
                raise refusal(self.source, name, f"{len(texts)} for {count} survivors", "one each")
        keys = np.stack([arrays["frame"], arrays["survivor"]], axis=1)
        if (np.diff(keys[:, 0]) < 0).any() or len(np.unique(keys, axis=0)) != count:
            got = "frames out of order, or a survivor twice"
            raise refusal(self.source, "frame", got, "rows in order", "sort the rows")
        for name, array in arrays.items():
            object.__setattr__(self, name, array)
        object.__setattr__(self, "values", MappingProxyType(values))

    def __len__(self) -> int:
        """Return the number of survivors."""
        return len(self.frame)

    @property
    def columns(self) -> dict[str, NDArray[Any]]:
        """The table's columns by name, in their order."""
        columns: dict[str, NDArray[Any]] = {"frame": self.frame, "time": self.time, "survivor": self.survivor}
        flat = self.joints.reshape(len(self), len(COORDINATE_COLUMNS))
        columns |= {name: flat[:, k] for k, name in enumerate(COORDINATE_COLUMNS)}
        columns |= self.values
        if self.branches:
            columns["branches"] = np.array(self.branches, dtype=np.str_)
        if self.pictures:
            columns["picture"] = np.array(self.pictures, dtype=np.str_)
        return columns

    @classmethod
    def of_columns(cls, columns: Mapping[str, NDArray[Any]], source: str) -> SurvivorTable:
        """Make a table of its columns.

        Raises
        ------
        InputError
            Where one of the joints' columns is missing, or what they hold is no table of survivors.
        """
        missing = [name for name in (*KEY_COLUMNS, *COORDINATE_COLUMNS) if name not in columns]
        if missing:
            got = f"no {missing[0]} among {cut(one_line(', '.join(columns)))}"
            expected = f"{', '.join(KEY_COLUMNS)} and the joints' coordinates ({COORDINATE_COLUMNS[0]}, …)"
            raise refusal(source, "columns", got, expected, "give a table of survivors, in metres")
        known = {*KEY_COLUMNS, *COORDINATE_COLUMNS, *TEXT_COLUMNS}
        return cls(
            frame=columns["frame"],
            time=columns["time"],
            survivor=columns["survivor"],
            joints=np.stack([columns[name] for name in COORDINATE_COLUMNS], axis=-1).reshape(
                -1, len(JOINTS), 3
            ),
            values={
                name: values
                for name, values in columns.items()
                if name not in known and values.dtype.kind != "U"
            },
            branches=tuple(str(one) for one in columns.get("branches", ())),
            pictures=tuple(str(one) for one in columns.get("picture", ())),
            source=source,
        )


def number_columns(names: Any) -> set[str]:
    """Return the columns of a survivors' table that are numbers: all but the branches and the pictures."""
    return {name for name in names if name not in TEXT_COLUMNS}


def _whole(source: str, name: str, values: NDArray[Any]) -> NDArray[np.int64]:
    """Take whole numbers, which tables may hold as floats."""
    given = np.asarray(values, dtype=np.float64)
    if not (np.isfinite(given) & (given == np.round(given)) & (np.abs(given) < 2**53)).all():
        raise refusal(source, name, "a number that is not whole", "whole numbers")
    return given.astype(np.int64)
