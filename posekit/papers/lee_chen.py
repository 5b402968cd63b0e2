"""`posekit reproduce lee-chen`: the paper's tables, beside the print."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from posekit.display.plural import plural
from posekit.formats.markdown import table_lines
from posekit.papers import lee_chen_printed as printed
from posekit.papers.lee_chen_table2 import CameraEstimate, camera_estimates, exact_tables
from posekit.papers.lee_chen_tables34 import (
    GROUPING_METRES,
    N_PHASES,
    PAPER_TOLERANCE,
    Sequence1985,
    closest,
    recover_sequence,
)
from posekit.recovery.result import result_of
from posekit.safe_io.writing import write_json, write_lines
from posekit.skeleton import JOINTS
from posekit.synthesis.walker_scene import SEQ_VELOCITY
from posekit.viewer.illustrate import illustrate

FIGURES_TEXT = (
    "## The figures",
    "",
    "For SEQ1 and SEQ2 each, beside this file: `lee-chen.SEQ.image.png` (as Fig. A.1), `.projections.png` (as Figs. 6 "
    "and 8: one survivor of each group of frame 1), `.superposed.png` (these as in Fig. 7, joints of several solutions "
    "labelled), `.tree.png` (as Fig. 4), `.levels.png` (Tables 3 and 4, hollow marks are the print), `.scene.png` and "
    "`.page.html`.",
    "",
)
TABLE_TITLES = {"seq1": "Table 3 (SEQ1)", "seq2": "Table 4 (SEQ2)"}


def reproduce_lee_chen(folder: Path, *, pictures: bool = True) -> list[str]:
    """Write ``lee-chen.md`` and ``lee-chen.json`` into a folder, and the figures: Tables 2-4 and §4.2 beside the print.

    Parameters
    ----------
    folder : Path
        Must exist.
    pictures : bool
        Whether to draw the figures too.

    Returns
    -------
    list of str
        The lines of the report.
    """
    estimates, tables = camera_estimates(), exact_tables()
    found = [closest(name, SEQ_VELOCITY) for name in ("seq1", "seq2")]
    lines = [
        "# Lee & Chen 1985, reproduced",
        "",
        *_table2_lines(estimates, tables),
        *(line for sequence in found for line in _levels_lines(sequence)),
        *_frame1_lines(found),
        *(FIGURES_TEXT if pictures else ()),
        *_differences_lines(found),
    ]
    document = {
        "table2": {
            "estimates": [{**asdict(one), "position": one.position.tolist()} for one in estimates],
            "exact": {name: values.tolist() for name, values in tables.items()},
            "unit": "cm",
        },
        "sequences": [_plain(sequence) for sequence in found],
    }
    if pictures:
        lines += [f"- {line}" for sequence in found for line in _illustrate(folder, sequence)]
    write_lines(folder / "lee-chen.md", lines)
    write_json(folder / "lee-chen.json", document)
    return lines


def _illustrate(folder: Path, sequence: Sequence1985) -> list[str]:
    """Draw the figures of a sequence, the printed counts beside its own; return what was left out, and why."""
    view, recovery = recover_sequence(sequence)
    return list(
        illustrate(
            folder,
            f"lee-chen.{sequence.name}",
            result_of(recovery, unit=view.unit, explain=True),
            view,
            printed={
                "physical": printed.PRINTED_PHYSICAL[sequence.name],
                "motion": printed.PRINTED_MOTION[sequence.name],
            },
            printed_frames=[frame - 1 for frame in printed.PRINTED_FRAMES],
        )
    )


def _plain(sequence: Sequence1985) -> dict[str, Any]:
    return {
        "name": sequence.name,
        "velocity": sequence.velocity,
        "phase": sequence.phase,
        "distance": sequence.distance,
        "frames": list(printed.PRINTED_FRAMES),
        "joint": list(JOINTS),
        "physical": sequence.physical.tolist(),
        "motion": sequence.motion.tolist(),
        "printed_physical": printed.PRINTED_PHYSICAL[sequence.name],
        "printed_motion": printed.PRINTED_MOTION[sequence.name],
        "groups_after_rules_1_2": sequence.groups_after_rules_1_2,
        "survivors_after_rules_1_5": sequence.final[0],
        "groups_after_rules_1_5": sequence.final[1],
        "truth_survives": sequence.truth_survives,
    }


def _table2_lines(estimates: Sequence[CameraEstimate], tables: dict[str, Any]) -> list[str]:
    rows = [
        ("the paper prints (Table 2c)", "5.000", _vector(printed.PRINTED_POSITION), "0.016", ""),
        *(
            (one.way, f"{one.f:.3f}", _vector(one.position), f"{one.off:.3g}", one.misfit or "")
            for one in estimates
        ),
    ]
    gaps = [
        (name, f"{np.abs(tables[key] - print_).max():.5f}")
        for name, key, print_ in (
            ("(a) transformation matrix [T]", "T", printed.T),
            ("(b) rotation matrix [R]", "R", printed.R),
            ("(c) camera position", "position", printed.PRINTED_POSITION),
            ("(d) head points, camera frame", "head", printed.PRINTED_HEAD),
        )
    ]
    return [
        "## Table 2: the camera from the head, frame 1 of SEQ1",
        "",
        "Centimetres; the camera stands at (400, 0, 0). Image points are Table A.2(b), head points Table A.2(a) with "
        "the right eye's x corrected to -31.168.",
        "",
        *table_lines(("from", "f", "camera position", "off by", "point named as misfit"), rows),
        "The whole of Table 2 from exact projections, largest difference from the print:",
        "",
        *table_lines(("part", "largest difference"), gaps),
    ]


def _levels_lines(sequence: Sequence1985) -> list[str]:
    head = ["level", "joint"]
    for column in ("physical", "with Rules 1-2"):
        head += [f"{column}, frame {frame}: print / here" for frame in printed.PRINTED_FRAMES]
    rows = []
    for level, joint in enumerate(JOINTS):
        row: list[object] = [level, joint]
        for theirs, ours in (
            (printed.PRINTED_PHYSICAL[sequence.name], sequence.physical),
            (printed.PRINTED_MOTION[sequence.name], sequence.motion),
        ):
            row += [f"{theirs[k][level]} / {ours[k, level]}" for k in range(len(printed.PRINTED_FRAMES))]
        rows.append(row)
    return [
        f"## {TABLE_TITLES[sequence.name]}: survivors per level",
        "",
        f"Walker at {sequence.velocity:g} leg lengths/s; of {N_PHASES} phases of frame 1 searched, "
        f"{sequence.phase:.2f} of a cycle comes closest to the print among those at which §4.2 comes out as printed.",
        "",
        *table_lines(head, rows),
    ]


def _frame1_lines(found: Sequence[Sequence1985]) -> list[str]:
    rows = []
    for sequence in found:
        rules_12, grouped, final = printed.PRINTED_FINAL[sequence.name]
        rows.append(
            (
                sequence.name.upper(),
                f"{rules_12} / {sequence.motion[0, -1]}",
                f"{grouped} / {sequence.groups_after_rules_1_2}",
                f"{final} / {sequence.final[1]} ({plural(sequence.final[0], 'survivor')})",
                "yes" if sequence.truth_survives else "no",
            )
        )
    head = (
        "",
        "Rules 1-2: print / here",
        "groups: print / here",
        "Rules 3-5, groups: print / here",
        "input among them",
    )
    return [
        "## Frame 1 after grouping and Rules 3-5 (§4.2)",
        "",
        f"Groups are of postures with every joint within {GROUPING_METRES * 100:g} cm of the group's representative. "
        "The phases were chosen among those at which Rules 3-5 leave as many groups as the paper says, so that column "
        "agrees by construction; the groups before it do not agree, because the paper's are finer.",
        "",
        *table_lines(head, rows),
    ]


def _differences_lines(found: Sequence[Sequence1985]) -> list[str]:
    return [
        "## Where this differs from the paper",
        "",
        "- The joints of SEQ1 and SEQ2 are not printed. The walker here is Boulic, Thalmann & Thalmann's (1990) on the "
        "body of Table A.1, not Cutting's (1978), whose constants the paper does not give; velocity and phase are not "
        "given either. So the counts can be compared in size, not digit for digit.",
        "- The torso of Table A.1 is not flat, and its shoulders are put in front of the line from neck to pelvis; the "
        "pelvis is therefore not always square to its ray, as it seems to have been in the paper.",
        f"- The paper gives no tolerance for its distances; here it is {PAPER_TOLERANCE.rigid * 100:g} cm. It gives no "
        "thresholds for its rules and no size for its groups: see `WalkingThresholds` and `--group`.",
        "- Collision bodies are capsules of posekit's own figure; the paper's are not described.",
        *(
            f"- {one.name.upper()}: the sum of |log2(here / print)| over the {2 * one.physical.size} cells is "
            f"{one.distance:.1f}, {one.distance / (2 * one.physical.size):.2f} a cell: a factor of "
            f"{2 ** (one.distance / (2 * one.physical.size)):.2f} on average."
            for one in found
        ),
        "",
    ]


def _vector(values: Any) -> str:
    return f"({', '.join(f'{value + 0.0:.3f}' for value in values)})"
