"""One report of all comparisons: tables, charts, ratios of one run, the machine and the versions.

    python -m benchmarks [-o bench-results] [--quick] [--only engines,views] [--gate [--strict]]

Times are of the processor, least of several turns; ratios are of one run. With --gate ratios that fell below
`benchmarks/baseline.json` are said (exit 0; 1 with --strict). What is not installed is left out, and said; the extra
`bench` has everything.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from pathlib import Path

from benchmarks.comparison import engines, gate, growth, process, trees, validation
from benchmarks.comparison.charts import draw
from benchmarks.comparison.measure import QUICK_SIZES, TINY_SIZES, Section, Sizes, machine
from posekit.formats.markdown import table_lines

SECTIONS: dict[str, Callable[[Sizes], Section]] = {
    "views": trees.section,
    "growth": growth.section,
    "engines": engines.section,
    "validation": validation.section,
    "start-up": process.start_up,
    "memory": process.memory,
}


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "-o", "--output", type=Path, default=Path("bench-results"), help="folder of the report"
    )
    parser.add_argument("--only", default=",".join(SECTIONS), help=f"some of {', '.join(SECTIONS)}")
    parser.add_argument("--suffix", choices=(".svg", ".png"), default=".svg", help="kind of the charts")
    size = parser.add_mutually_exclusive_group()
    size.add_argument("--quick", action="store_true", help="a minute, for the gate")
    size.add_argument(
        "--tiny", action="store_true", help="seconds, to see that it runs; its numbers mean nothing"
    )
    parser.add_argument("--gate", action="store_true", help="compare with the baseline")
    parser.add_argument("--strict", action="store_true", help="exit 1 where a ratio fell")
    parser.add_argument("--baseline", type=Path, default=gate.BASELINE_PATH)
    parser.add_argument(
        "--tolerance", type=float, default=gate.RATIO_TOLERANCE, help="share by which a ratio may fall"
    )
    parser.add_argument("--write-baseline", action="store_true", help="make this run the baseline")
    given = parser.parse_args(arguments)
    names = given.only.split(",")
    unknown = [name for name in names if name not in SECTIONS]
    if unknown:
        parser.error(f"--only: {unknown[0]!r}; expected some of {', '.join(SECTIONS)}")
    if not 0 <= given.tolerance <= 1:
        parser.error(f"--tolerance: {given.tolerance!r}; expected a share, 0 to 1")
    baseline = gate.read_baseline(given.baseline) if given.gate else {}
    sizes = TINY_SIZES if given.tiny else QUICK_SIZES if given.quick else Sizes()
    about = machine()
    sections = []
    for name in names:
        print(f"== {name}", file=sys.stderr, flush=True)
        sections.append(SECTIONS[name](sizes))
    about["load at the end"] = machine()["load"]
    ratios = {name: ratio for section in sections for name, ratio in section.ratios.items()}
    fallen = gate.warnings_of(ratios, baseline, given.tolerance)
    given.output.mkdir(parents=True, exist_ok=True)
    pictures = {
        section.title: [draw(chart, given.output, given.suffix) for chart in section.charts]
        for section in sections
    }
    text = "\n".join(report_lines(sections, pictures, about, fallen if given.gate else None)) + "\n"
    (given.output / "report.md").write_text(text, encoding="utf-8")
    (given.output / "ratios.json").write_text(
        json.dumps({"machine": about, "ratios": ratios}, indent=2, ensure_ascii=False) + "\n",
        encoding="utf-8",
    )
    print(text, end="")
    if given.write_baseline:
        gate.write_baseline(given.baseline, ratios, about)
    for line in fallen:
        print(f"warning: a ratio fell: {line}", file=sys.stderr)
    return 1 if fallen and given.strict else 0


def report_lines(
    sections: list[Section],
    pictures: dict[str, list[str]],
    about: dict[str, object],
    fallen: list[str] | None,
) -> list[str]:
    """Write the report as Markdown."""
    lines = ["# Benchmarks", ""]
    versions = about["versions"]
    said = (
        ", ".join(f"{name} {number}" for name, number in versions.items())
        if isinstance(versions, dict)
        else ""
    )
    lines += [
        f"{about['processor']}, {about['cores']} cores, {about['system']}, Python {about['python']}; {said}. "
        f"Load at the start {about['load']}, at the end {about['load at the end']}. "
        "Times are of the processor, the least of several turns; ratios are of one run.",
    ]
    for section in sections:
        lines += ["", f"## {section.title}", "", section.text, "", *table_lines(section.head, section.rows)]
        lines += ["", *(f"![{section.title}]({name})" for name in pictures.get(section.title, []))]
        lines += [f"Left out: {reason}." for reason in section.left_out]
    if fallen is not None:
        lines += ["", "## Against the baseline", ""]
        lines += [f"- fell: {line}" for line in fallen] or ["No ratio fell."]
    return lines


if __name__ == "__main__":
    raise SystemExit(main())
