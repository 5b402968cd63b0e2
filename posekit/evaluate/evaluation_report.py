"""What an evaluation is written as: JSON with everything, CSV with a row a condition, tables for the terminal."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterator, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

from posekit.display.plural import plural
from posekit.evaluate.condition import curves, lost_to, numbers
from posekit.evaluate.evaluated_frames import CONDITION_KEYS
from posekit.evaluate.evaluation import Evaluation
from posekit.formats.markdown import no_markup, table_lines
from posekit.formats.own.npz import suffix
from posekit.safe_io import one_line
from posekit.safe_io.writing import check_target, json_pieces, write_lines, write_text

EVALUATION_SCHEMA: Final = "posekit.evaluation/1"
REPORT_SUFFIXES: Final = (".json", ".csv", ".md")

FOLLOWED_COLUMNS: Final = ("MPJPE path", "PA path", "limbs right: path", "best", "first", "random", "bridged")
"""Columns of the tables where sequences are followed."""

CONDITION_GROUPS: Final = {
    "all": (),
    "by_noise": ("noise",),
    "by_action": ("action", "noise"),
    "by_yaw": ("yaw", "noise"),
    "by_height": ("height", "noise"),
}
"""Conditions that are told together, besides one by one."""


def check_evaluation_path(path: str | Path) -> None:
    """Refuse a report's name before the work that it is for is done."""
    suffix(path, *REPORT_SUFFIXES)
    check_target(path)


def write_evaluation(path: str | Path, evaluation: Evaluation) -> None:
    """Write an evaluation, whole or not at all: ``.json``, ``.csv`` or ``.md``.

    Raises
    ------
    InputError
        Where the name ends otherwise or the file cannot be written.
    """
    kind = suffix(path, *REPORT_SUFFIXES)
    if kind == ".json":
        head, conditions = document(evaluation)
        write_text(path, json_pieces(head, "conditions", conditions))
    else:
        write_lines(path, csv_lines(evaluation) if kind == ".csv" else summary(evaluation, markdown=True))


def document(evaluation: Evaluation) -> tuple[dict[str, Any], Iterator[dict[str, Any]]]:
    """Return the JSON's head, and its conditions one by one: action, yaw, height and noise each."""
    frames, material = evaluation.frames, evaluation.material
    head: dict[str, Any] = {
        "schema": EVALUATION_SCHEMA,
        "settings": {
            **evaluation.settings,
            "versions": {name: version(name) for name in ("posekit", "pin", "coal", "numpy")},
        },
        "frames": len(frames),
        "out_of_picture": material.out_of_picture,
        "left_out": list(material.left_out),
    }
    for name, keys in CONDITION_GROUPS.items():
        told = [{**key, **numbers(frames, rows)} for key, rows in frames.conditions(keys)]
        head[name] = told if keys else told[0]
    head["curves"] = [{**key, **curves(frames, rows)} for key, rows in frames.conditions(("noise",))]
    head["truth_lost_to"] = [
        {**key, "by": lost_to(frames, rows)} for key, rows in frames.conditions(("noise",))
    ]
    return head, ({**key, **numbers(frames, rows)} for key, rows in frames.conditions(CONDITION_KEYS))


def csv_lines(evaluation: Evaluation) -> Iterator[str]:
    """Yield the lines (RFC 4180): a head, then every condition; what there is none of is empty."""
    head: list[str] = []
    for key, rows in evaluation.frames.conditions(CONDITION_KEYS):
        row = _flat({**key, **numbers(evaluation.frames, rows)})
        if not head:
            head = list(row)
            yield ",".join(head)
        yield _line(row.get(name) for name in head)


