"""Read and write postures given as configurations q of a robot: ``posekit.configurations/1``, JSON or NPZ."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posekit.display.short_repr import ShortRepr
from posekit.formats.own.npz import suffix, write_npz
from posekit.formats.own.postures_q_schema import CONFIGURATIONS_SCHEMA, ConfigurationsFile
from posekit.safe_io.json_file import read_json
from posekit.safe_io.npz_file import MAX_ARRAYS, Archive, not_finite, open_npz
from posekit.safe_io.refusal import nearest, refusal, shown
from posekit.safe_io.writing import json_pieces, replacing, write_text
from posekit.tables.file_model import validated

Array = NDArray[np.float64]

ROOT_NAMES = ("x", "y", "z", "qx", "qy", "qz", "qw")
"""The variables of a root that moves freely; where a file has none of them it stands at the origin."""


@dataclass(frozen=True, kw_only=True, eq=False)
class NamedConfigurations(ShortRepr):
    """Configurations as a file has them.

    Parameters
    ----------
    q : array (N, K)
        Radians, metres; quaternions x, y, z, w.
    names : tuple of str (K,), optional
        The variables in the file's order; None where it does not name them.
    source : str
        What to call them in errors.
    time : array (N,)
        Seconds; empty where the file says none.
    said : tuple of str
        What was found out about the file, a sentence each.
    """

    q: Array
    names: tuple[str, ...] | None = None
    source: str = "q"
    time: Array = field(default_factory=lambda: np.empty(0))
    said: tuple[str, ...] = ()

    def __len__(self) -> int:
        """Count the configurations."""
        return len(self.q)

    def in_order_of(self, names: Sequence[str]) -> Array:
        """Return q in a robot's order (N, nq).

        Names are matched; without names the file's order is the robot's. Variables of the root may all be left out:
        then the root stands at the origin.

        Parameters
        ----------
        names : sequence of str (nq,)
            The robot's ``configuration_names``.

        Raises
        ------
        InputError
            Where a name is unknown, missing or there twice, or without names the number of variables is another.
        """
        rooted = tuple(names[: len(ROOT_NAMES)]) == ROOT_NAMES
        own = self.names
        if own is None:
            short = rooted and self.q.shape[1] == len(names) - len(ROOT_NAMES)
            own = tuple(names[len(ROOT_NAMES) :]) if short else tuple(names)
            if self.q.shape[1] != len(own):
                remedy = "check which robot it is; configuration_names says what is in which place"
                raise refusal(self.source, "q", f"{self.q.shape[1]} variables", f"{len(names)}", remedy)
        own = tuple(name if name in names else f"{name}_joint" for name in own)  # as some tables shorten them
        unknown = [name.removesuffix("_joint") for name in own if name not in names]
        if unknown:
            another = len(unknown) > 1 and not set(own) & set(names[len(ROOT_NAMES) :])
            expected = f"a variable of the robot{f', as {names[-1]}' if another else ''}"
            which = "say which robot it is, as posekit validate --urdf FILE|NAME"
            remedy = which if another else nearest(unknown[0], names)[:200]
            raise refusal(self.source, "configuration_names", shown(unknown[0]), expected, remedy)
        wanted = names[len(ROOT_NAMES) :] if rooted and not set(own) & set(ROOT_NAMES) else names
        missing = [name for name in wanted if name not in own]
        if missing:
            got = f"no {', no '.join(missing[:3])}{' …' if len(missing) > 3 else ''}"
            raise refusal(
                self.source, "configuration_names", got, "every variable of the robot", "add what is missing"
            )
        q = np.zeros((len(self.q), len(names)))
        if rooted:
            q[:, len(ROOT_NAMES) - 1] = 1.0
        q[:, [list(names).index(name) for name in own]] = self.q
        return q


def read_configurations(path: str | Path) -> NamedConfigurations:
    """Read configurations.

    Parameters
    ----------
    path : path
        JSON of schema ``posekit.configurations/1``; or an NPZ with ``q`` (N, K) and, where its order is not the
        robot's, ``configuration_names`` (K,); and perhaps ``time`` (N,), seconds, or ``rate``.

    Raises
    ------
    InputError
        Where the file breaks its schema, is damaged, or would take more than 1 GB of memory.
    """
    if suffix(path, ".json", ".npz") == ".npz":
        with open_npz(path) as archive:
            archive.check_held(MAX_ARRAYS)
            return _from_archive(archive)
    file = validated(ConfigurationsFile, read_json(path), path)
    width = len(file.q[0]) if file.q else len(file.configuration_names or ())
    for index, row in enumerate(file.q):
        if len(row) != width:
            raise refusal(
                path, f"q[{index}]", f"{len(row)} numbers", f"{width}, as in the first", "correct it"
            )
    q = np.array(file.q, dtype=np.float64).reshape(len(file.q), width)
    return _checked(path, q, None if file.configuration_names is None else tuple(file.configuration_names))


def write_configurations(path: str | Path, q: Array, names: Sequence[str], time: Array | None = None) -> None:
    """Write configurations (N, K) with the names of their variables, whole or not at all, ``.json`` or ``.npz``.

    An NPZ has the times of frames (N,), seconds, where they are given.
    """
    timed = {} if time is None or not len(time) else {"time": time}
    if suffix(path, ".json", ".npz") == ".npz":
        with replacing(path) as file:
            write_npz(
                file,
                {
                    "schema": np.array(CONFIGURATIONS_SCHEMA),
                    "configuration_names": np.array(list(names)),
                    "q": q,
                    **timed,
                },
            )
        return
    write_text(
        path,
        json_pieces({"schema": CONFIGURATIONS_SCHEMA, "configuration_names": list(names)}, "q", _listed(q)),
    )


def _listed(q: Array) -> Iterator[list[Any]]:
    for row in q:
        yield row.tolist()


def _from_archive(archive: Archive) -> NamedConfigurations:
    q = archive.array("q", "f", (None, None)).astype(np.float64)
    names: tuple[str, ...] | None = None
    if "configuration_names" in archive.names:
        names = tuple(archive.array("configuration_names", "U", (None,)).tolist())
    time = np.empty(0)
    if "time" in archive.names:
        time = archive.array("time", "iuf", (len(q),)).astype(np.float64)
    elif rate := next((name for name in ("rate", "fps") if name in archive.names), ""):
        value = float(archive.array(rate, "iuf", ()))
        time = np.arange(len(q)) / value if 0 < value < np.inf else np.full(len(q), np.nan)
    return _checked(archive.path, q, names, time)


def _checked(
    path: str | Path, q: Array, names: tuple[str, ...] | None, time: Array | None = None
) -> NamedConfigurations:
    for name, values in (("q", q), ("time", np.empty(0) if time is None else time)):
        if np.isinf(values).any():
            raise not_finite(path, name, values)
    if names is not None and len(names) != q.shape[1]:
        expected = f"{q.shape[1]}, one a variable of q"
        raise refusal(path, "configuration_names", f"{len(names)} names", expected, "name each once")
    if names is not None and len(set(names)) != len(names):
        raise refusal(
            path, "configuration_names", "a name twice", "each variable once", "remove one of the two"
        )
    return NamedConfigurations(q=q, names=names, source=str(path), time=np.empty(0) if time is None else time)
