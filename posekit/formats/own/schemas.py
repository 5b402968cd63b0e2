"""The JSON Schemas of posekit's files, versioned, as they are published."""

from __future__ import annotations

import json
from typing import Any, Final

from posekit.formats.own import (
    batch_schema,
    evaluation_schema,
    object_result_schema,
    postures_q_schema,
    postures_schema,
    report_schema,
    result_schema,
    view_schema,
)
from posekit.formats.own import nearer as nearer_schema
from posekit.formats.own.result import EARLIER_RESULT_SCHEMA, RESULT_SCHEMA
from posekit.safe_io.refusal import nearest, refusal, shown
from posekit.tables.file_model import FileModel

_MODELS: Final[dict[str, type[FileModel]]] = {
    view_schema.VIEW_SCHEMA: view_schema.ViewFile,
    EARLIER_RESULT_SCHEMA: result_schema.EarlierResultFile,
    RESULT_SCHEMA: result_schema.ResultFile,
    postures_schema.POSTURES_SCHEMA: postures_schema.PosturesFile,
    report_schema.REPORT_SCHEMA: report_schema.ReportFile,
    nearer_schema.NEARER_SCHEMA: nearer_schema.NearerFile,
    object_result_schema.OBJECT_SCHEMA: object_result_schema.ObjectFile,
    postures_q_schema.CONFIGURATIONS_SCHEMA: postures_q_schema.ConfigurationsFile,
    evaluation_schema.EVALUATION_SCHEMA: evaluation_schema.EvaluationFile,
    batch_schema.BATCH_SCHEMA: batch_schema.BatchFile,
    batch_schema.MANIFEST_SCHEMA: batch_schema.ManifestFile,
}
SCHEMA_NAMES: Final = tuple(_MODELS)
"""The names of the schemas, each with its version: ``posekit.view/1``."""


def schema(name: str) -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of a kind of file.

    Parameters
    ----------
    name : str
        One of `SCHEMA_NAMES`, or its middle, which is the newest of that kind: ``"posekit.view/1"``, ``"view"``.

    Returns
    -------
    dict
        With ``$schema``, ``$id`` (``urn:posekit:view:1``) and ``title``.

    Raises
    ------
    InputError
        Where there is no schema of this name.
    """
    known = {**{full: full for full in SCHEMA_NAMES}, **{_short(full): full for full in SCHEMA_NAMES}}
    if name not in known:
        raise refusal("", "schema", shown(name), "the name of a schema", nearest(name, known))
    full = known[name]
    head = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": f"urn:{full.replace('.', ':').replace('/', ':')}",
    }
    return {**head, **_MODELS[full].model_json_schema(), "title": full}


def schema_text(name: str) -> str:
    """Return a JSON Schema as text, two spaces a level, as the documentation prints it."""
    return json.dumps(schema(name), indent=2, ensure_ascii=False) + "\n"


def _short(name: str) -> str:
    return name.removeprefix("posekit.").rpartition("/")[0]