def summary(evaluation: Evaluation, *, markdown: bool = False) -> list[str]:
    """Return the tables: by noise, by action at the least noise, what killed the truth, and violations.

    Parameters
    ----------
    evaluation : Evaluation
        What was found.
    markdown : bool
        Whether names are escaped for a file that is rendered; else for a terminal.
    """
    spelled = no_markup if markdown else one_line
    frames, material = evaluation.frames, evaluation.material
    every = numbers(frames, next(iter(frames.conditions(()))).rows)
    cameras = evaluation.settings.get("yaws")
    seen = (
        f", {plural(len(cameras), 'yaw')} x {plural(len(evaluation.settings['heights']), 'height')}"
        if cameras
        else ""
    )
    lines = [
        f"{plural(len(frames), 'view')} of {spelled(str(evaluation.settings['source']))}{seen}, ranges "
        f"{evaluation.settings['ranges']}"
    ]
    lines += [f"left out: {spelled(line)}" for line in material.left_out]
    if material.out_of_picture:
        lines.append(
            f"left out: {plural(material.out_of_picture, 'view')} in which the person leaves the picture"
        )
    lines += ["", "By added noise (errors: means over frames with survivors, mm)", ""]
    by_noise = [
        (f"{key['noise']:g} px", numbers(frames, rows)) for key, rows in frames.conditions(("noise",))
    ]
    lines += _table("added noise", by_noise, spelled)
    least = min(frames.keys["noise"])
    lines += [f"By action, at {least:g} px of added noise", ""]
    lines += _table(
        "action",
        [
            (key["action"], numbers(frames, rows))
            for key, rows in frames.conditions(("action", "noise"))
            if key["noise"] == least
        ],
        spelled,
    )
    lost = next(lost_to(frames, rows) for key, rows in frames.conditions(("noise",)) if key["noise"] == least)
    if lost:
        told = ", ".join(f"{spelled(name)} {count}" for name, count in list(lost.items())[:8])
        lines.append(f"what pruned the true branch, at {least:g} px of added noise: {told}")
    broken = every["violations"]
    lines.append(
        f"{plural(broken['certified'], 'survivor')} certified: {broken['lengths']} break lengths, "
        f"{broken['ranges']} ranges"
    )
    return lines


def _table(name: str, told: list[tuple[str, dict[str, Any]]], spelled: Callable[[str], str]) -> list[str]:
    head = [
        name,
        "views",
        "without survivor",
        "truth within 10 mm",
        "its branch",
        "survivors, median",
        "95 %",
        "MPJPE best",
        "first",
        "random",
        "PA best",
        "first",
        "CPS first",
        "best",
    ]
    path = any("path" in one["cps_mm"] for _, one in told)
    rows = []
    for label, one in told:
        errors = one["error_mm"]
        rows.append(
            [
                label,
                one["frames"],
                _share(one["frames_without_survivor"] / one["frames"]),
                _share(one["retained_within_10mm"]),
                _share(one["retained_branch"]),
                _short(one["survivors"]["median"]),
                _short(one["survivors"]["p95"]),
                *(_short(errors["mpjpe"][role]["mean"]) for role in ("best", "first", "random")),
                *(_short(errors["pa"][role]["mean"]) for role in ("best", "first")),
                *(_short(one["cps_mm"][role]["aligned"]) for role in ("first", "best")),
                *(_followed(one) if path else ()),
            ]
        )
    return table_lines([*head, *(FOLLOWED_COLUMNS if path else ())], rows, spelled=spelled)


def _followed(one: Mapping[str, Any]) -> list[str]:
    """Return the cells of a sequence that was followed."""
    errors, limbs = one["error_mm"], one["limbs_right"]
    return [
        *(_short(errors[measure]["path"]["mean"]) for measure in ("mpjpe", "pa")),
        *(_share(limbs[role]) for role in ("path", "best", "first", "random")),
        _share(one["bridged"]),
    ]


def _share(value: float | None) -> str:
    return "-" if value is None else f"{value:.1%}"


def _short(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}" if abs(value) < 10 else f"{value:.0f}"


def _flat(told: Mapping[str, Any], before: str = "") -> dict[str, Any]:
    """Write nested numbers as one row, names joined by points."""
    row: dict[str, Any] = {}
    for name, value in told.items():
        if isinstance(value, Mapping):
            row |= _flat(value, f"{before}{name}.")
        elif value is None and name == "calibration":
            row |= {
                f"{before}{name}.{event}.{part}": None
                for event in ("branch", "within_35mm")
                for part in ("ece", "brier", "frames")
            }
        else:
            row[f"{before}{name}"] = value
    return row


def _line(cells: Any) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="").writerow("" if cell is None else cell for cell in cells)
    return text.getvalue()
