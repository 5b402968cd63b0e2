"""One column of a table of survivors: what files, schemas and flat tables need to know of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import MISSING, dataclass, field, fields, replace
from functools import cache
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from posekit.formats.own.digits import Precision
from posekit.formats.own.units import PER_METRE, Unit
from posekit.geometry import Array
from posekit.safe_io.refusal import refusal

COLUMN_KEY: Final = "column"
"""The metadata of a dataclass's field that hold its `Column`."""
UPPER_TRIANGLE: Final = ([0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2])
"""Entries of a symmetric matrix that files hold: xx, xy, xz, yy, yz, zz."""


@dataclass(frozen=True, kw_only=True)
class Column:
    """What is said once of one value of each survivor.

    Parameters
    ----------
    meaning : str
        What it is, as the published schema says it; lengths are in `unit`, the unit of the file.
    name : str
        The attribute that holds it in memory, and its array in an NPZ; `columns_in` fills it in.
    key : str
        Its name in JSON and in flat tables; the same as `name` where it is empty.
    kind : {"float", "int", "str", "objects", "table"}
        What one value is: numbers, a text, an object for each of some joints, or a table of columns of its own.
    of : type, optional
        The class of those objects, or of that table.
    shape : tuple of int or None
        Of one survivor's value in a file; None is any extent. Empty for a single number.
    length_power : int
        With which power the unit of length is in it: 1 for a length, -1 for pixels a metre, 2 for a covariance.
    null : {"", "number", "row"}
        What may be unknown in JSON (null; in arrays NaN): nothing, single numbers, or rows of the last axis.
    lower, upper : float, optional
        Bounds of its numbers.
    decimals : int, optional
        Where noise is known, with how many decimals more than positions it is written.
    digits : int
        The same in significant digits; 0 for all.
    longest : int, optional
        Characters of a text.
    whole : bool
        Whether JSON holds whole numbers, though memory and NPZ hold floats, which can be NaN.
    symmetric : bool
        Whether memory holds symmetric matrices (3, 3), of which files hold the upper triangle.
    by_check : bool
        Whether it is a mapping with an array for each check.
    once : bool
        Whether a frame has one value of it.
    detail : bool
        Whether a file may have it of some survivors of a refined frame alone: of the others it is not known.
    optional : bool
        Whether a frame may lack it, which then has None; `column` fills it in.
    everywhere : bool
        Whether all frames of a file have it, or none.
    flat_prefix : str
        Where flat tables hold several columns of it, what the names of these begin with: ``margin``.
    batch_place : int
        Its place among the numbers in a batch's Parquet, from 1; 0 where a batch does not hold it.
    asked_by : str
        The setting of a batch that asks for it; empty where every batch holds it.
    in_motion : bool
        Whether a result that is converted to a flat table takes it along.
    """

    meaning: str
    name: str = ""
    key: str = ""
    kind: Literal["float", "int", "str", "objects", "table"] = "float"
    of: Any = None
    shape: tuple[int | None, ...] = ()
    length_power: int = 0
    null: Literal["", "number", "row"] = ""
    lower: float | None = None
    upper: float | None = None
    decimals: int | None = None
    digits: int = 0
    longest: int | None = None
    whole: bool = False
    symmetric: bool = False
    by_check: bool = False
    once: bool = False
    detail: bool = False
    optional: bool = False
    everywhere: bool = False
    flat_prefix: str = ""
    batch_place: int = 0
    asked_by: str = ""
    in_motion: bool = False

    @property
    def fill(self) -> float | int | str:
        """What stands where nothing is known, or in the padding of an array."""
        if self.kind == "str":
            return ""
        return -1 if self.kind == "int" else np.nan

    def checked(self, given: Any, count: int, within: str = "") -> Any:
        """Return the values of `count` survivors, their shape and bounds checked, their arrays read-only.

        Raises
        ------
        InputError
            Where there are not so many, or the numbers are not what they should be.
        """
        name = within + self.name
        if self.kind in ("objects", "table") and len(given) != count:
            raise _refused(name, f"{len(given)} entries", f"{count}, one a posture")
        if self.kind in ("objects", "table"):
            return given
        if self.kind == "str" and len(given) != count:
            raise _refused(name, f"{len(given)} codes", f"{count}, one a posture")
        if self.kind == "str":
            return tuple(str(text) for text in given)
        if self.by_check:
            return {check: self._array(f"{name}.{check}", values, count) for check, values in given.items()}
        return self._array(name, given, count)

    def in_file(self, values: Array, unit: Unit, precision: Precision | None = None) -> Array:
        """Turn numbers of memory, in metres, into those of a file, where noise is known with the digits they have."""
        values = _scaled(values, PER_METRE[unit], self.length_power)
        if self.symmetric:
            values = (precision or Precision(decimals=0)).covariances(values)
            return values[..., UPPER_TRIANGLE[0], UPPER_TRIANGLE[1]]
        if precision is None:
            return values
        if self.decimals is not None:
            of_unit = round(self.length_power * math.log10(PER_METRE[unit]))
            return precision.places(values, precision.decimals + self.decimals - of_unit)
        return precision.significant(values, self.digits) if self.digits else values

    def in_memory(self, values: Array, unit: Unit) -> Array:
        """Turn numbers of a file into those of memory, in metres."""
        values = _scaled(values, PER_METRE[unit], -self.length_power)
        if not self.symmetric:
            return values
        matrices = np.empty((*values.shape[:-1], 3, 3))
        matrices[..., UPPER_TRIANGLE[0], UPPER_TRIANGLE[1]] = values
        matrices[..., UPPER_TRIANGLE[1], UPPER_TRIANGLE[0]] = values
        return matrices

    def flat_names(self, parts: Sequence[str]) -> tuple[str, ...]:
        """Return its columns in a flat table: one, or one for each of its parts."""
        return tuple(f"{self.flat_prefix}.{part}" for part in parts) if self.flat_prefix else (self.key,)

    def _array(self, name: str, given: Any, count: int) -> NDArray[Any]:
        values = np.array(given, dtype=np.int64 if self.kind == "int" else np.float64)
        tail = (*self.shape[:-1], 3, 3) if self.symmetric else self.shape
        shape = (count, *(values.shape[-1] if extent is None else extent for extent in tail))
        if values.shape != shape or (self.kind == "int" and (values < 0).any()):
            expected = f"{shape} numbers from 0" if self.kind == "int" else f"shape {shape}"
            raise _refused(name, f"shape {values.shape}", expected)
        if np.isinf(values).any():
            raise _refused(name, "an infinite number", "finite numbers, or NaN where undecided")
        for bound, within in ((self.lower, np.greater_equal), (self.upper, np.less_equal)):
            if bound is not None and not within(values, bound).all():
                raise _refused(
                    name, "a number that is none", f"numbers from {self.lower:g} to {self.upper:g}"
                )
        values.flags.writeable = False
        return values


def column(meaning: str, *, default: Any = MISSING, **what: Any) -> Any:
    """Declare a field of a dataclass as a column.

    Parameters
    ----------
    meaning : str
        What it is, as `Column` has it.
    default : optional
        The field's default; None makes the column one that a frame may lack.
    **what
        What else `Column` says of it.
    """
    known = Column(meaning=meaning, optional=default is None, **what)
    return field(default=default, metadata={COLUMN_KEY: known})


@cache
def columns_in(table: Any) -> dict[str, Column]:
    """Return the columns of a dataclass by name, in the order of its fields; other fields are passed over."""
    columns = {}
    for item in fields(table):
        if COLUMN_KEY in item.metadata:
            known = item.metadata[COLUMN_KEY]
            columns[item.name] = replace(known, name=item.name, key=known.key or item.name)
    return columns


def _scaled(values: Array, per_metre: float, power: int) -> Array:
    """Multiply by a power of the units in a metre; a negative one divides, which errs less."""
    if not power:
        return values
    return np.asarray(values * per_metre**power if power > 0 else values / per_metre**-power)


def _refused(name: str, got: str, expected: str) -> Exception:
    return refusal("result", name, got, expected, "correct what made the result")
