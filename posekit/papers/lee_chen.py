"""`posekit reproduce lee-chen`: the paper's tables, beside the print."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from posekit.formats.markdown import table_lines
from posekit.papers import lee_chen_printed as printed
from posekit.papers.lee_chen_spread import cell_spreads, final_spread_lines, setting_words, spread_lines
from posekit.papers.lee_chen_table2 import CameraEstimate
from posekit.papers.lee_chen_tables34 import (
    GROUPING_METRES,
    PAPER_TOLERANCE,
    WALK_GRIDS,
    Effort,
    WalkCounts,
    recover_sequence,
)
from posekit.papers.lee_chen_tangent import shoulder_lines
from posekit.papers.lee_chen_work import LeeChenWork
from posekit.recovery.result import result_of
from posekit.safe_io.writing import write_json, write_lines
from posekit.skeleton import JOINTS
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


def reproduce_lee_chen(
    folder: Path, *, pictures: bool = True, effort: Effort = "quick", work: LeeChenWork | None = None
) -> list[str]:
    """Write ``lee-chen.md`` and ``lee-chen.json`` into a folder, and the figures: Tables 2-4 and §4.2 beside the print.

    Parameters
    ----------
    folder : Path
        Must exist.
    pictures : bool
        Whether to draw the figures too.
    effort : {"quick", "fine"}
        Over how many settings of the walker Tables 3 and 4 are counted (`WALK_GRIDS`).
    work : LeeChenWork, optional
        What was calculated already; the effort's otherwise.

    Returns
    -------
    list of str
        The lines of the report.
    """
    work = work or LeeChenWork(grid=WALK_GRIDS[effort])
    found = list(work.counts.values())
    lines = [
        "# Lee & Chen 1985, reproduced",
        "",
        *_table2_lines(work.estimates, work.tables),
        *_settings_lines(work),
        *(line for counts in found for line in _levels_lines(counts, work.chosen)),
        *shoulder_lines(work.shoulders),
        *_frame1_lines(found, work.chosen),
        *(FIGURES_TEXT if pictures else ()),
        *_differences_lines(found, work.chosen),
    ]
    document = {
        "table2": {
            "estimates": [{**asdict(one), "position": one.position.tolist()} for one in work.estimates],
            "exact": {name: values.tolist() for name, values in work.tables.items()},
            "unit": "cm",
        },
        "settings": asdict(work.grid),
        "sequences": [_plain(counts, work.chosen) for counts in found],
    }
    if pictures:
        lines += [f"- {line}" for name in work.counts for line in _illustrate(folder, name, work)]
    write_lines(folder / "lee-chen.md", lines)
    write_json(folder / "lee-chen.json", document)
    return lines


def _illustrate(folder: Path, name: str, work: LeeChenWork) -> list[str]:
    """Draw the figures of a sequence, the printed counts beside its own; return what was left out, and why."""
    view, recovery = recover_sequence(name, work.setting)
    return list(
        illustrate(
            folder,
            f"lee-chen.{name}",
            result_of(recovery, unit=view.unit, explain=True),
            view,
            printed={"physical": printed.PRINTED_PHYSICAL[name], "motion": printed.PRINTED_MOTION[name]},
            printed_frames=[frame - 1 for frame in printed.PRINTED_FRAMES],
        )
    )


def _plain(counts: WalkCounts, chosen: int) -> dict[str, Any]:
    velocity, lean, phase = counts.settings[chosen].tolist()
    return {
        "name": counts.name,
        "velocity": velocity,
        "lean_degrees": lean,
        "phase": phase,
        "distance": float(counts.distance[chosen]),
        "frames": list(printed.PRINTED_FRAMES),
        "joint": list(JOINTS),
        "physical": counts.physical[chosen].tolist(),
        "motion": counts.motion[chosen].tolist(),
        "printed_physical": printed.PRINTED_PHYSICAL[counts.name],
        "printed_motion": printed.PRINTED_MOTION[counts.name],
        "groups_after_rules_1_2": int(counts.grouped[chosen]),
        "survivors_after_rules_1_5": int(counts.final[chosen, 1]),
        "groups_after_rules_1_5": int(counts.final[chosen, 0]),
        "truth_survives": bool(counts.truth[chosen]),
        "truth_survives_share": float(counts.truth.mean()),
        "spread": [one.plain() for one in cell_spreads(counts)],
    }


def _settings_lines(work: LeeChenWork) -> list[str]:
    grid = work.grid
    total = np.sum([counts.distance for counts in work.counts.values()], axis=0)
    cells = sum(counts.cells.shape[1] for counts in work.counts.values())
    return [
        "## Tables 3 and 4: over which settings",
        "",
        f"The paper prints neither the walker's speed nor its lean nor the phase of frame 1. Counted at {len(grid)} "
        f"settings: {len(grid.velocities)} speeds ({grid.velocities[0]:g} to {grid.velocities[-1]:g} leg lengths/s), "
        f"{len(grid.leans)} leans ({grid.leans[0]:g} to {grid.leans[-1]:g} degrees), {grid.phases} phases, each seen "
        f"by both cameras. Closest to all {cells} printed cells together, by the sum of |log2(here / print)|: "
        f"{setting_words(work.setting)}; the sum is {total[work.chosen]:.1f} (median of all {np.median(total):.1f}), "
        f"a factor of {2 ** (total[work.chosen] / cells):.2f} a cell. Nothing was adjusted to what comes out there.",
        "",
    ]


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


def _levels_lines(counts: WalkCounts, chosen: int) -> list[str]:
    head = ["level", "joint"]
    for column in ("physical", "with Rules 1-2"):
        head += [f"{column}, frame {frame}: print / here" for frame in printed.PRINTED_FRAMES]
    rows = []
    for level, joint in enumerate(JOINTS):
        row: list[object] = [level, joint]
        for theirs, ours in (
            (printed.PRINTED_PHYSICAL[counts.name], counts.physical[chosen]),
            (printed.PRINTED_MOTION[counts.name], counts.motion[chosen]),
        ):
            row += [f"{theirs[k][level]} / {ours[k, level]}" for k in range(len(printed.PRINTED_FRAMES))]
        rows.append(row)
    return [
        f"## {TABLE_TITLES[counts.name]}: survivors per level",
        "",
        *spread_lines(counts),
        "At the one setting that is closest to all cells of both tables and of §4.2 together:",
        "",
        *table_lines(head, rows),
    ]


def _frame1_lines(found: Sequence[WalkCounts], chosen: int) -> list[str]:
    return [
        "## Frame 1 after grouping and Rules 3-5 (§4.2)",
        "",
        f"Groups are of postures with every joint within {GROUPING_METRES * 100:g} cm of the group's representative.",
        "",
        *final_spread_lines(found, chosen),
    ]


def _differences_lines(found: Sequence[WalkCounts], chosen: int) -> list[str]:
    return [
        "## Where this differs from the paper",
        "",
        "- The joints of SEQ1 and SEQ2 are not printed. The walker here is Boulic, Thalmann & Thalmann's (1990) on the "
        "body of Table A.1, not Cutting's (1978), whose constants the paper does not give. So the counts can be "
        "compared in size, not digit for digit.",
        "- The torso of Table A.1 is not flat, and its shoulders are put in front of the line from neck to pelvis; the "
        "pelvis is therefore not always square to its ray, as it seems to have been in the paper.",
        f"- The paper gives no tolerance for its distances; here it is {PAPER_TOLERANCE.rigid * 100:g} cm. It gives no "
        "thresholds for its rules and no size for its groups: see `WalkingThresholds` and `--group`.",
        "- Collision bodies are capsules of posekit's own figure; the paper's are not described.",
        *(
            f"- {one.name.upper()}: the sum of |log2(here / print)| over its {one.cells.shape[1]} cells is "
            f"{one.distance[chosen]:.1f} at the closest setting."
            for one in found
        ),
        "",
    ]


def _vector(values: Any) -> str:
    return f"({', '.join(f'{value + 0.0:.3f}' for value in values)})"
