"""Posekit's own files, by the schema that each one names; their readers are loaded when a file is read."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, Final

from posekit.formats.format import Content, Format
from posekit.formats.given_file import MAX_DECLARED, GivenFile
from posekit.safe_io import open_npz
from posekit.skeleton import POINTS

BATCH_FILE: Final = "batch.json"
"""The file by which the folder of a batch is known."""


@dataclass(frozen=True, kw_only=True)
class OwnFormat(Format):
    """A format of posekit.

    Parameters
    ----------
    reader : str
        ``module:function``, which reads a path; empty where `posekit.open` gives no object for it.
    """

    reader: str = ""

    @property
    def reads(self) -> bool:
        """Whether files of this format can be read."""
        return bool(self.reader)

    def read(self, path: Path) -> Any:
        """Read a file.

        Parameters
        ----------
        path : Path
            The file.

        Raises
        ------
        InputError
            Where it breaks its schema or is damaged.
        """
        module, _, function = self.reader.partition(":")
        return getattr(import_module(module), function)(path)


def _own(
    name: str, title: str, holds: Content, reader: str = "", suffixes: tuple[str, ...] = (".json",)
) -> OwnFormat:
    """Declare a format whose files name their schema, ``posekit.NAME/1``."""

    def looks_like(given: GivenFile) -> bool:
        return given.schema.partition("/")[0] == f"posekit.{name}"

    return OwnFormat(
        name=name, title=title, holds=holds, suffixes=suffixes, looks_like=looks_like, reader=reader
    )


def _is_survivors(given: GivenFile) -> bool:
    from posekit.formats.motion.survivors_files import is_survivors

    return is_survivors(given)


def _is_urdf(given: GivenFile) -> bool:
    return given.suffix == ".urdf"


def _has_only_joints(given: GivenFile) -> bool:
    """Tell arrays of postures from motion's, which have times, and names where their points are others."""
    timed = given.arrays & {"clip_fps", "rate", "fps", "time"} and given.arrays & {"joint_names", "names"}
    return given.schema == "" and "joints" in given.arrays and not timed and not _names_others(given)


def _names_others(given: GivenFile) -> bool:
    """Tell whether most of an archive's joints have other names than ours: it is motion whose times are missing."""
    if "joint_names" not in given.arrays:
        return False
    with open_npz(given.path, limit=MAX_DECLARED) as archive:
        named = set(archive.array("joint_names", "U", None).reshape(-1).tolist())
    return 2 * len(named & set(POINTS)) < len(named)


def _has_only_q(given: GivenFile) -> bool:
    return given.schema == "" and "q" in given.arrays and "joints" not in given.arrays


_JSON_OR_NPZ: Final = (".json", ".npz")

OWN_FORMATS: Final = (
    _own("view", "what a camera saw", Content.VIEW, "posekit.formats.own.view_file:read_view"),
    _own(
        "result",
        "the survivors of a view",
        Content.RESULT,
        "posekit.formats.own.result_file:read_result",
        (*_JSON_OR_NPZ, ".parquet"),
    ),
    _own(
        "postures",
        "postures of 14 joints",
        Content.POSTURES,
        "posekit.formats.own.postures:read_postures",
        _JSON_OR_NPZ,
    ),
    _own(
        "configurations",
        "configurations of a robot",
        Content.CONFIGURATIONS,
        "posekit.formats.own.postures_q:read_configurations",
        _JSON_OR_NPZ,
    ),
    OwnFormat(
        name="configuration-arrays",
        title="NPZ with q and without a schema: configurations of a robot",
        holds=Content.CONFIGURATIONS,
        suffixes=(".npz",),
        looks_like=_has_only_q,
        reader="posekit.formats.own.postures_q:read_configurations",
    ),
    OwnFormat(
        name="posture-arrays",
        title="NPZ with joints and without a schema: postures of 14 joints",
        holds=Content.POSTURES,
        suffixes=(".npz",),
        looks_like=_has_only_joints,
        reader="posekit.formats.own.postures:read_postures",
    ),
    OwnFormat(
        name="survivors",
        title="a row a survivor: frame, survivor, and the joints' coordinates",
        holds=Content.SURVIVORS,
        suffixes=(".csv", ".parquet", ".pq", ".npz"),
        looks_like=_is_survivors,
        reader="posekit.formats.motion.survivors_files:read_survivors",
    ),
    OwnFormat(
        name="robot",
        title="URDF of a robot",
        holds=Content.ROBOT,
        suffixes=(".urdf",),
        looks_like=_is_urdf,
        reader="posekit.robots.loading:load_robot",
    ),
    _own(
        "object",
        "the survivors of a view of an object",
        Content.OBJECTS,
        "posekit.formats.own.object_result:read_object",
    ),
    _own("report", "verdicts of checks", Content.REPORT, "posekit.formats.own.report_file:read_report"),
    _own("evaluation", "how good recovery is", Content.EVALUATION, "posekit.safe_io:read_json"),
    _own("nearer", "nearer ends of segments", Content.OTHER, "posekit.formats.own.nearer:read_nearer"),
    _own(
        "lengths",
        "lengths of a person",
        Content.OTHER,
        "posekit.body.anthropometry.lengths_file:read_lengths",
        (".toml", ".json"),
    ),
    OwnFormat(
        name="batch",
        title="the folder of posekit batch",
        holds=Content.BATCH,
        folder=True,
        looks_like=lambda given: (given.path / BATCH_FILE).is_file(),
    ),
)
"""Formats that posekit writes; a file is none of a detector's or of another program where it is one of these."""
