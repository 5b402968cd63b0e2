"""What `posekit validate` writes, and when it fails."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from posekit.display.plural import plural
from posekit.errors import InputError

if TYPE_CHECKING:
    from posekit.formats.own import ValidationReport
    from posekit.formats.own.report_clips import ClipVerdict
    from posekit.validation.judging import Detail

PAGE_SUFFIX: Final = ".html"
CLIPS_WORD: Final = "clips"


@dataclass(frozen=True, kw_only=True)
class ValidateOutput:
    """Files and folders that are asked for.

    Parameters
    ----------
    report : Path, optional
        A report, or by its suffix ``.html`` the page of it.
    page : Path, optional
        The page beside a report.
    timeline : Path, optional
        A picture of the worst clips, or a folder with one of each.
    keep : Path, optional
        A folder for the clips that pass.
    keep_spans : float, optional
        Seconds: of other clips the longest good span is kept too where it takes as long.
    """

    report: Path | None = None
    page: Path | None = None
    timeline: Path | None = None
    keep: Path | None = None
    keep_spans: float | None = None

    @property
    def detail(self) -> Detail:
        """What the report needs of every posture: see `posekit.validation.WantedDetail`."""
        suffix = "" if self.report is None else self.report.suffix.lower()
        return (
            "findings" if suffix == ".json" else "margins" if suffix in (".csv", ".parquet") else "verdicts"
        )

    @property
    def _of_clips(self) -> str:
        return "--timeline" if self.keep is None else "--keep"

    def check(self, repair: Path | None = None) -> None:
        """Refuse names that cannot be written before the work is done; `repair` is where repaired motion goes."""
        from posekit.formats.own.npz import suffix
        from posekit.formats.own.report_file import REPORT_SUFFIXES
        from posekit.safe_io import extra
        from posekit.safe_io.writing import check_folder, check_target

        if self.report is not None:
            if suffix(self.report, *REPORT_SUFFIXES, PAGE_SUFFIX) == ".parquet":
                extra("pyarrow", "parquet", "writing Parquet")
            check_target(self.report)
        if self.page is not None:
            suffix(self.page, PAGE_SUFFIX)
            check_target(self.page)
        if self.timeline is not None:
            from posekit.viewer.plots.plot_file import PLOT_FORMATS, drawing

            with drawing():  # matplotlib is there
                pass
            if self.timeline.suffix:
                suffix(self.timeline, *PLOT_FORMATS)
                check_target(self.timeline)
            else:
                check_folder(self.timeline)
        if self.keep is not None:
            from posekit.validation.keep import check_keep_folder

            written = (self.report, self.page, self.timeline, repair)
            check_keep_folder(self.keep, *(path for path in written if path is not None))
        elif self.keep_spans is not None:
            raise InputError("--keep-spans: there is no --keep; name the folder that spans are written to")
        if self.keep_spans is not None and not 0 <= self.keep_spans < math.inf:
            raise InputError(f"--keep-spans: {self.keep_spans}; expected seconds, as 2")

    def write(self, report: ValidationReport) -> Iterator[str]:
        """Write all of them, and say of each that it is written.

        Raises
        ------
        InputError
            Where something cannot be written, or is of clips and there are none.
        """
        from posekit.formats import own as files

        clips = () if self.timeline is None and self.keep is None else clips_of_report(report, self._of_clips)
        pages = [path for path in (self.report, self.page) if path is not None]
        for path in pages:
            if path.suffix.lower() == PAGE_SUFFIX:
                from posekit.viewer.report_page import write_report_page

                write_report_page(path, report)
            else:
                files.write_report(path, report)
            yield f"written: {path}"
        if self.timeline is not None:
            from posekit.viewer.plots.timeline_plot import write_timelines

            count = write_timelines(self.timeline, clips)
            yield f"written: {self.timeline}, {count} of {plural(len(clips), 'clip')}"
        if self.keep is not None and report.frames is not None:
            from posekit.validation.keep import keep_clips

            kept = keep_clips(self.keep, clips, report.frames, spans=self.keep_spans)
            yield f"written: {self.keep}, {kept.said}"


@dataclass(frozen=True, kw_only=True)
class FailOver:
    """How much may be not valid.

    Parameters
    ----------
    number : float
        How many, or a share of 1.
    share : bool
        Whether it is a share.
    clips : bool
        Whether clips are counted, in place of postures.
    """

    number: float
    share: bool
    clips: bool

    def exceeded(self, report: ValidationReport) -> bool:
        """Whether a report has more than that."""
        if self.clips:
            verdicts = [clip.verdict for clip in clips_of_report(report, "--fail-over")]
            return self.exceeded_by(sum(verdict != "valid" for verdict in verdicts), len(verdicts))
        return self.exceeded_by(len(report) - report.summary["valid"], len(report))

    def exceeded_by_records(self, records: Sequence[Mapping[str, Any]]) -> bool:
        """Whether what a repair wrote has more than that: of each clip a record, with its frames and the valid ones."""
        bad = [int(record["frames"]) - int(record["valid"]) for record in records]
        if self.clips:
            return self.exceeded_by(sum(map(bool, bad)), len(bad))
        return self.exceeded_by(sum(bad), sum(int(record["frames"]) for record in records))

    def exceeded_by(self, bad: int, total: int) -> bool:
        """Whether so many that are not valid are more than that, of so many in all."""
        return bad > self.number * (total if self.share else 1)


def parse_fail_over(text: str) -> FailOver:
    """Read how much may be not valid: ``10``, ``1%``, ``3 clips``, ``2% clips``.

    Raises
    ------
    InputError
        Where it is none of these.
    """
    counted = text.strip()
    clips = counted.endswith(CLIPS_WORD)
    counted = counted.removesuffix(CLIPS_WORD).strip()
    share = counted.endswith("%")
    try:
        number = float(counted.removesuffix("%"))
    except ValueError:
        number = math.nan
    if not 0 <= number < math.inf or (share and number > 100) or (not share and number != int(number)):
        raise InputError(
            f"--fail-over: {text!r}; expected a number of postures, as 10, or a share, as 1%, of clips: '2% clips'"
        )
    return FailOver(number=number / 100 if share else number, share=share, clips=clips)


def clips_of_report(report: ValidationReport, option: str) -> tuple[ClipVerdict, ...]:
    """Return the verdicts on clips, or refuse an option that is about clips where there are none."""
    if not report.clips:
        raise InputError(
            f"{option}: what was judged has no frames in time; expected motion: one posture a frame"
        )
    return tuple(report.clips)
