"""The committed ratios, and a word where one fell: ratios alone, so that another machine's speed is no failure."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

BASELINE_SCHEMA: Final = "posekit.benchmarks/1"
BASELINE_PATH: Final = Path(__file__).resolve().parents[1] / "baseline.json"

RATIO_TOLERANCE: Final = 0.3
"""By how much of itself a ratio may fall before it is said: shared machines differ by so much between runs."""


def write_baseline(path: Path, ratios: Mapping[str, float], machine: Mapping[str, Any]) -> None:
    """Write the ratios of a run, with what they ran on."""
    document = {
        "schema": BASELINE_SCHEMA,
        "machine": dict(machine),
        "ratios": {name: float(f"{ratio:.3g}") for name, ratio in sorted(ratios.items())},
    }
    path.write_text(json.dumps(document, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")


def read_baseline(path: Path) -> dict[str, float]:
    """Read the ratios of a baseline.

    Raises
    ------
    SystemExit
        Where there is none, or it is none.
    """
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise SystemExit(f"{path}: no baseline ({error}); write one with --write-baseline") from error
    ratios = document.get("ratios") if isinstance(document, dict) else None
    if not isinstance(ratios, dict) or document.get("schema") != BASELINE_SCHEMA:
        raise SystemExit(f"{path}: no baseline of {BASELINE_SCHEMA}; write one with --write-baseline")
    return {str(name): float(ratio) for name, ratio in ratios.items()}


def warnings_of(
    ratios: Mapping[str, float], baseline: Mapping[str, float], tolerance: float = RATIO_TOLERANCE
) -> list[str]:
    """Say which ratios fell by more than the tolerance, or are no numbers; what was not measured is passed over.

    Parameters
    ----------
    ratios, baseline : mapping of str to float
        Larger is better.
    tolerance : float
        As a share of the baseline's ratio.
    """
    fallen = []
    for name, before in baseline.items():
        now = ratios.get(name)
        if now is None:
            continue
        if not math.isfinite(now) or now < before * (1 - tolerance):
            fallen.append(f"{name}: {now:.3g}, was {before:.3g} ({now / before - 1:+.0%})")
    return fallen
