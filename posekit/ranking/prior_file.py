"""Priors as TOML tables of schema `posekit.posture_prior/1`."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from posekit.errors import InputError
from posekit.geometry import Array
from posekit.ranking.posture_prior import WEIGHT_NAMES, DirectionBlock, Prior, SmallDistancePrior
from posekit.ranking.student import Student
from posekit.safe_io import nearest, refusal, shown, write_lines

if TYPE_CHECKING:
    from posekit.tables.prior import PriorTable

PRIOR_SCHEMA: Final = "posekit.posture_prior/1"
BUILT_IN: Final = ("cmu",)
N_DECIMALS: Final = 5
"""Decimals of means and scales: a direction is told to a thousandth of a degree."""


def load_prior(name: str | Path = "cmu") -> Prior:
    """Load a prior by name (`cmu`) or from a TOML file.

    Raises
    ------
    InputError
        Where there is no such table, or it is not what `posekit.posture_prior/1` says.
    """
    from posekit.tables.prior import PriorTable
    from posekit.tables.reading import read_table

    if str(name) in BUILT_IN:
        return _built_in(str(name))
    path = Path(name)
    if path.suffix.lower() != ".toml":
        raise refusal(
            "", "prior", shown(str(name)), "a built-in prior or a TOML file", nearest(str(name), BUILT_IN)
        )
    return prior_of(read_table(path, PriorTable), str(path))


@cache
def _built_in(name: str) -> Prior:
    from posekit.tables.prior import PriorTable
    from posekit.tables.reading import read_built_in

    return prior_of(read_built_in("priors", name, PriorTable), name)


def prior_of(table: PriorTable, name: str) -> Prior:
    """Make a prior of its table.

    Parameters
    ----------
    table : PriorTable
        What a file says.
    name : str
        The file, or the built-in prior: what errors call it.

    Raises
    ------
    InputError
        Where it names a direction or a weight that is not known, or has one twice.
    """
    try:
        return Prior(
            name=name,
            source=table.source,
            blocks=tuple(
                DirectionBlock(
                    names=tuple(block.directions),
                    student=Student(mean=np.array(block.mean), scale=block.matrix, dof=table.dof),
                )
                for block in table.block
            ),
            temperature=table.temperature,
            weights=table.weights,
            balance=SmallDistancePrior(table.balance.scale, table.balance.usual),
            contact=SmallDistancePrior(table.contact.scale, table.contact.usual),
        )
    except InputError as error:
        raise InputError(str(error) if str(error).startswith(name) else f"{name}: {error}") from None


def write_prior(path: str | Path, prior: Prior) -> None:
    """Write a prior as TOML, rounded to what it is good for."""
    write_lines(path, prior_lines(prior))


def prior_lines(prior: Prior) -> Iterator[str]:
    """Spell a prior, line by line."""
    text = prior.source.replace("\\", "/").replace('"', "'")
    yield f'schema = "{PRIOR_SCHEMA}"'
    yield f'source = "{" ".join(text.split())}"'
    yield f"dof = {prior.blocks[0].student.dof:.6g}  # degrees of freedom of the t distributions"
    yield f"temperature = {prior.temperature:.6g}  # metres"
    yield ""
    yield "[weights]"
    yield from (f"{name} = {prior.weights[name]:.3g}" for name in WEIGHT_NAMES)
    for name, spread in (("balance", prior.balance), ("contact", prior.contact)):
        yield ""
        yield f"[{name}]"
        yield f"scale = {spread.scale:.6g}  # metres"
        yield f"usual = {spread.usual:.4g}"
    for block in prior.blocks:
        yield ""
        yield "[[block]]"
        quoted = ", ".join(f'"{name}"' for name in block.names)
        yield f"directions = [{quoted}]"
        yield f"mean = {_spell(block.student.mean)}"
        yield "scale = [  # the lower triangle, row by row"
        yield from (f"  {_spell(row[: k + 1])}," for k, row in enumerate(block.student.scale))
        yield "]"


def _spell(values: Array) -> str:
    return "[" + ", ".join(f"{value + 0.0:.{N_DECIMALS}f}" for value in np.round(values, N_DECIMALS)) + "]"
