"""``posekit.report/2``: a `Report` as JSON, NPZ, CSV, Parquet and Markdown.

JSON and NPZ contain the whole report as named columns. CSV and Parquet contain the table of findings with one row per
violation, for pandas. Parquet stores the rest of the report in its metadata.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.files import write_bytes
from posekit.formats import json_file
from posekit.formats.json_file import nullable
from posekit.formats.node import Node, schema_of, undamaged
from posekit.formats.options import Options
from posekit.formats.result_file import plain
from posekit.formats.tables import Table, columns_of_rows, csv_text
from posekit.formats.view_file import check_schema

if TYPE_CHECKING:
    from posekit.validators.report import Report

REPORT_SCHEMA: Final = "posekit.report/2"
#: Arrays with one entry per frame, and their types.
ROWS: Final = {"clip": np.intp, "frame": np.intp, "time": np.float64, "incomplete": np.bool_}
#: Arrays with one entry per frame and check, and their types.
TABLES: Final = {"margins": np.float64, "silent": np.bool_}
#: Columns of the findings with integers, and their types.
FINDINGS: Final = {"row": np.intp, "check": np.intp, "place": np.intp}
NUMBERS: Final = ("value", "lower", "upper", "margin")
TEXTS: Final = ("files", "names", "checks", "units", "places", "notes", "warnings", "refused")
MAPPINGS: Final = ("messages", "not_asked", "settings")


def looks_like(document: Any) -> bool:
    """Return whether a JSON document, NPZ arrays or a Parquet table contain a report."""
    return schema_of(document).startswith("posekit.report/")


def read(document: Any, path: str | Path, options: Options) -> Report:
    """Read a report.

    Raises
    ------
    InputError
        If the document is damaged or of another version.
    """
    from posekit.validators.report import Report

    with undamaged(path, REPORT_SCHEMA):
        if isinstance(document, Table):
            document = json_file.parse(document.about["posekit"].encode(), f"{path}: about")
        root = Node(document, path)
        check_schema(root, REPORT_SCHEMA)
        if "about" in document:
            about = json_file.parse(root.at("about").text().encode(), f"{path}: about")
            root = Node({**about, **document}, path)
        count = len(root.at("clip").array(None))
        texts: dict[str, Any] = {name: root.at(name).texts() for name in TEXTS}
        checks = len(texts["checks"])
        found = {one: root.at(f"findings.{one}").array(None, unknown=True) for one in (*FINDINGS, *NUMBERS)}
        for name, most in (("row", count), ("check", checks), ("place", len(texts["places"]))):
            if len(found[name]) and not (0 <= found[name].min() and found[name].max() < most):
                expected = f"numbers from 0 to {most - 1}"
                raise root.at(f"findings.{name}").refused(expected, "write the report again")
        fields: dict[str, Any] = {name: dict(root.at(name).object()) for name in MAPPINGS}
        for name, kind in {**ROWS, **TABLES}.items():
            shape = (count, checks) if name in TABLES else (count,)
            fields[name] = root.at(name).array(*shape, unknown=kind is np.float64).astype(kind)
        findings = {name: values.astype(FINDINGS.get(name, np.float64)) for name, values in found.items()}
        return Report(findings=findings, **texts, **fields)


def write_json(path: str | Path, report: Report) -> None:
    """Write a report as JSON, with its decision and its clips."""
    from posekit.validators.report import clip_rows

    document = {**_about(report), "decision": report.decision, "clips": plain(clip_rows(report))}
    json_file.write(path, document | {key: nullable(values) for key, values in _arrays(report).items()})


def write_npz(path: str | Path, report: Report) -> None:
    """Write a report as arrays by name."""
    from posekit.formats.npz_file import packed

    about = json.dumps(_about(report), allow_nan=False)
    arrays = {"schema": np.array(REPORT_SCHEMA), "about": np.array(about), **_arrays(report)}
    write_bytes(path, packed(arrays))


def write_csv(path: str | Path, report: Report, *, clips: bool = False) -> None:
    """Write the table of findings, or the table of clips, as CSV."""
    write_bytes(path, csv_text(_table(report, clips)).encode())


def write_parquet(path: str | Path, report: Report, *, clips: bool = False) -> None:
    """Write the table of findings with the rest of the report in its metadata, or the table of clips."""
    from posekit.formats.parquet import packed_table

    about = {}
    if not clips:
        held = _about(report) | {key: nullable(values) for key, values in _arrays(report).items()}
        about["posekit"] = json.dumps(held, allow_nan=False)
    table = _table(report, clips).items()
    columns = {key: one.astype(np.str_) if one.dtype == object else one for key, one in table}
    write_bytes(path, packed_table(columns, about))


def _table(report: Report, clips: bool) -> dict[str, NDArray[Any]]:
    """Return the columns of the table of clips, or of the table of findings."""
    from posekit.validators.report import clip_rows

    return columns_of_rows(clip_rows(report)) if clips else report.table()


def write_md(path: str | Path, report: Report) -> None:
    """Write the summary as Markdown."""
    write_bytes(path, f"# {report.decision}\n\n```\n{report.summary()}\n```\n".encode())


def _about(report: Report) -> dict[str, Any]:
    """Return the fields of a report that are not arrays."""
    about: dict[str, Any] = {"schema": REPORT_SCHEMA}
    about |= {name: list(getattr(report, name)) for name in TEXTS}
    return about | {name: plain(dict(getattr(report, name))) for name in MAPPINGS}


def _arrays(report: Report) -> Mapping[str, Any]:
    """Return the arrays of a report by name, with booleans as 0 and 1."""
    held = {name: np.asarray(getattr(report, name)) for name in (*ROWS, *TABLES)}
    held |= {f"findings.{name}": np.asarray(report.findings[name]) for name in (*FINDINGS, *NUMBERS)}
    return {name: one.astype(np.int8) if one.dtype == np.bool_ else one for name, one in held.items()}
