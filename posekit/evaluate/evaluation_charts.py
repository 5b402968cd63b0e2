"""The charts of an evaluation, as files beside its report."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from posekit.evaluate.condition import numbers, roles_of
from posekit.evaluate.evaluated_frames import EvaluatedFrames
from posekit.evaluate.evaluation import Evaluation
from posekit.evaluate.scores import THRESHOLDS_METRES, correct_poses, reliability
from posekit.geometry import Array


def plot_paths(report: Path) -> dict[str, Path]:
    """Return the names of the charts that a report can have beside it."""
    return {
        name: report.with_name(f"{report.stem}-{name}.png")
        for name in ("yaw", "survivors", "correct-poses", "reliability")
    }


def write_plots(report: Path, evaluation: Evaluation) -> list[Path]:
    """Draw what there is to draw: no yaw of a view as it is, no reliability of a ranking without probabilities.

    Raises
    ------
    ViewerError
        Where matplotlib is not installed.
    InputError
        Where a file cannot be written.
    """
    from posekit.viewer.plots import evaluation_plot as plots
    from posekit.viewer.plots import save

    frames, paths = evaluation.frames, plot_paths(report)
    drawn = {}
    if np.isfinite(frames.keys["yaw"]).any():
        drawn["yaw"] = plots.plot_yaw(*_over_yaw(frames))
    told = [(key["noise"], numbers(frames, rows)) for key, rows in frames.conditions(("noise",))]
    drawn["survivors"] = plots.plot_survivors(
        np.array([noise for noise, _ in told]),
        {
            label: np.array([one["survivors"][name] for _, one in told])
            for label, name in (("median", "median"), ("mean", "mean"), ("95 %", "p95"))
        },
        np.array([one["frames_without_survivor"] / one["frames"] for _, one in told]),
    )
    drawn["correct-poses"] = plots.plot_correct_poses(
        THRESHOLDS_METRES * 1000,
        {
            key["noise"]: {
                role: correct_poses(frames.error(role, "worst_pa")[rows]) for role in roles_of(frames)
            }
            for key, rows in frames.conditions(("noise",))
        },
    )
    stated = reliability(frames.measured.probability, frames.measured.first_branch)
    if stated is not None:
        drawn["reliability"] = plots.plot_reliability(
            stated.probability, stated.share, stated.frames, error=stated.error, event="the true branch"
        )
    for name, figure in drawn.items():
        save(figure, paths[name])
    return [paths[name] for name in drawn]


def _over_yaw(frames: EvaluatedFrames) -> tuple[Array, dict[float, dict[str, Array]]]:
    yaws = np.unique(frames.keys["yaw"])
    found: dict[float, dict[str, Array]] = {}
    for key, rows in frames.conditions(("noise", "yaw")):
        roles = found.setdefault(
            key["noise"], {role: np.full(len(yaws), np.nan) for role in roles_of(frames)}
        )
        at = int(np.searchsorted(yaws, key["yaw"]))
        for role, line in roles.items():
            values = frames.error(role, "mpjpe")[rows]
            if np.isfinite(values).any():
                line[at] = 1000 * np.nanmean(values)
    return yaws, found
