"""Priors as TOML tables of schema `posekit.posture_prior/1`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any, Final

import numpy as np

from posekit.errors import InputError
from posekit.geometry import Array
from posekit.ranking.directions import DIRECTION_NAMES
from posekit.ranking.prior import WEIGHT_NAMES, DirectionBlock, Prior, SmallDistancePrior
from posekit.ranking.student import Student
from posekit.safe_io import nearest, parse_toml, read_toml, refusal, shown, write_lines

PRIOR_SCHEMA: Final = "posekit.posture_prior/1"
BUILT_IN: Final = ("cmu",)
MAX_BYTES: Final = 1_000_000
N_DECIMALS: Final = 5
"""Decimals of means and scales: a direction is told to a thousandth of a degree."""


def load_prior(name: str | Path = "cmu") -> Prior:
    """Load a prior by name (`cmu`) or from a TOML file.

    Raises
    ------
    InputError
        Where there is no such table, or it is not what `posekit.posture_prior/1` says.
    """
    if str(name) in BUILT_IN:
        return _built_in(str(name))
    path = Path(name)
    if path.suffix.lower() != ".toml":
        raise refusal(
            "", "prior", shown(str(name)), "a built-in prior or a TOML file", nearest(str(name), BUILT_IN)
        )
    return parse_prior(read_toml(path, limit=MAX_BYTES), str(path))


@cache
def _built_in(name: str) -> Prior:
    text = (resources.files("posekit.urdf") / "priors" / f"{name}.toml").read_text("utf-8")
    return parse_prior(parse_toml(text, name), name)


def parse_prior(table: dict[str, Any], source: str) -> Prior:
    """Make a prior of a parsed TOML table.

    Raises
    ------
    InputError
        Where it is not what `posekit.posture_prior/1` says.
    """
    if table.get("schema") != PRIOR_SCHEMA:
        raise refusal(
            source, "schema", shown(table.get("schema")), f'"{PRIOR_SCHEMA}"', "name it in the first line"
        )
    fields = ("schema", "source", "dof", "temperature", "weights", "balance", "contact", "block")
    for name in table:
        if name not in fields:
            raise refusal(source, name, "an unknown entry", ", ".join(fields), "remove it")
    dof = _number(table, "dof", source)
    if not 0 < dof <= 1e6:
        raise refusal(source, "dof", shown(dof), "more than zero, up to a million", "correct it")
    weights = _table(table, "weights", source)
    spreads = {}
    for name in ("balance", "contact"):
        entry = _table(table, name, source)
        spreads[name] = SmallDistancePrior(
            _number(entry, "scale", source, name), _number(entry, "usual", source, name)
        )
    blocks = table.get("block")
    if not isinstance(blocks, list) or not 0 < len(blocks) <= len(DIRECTION_NAMES):
        raise refusal(
            source, "block", shown(blocks), f"1 to {len(DIRECTION_NAMES)} tables", "give them as [[block]]"
        )
    try:
        return Prior(
            name=source,
            source=str(table.get("source", "")),
            blocks=tuple(_block(block, dof, source, k) for k, block in enumerate(blocks)),
            temperature=_number(table, "temperature", source),
            weights={name: _number(weights, name, source, "weights") for name in (*WEIGHT_NAMES, *weights)},
            balance=spreads["balance"],
            contact=spreads["contact"],
        )
    except InputError as error:
        raise InputError(str(error) if str(error).startswith(source) else f"{source}: {error}") from None


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


def _block(entry: object, dof: float, source: str, k: int) -> DirectionBlock:
    field = f"block[{k}]"
    if not isinstance(entry, dict) or set(entry) != {"directions", "mean", "scale"}:
        raise refusal(source, field, shown(entry), "directions, mean and scale", "give these three")
    names, mean, rows = entry["directions"], entry["mean"], entry["scale"]
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise refusal(source, f"{field}.directions", shown(names), "names", "list them")
    size = 3 * len(names)
    if not _numbers(mean, size):
        raise refusal(source, f"{field}.mean", shown(mean), f"{size} numbers, 3 a direction", "correct it")
    if not (
        isinstance(rows, list)
        and len(rows) == size
        and all(_numbers(row, i + 1) for i, row in enumerate(rows))
    ):
        raise refusal(
            source, f"{field}.scale", shown(rows), f"{size} rows of 1, 2, … {size} numbers", "correct it"
        )
    lower = np.zeros((size, size))
    for i, row in enumerate(rows):
        lower[i, : i + 1] = row
    scale = lower + np.tril(lower, -1).T
    if size and not float(np.linalg.eigvalsh(scale)[0]) > 1e-9:
        raise refusal(
            source, f"{field}.scale", "a matrix that is not positive definite", "variances", "correct it"
        )
    return DirectionBlock(
        names=tuple(names), student=Student(mean=np.array(mean, dtype=np.float64), scale=scale, dof=dof)
    )


def _numbers(values: object, count: int) -> bool:
    return (
        isinstance(values, list)
        and len(values) == count
        and all(isinstance(value, int | float) and not isinstance(value, bool) for value in values)
    )


def _table(table: Mapping[str, Any], name: str, source: str) -> dict[str, Any]:
    entry = table.get(name)
    if not isinstance(entry, dict):
        raise refusal(source, name, shown(entry), "a table", f"give [{name}]")
    return entry


def _number(table: Mapping[str, Any], name: str, source: str, where: str = "") -> float:
    value = table.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise refusal(source, f"{where}.{name}".lstrip("."), shown(value), "a number", "give one")
    return float(value)
