"""Priors as TOML tables of schema `posekit.posture_prior/1`."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from posekit.errors import InputError
from posekit.geometry import Array
from posekit.ranking.posture_prior import TERM_NAMES, WEIGHT_NAMES, DirectionBlock, Prior, SmallDistancePrior
from posekit.ranking.student import StudentMixture
from posekit.safe_io import nearest, refusal, shown, write_lines

if TYPE_CHECKING:
    from posekit.tables.prior import PriorTable

PRIOR_SCHEMA: Final = "posekit.posture_prior/1"
BUILT_IN: Final = ("people", "cmu")
"""The motion of several sources, which counts unless told otherwise, and one t distribution of a laboratory's."""

N_DECIMALS: Final = 5
"""Decimals of means and scales: a direction is told to a thousandth of a degree."""

N_DECIMALS_OF_MEANS: Final = 3
"""The same of the middles of a mixture, which are apart by tens of degrees."""

LATER_WEIGHTS: Final = ("foreshortening",)
"""Terms that tables of one's own may be older than: they count nothing there."""


def load_prior(name: str | Path = "people") -> Prior:
    """Load a prior by name (`people`, `cmu`) or from a TOML file.

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
                    student=StudentMixture(
                        means=np.array(block.mean),
                        share=None if block.share is None else np.array(block.share),
                        scale=block.matrix,
                        dof=table.dof,
                    ),
                    conditional=block.conditional,
                )
                for block in table.block
            ),
            temperature=table.temperature,
            weights=_with_later(table.weights),
            refined=table.refined,
            image_temperature=math.inf if table.image_temperature is None else table.image_temperature,
            balance=SmallDistancePrior(table.balance.scale, table.balance.usual),
            contact=SmallDistancePrior(table.contact.scale, table.contact.usual),
        )
    except InputError as error:
        raise InputError(str(error) if str(error).startswith(name) else f"{name}: {error}") from None


def _with_later(weights: dict[str, float]) -> dict[str, float]:
    """Add terms that a table is older than, if these are all that it lacks."""
    missing = set(WEIGHT_NAMES) - set(weights)
    return weights | dict.fromkeys(missing, 0.0) if missing <= set(LATER_WEIGHTS) else weights


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
    if math.isfinite(prior.image_temperature):
        yield f"image_temperature = {prior.image_temperature:.6g}  # metres"
    yield ""
    yield "[weights]"
    yield from (f"{name} = {prior.weights[name]:.3g}" for name in WEIGHT_NAMES)
    if prior.refined is not None:
        yield ""
        yield "[refined]  # weights of refined survivors"
        yield from (f"{name} = {prior.refined[name]:.3g}" for name in TERM_NAMES)
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
        if block.conditional:
            yield "conditional = true"
        if len(block.student.means) == 1:
            yield f"mean = {_spell(block.student.means[0])}"
        else:
            yield f"share = {_spell(block.student.shares)}"
            yield "mean = ["
            yield from (f"  {_spell(mean, N_DECIMALS_OF_MEANS)}," for mean in block.student.means)
            yield "]"
        yield "scale = [  # the lower triangle, row by row"
        yield from (f"  {_spell(row[: k + 1])}," for k, row in enumerate(block.student.scale))
        yield "]"


def _spell(values: Array, decimals: int = N_DECIMALS) -> str:
    return "[" + ", ".join(f"{value + 0.0:.{decimals}f}" for value in np.round(values, decimals)) + "]"
