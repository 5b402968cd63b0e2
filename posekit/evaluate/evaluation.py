"""Evaluate a motion or a view: every piece recovered, in this process or in several."""

from __future__ import annotations

import os
import pickle
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, contextmanager
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from typing import Any

from posekit.errors import InputError
from posekit.evaluate.evaluated_frames import EvaluatedFrames
from posekit.evaluate.frame_sampling import FrameSampling
from posekit.evaluate.material import Material, of_capture, of_view
from posekit.evaluate.method import Method
from posekit.evaluate.sweep import Sweep
from posekit.evaluate.work import Measured, Work, measure
from posekit.formats.own import View
from posekit.synthesis import Capture

Progress = Callable[[int], AbstractContextManager[Callable[[int], None]]]
"""From the number of frames to a context manager of the function that is called with how many were done."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Evaluation:
    """What was found.

    Parameters
    ----------
    frames : EvaluatedFrames
        Every frame at every level of noise.
    material : Material
        What was evaluated, and what was left out.
    settings : mapping
        Everything that decided the numbers, of plain values.
    """

    frames: EvaluatedFrames
    material: Material
    settings: dict[str, Any]


def evaluate(
    given: Capture | View,
    *,
    sampling: FrameSampling | None = None,
    sweep: Sweep | None = None,
    method: Method | None = None,
    jobs: int = 1,
    source: str = "",
    progress: Progress | None = None,
) -> Evaluation:
    """Evaluate recovery where the truth is known.

    Parameters
    ----------
    given : Capture or View
        Motion, seen through virtual cameras; or a view with truth, as it is.
    sampling : FrameSampling, optional
        Which frames of a motion.
    sweep : Sweep, optional
        The cameras of a motion.
    method : Method, optional
        How frames are recovered and ranked, and under which noise.
    jobs : int
        Processes, at most one a core. With more than one, what the method holds must be found by its name (no lambdas),
        and a script that calls this needs ``if __name__ == "__main__"``.
    source : str, optional
        What to call a view.
    progress : callable, optional
        Given the number of frames, a context manager of the function that is called with how many were done since the
        last call.

    Raises
    ------
    InputError
        Where nothing can be evaluated: no frame can be recovered, or the options do not go together.
    """
    if jobs < 1:
        raise InputError(f"--jobs: {jobs}; expected one or more processes")
    sampling, sweep, method = sampling or FrameSampling(), sweep or Sweep(), method or Method()
    if isinstance(given, View):
        material = of_view(given, method, source or "view")
        settings = {"source": source or "view", **method.document()}
    else:
        material = of_capture(given, sampling, sweep, method)
        settings = {
            "source": given.source,
            **asdict(sampling),
            **asdict(sweep),
            **method.document(),
            "root": method.root or "given",
            "lengths": "each clip's medians",
            "shank_px": round(material.shank, 3),
        }
    found: list[Measured | None] = [None] * len(material.works)
    with (progress or _silent)(material.frames) as done:
        for k, measured in _measured(material.works, method, jobs):
            found[k] = measured
            done(len(material.works[k]))
    frames = EvaluatedFrames.of(material.works, [one for one in found if one is not None], material.actions)
    if not frames.measured.survivors.any() and all(frames.measured.reason):
        raise InputError(f"{settings['source']}: no frame can be recovered: {frames.measured.reason[0]}")
    return Evaluation(frames=frames, material=material, settings=settings)


def _measured(works: Sequence[Work], method: Method, jobs: int) -> Iterator[tuple[int, Measured]]:
    if jobs == 1 or len(works) == 1:
        yield from ((k, measure(work, method)) for k, work in enumerate(works))
        return
    try:
        pickle.dumps(method)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise InputError(
            f"--jobs: the method cannot be sent to other processes ({error}); expected functions that a module "
            "defines; take one job"
        ) from None
    # spawn: a fork after OpenMP was used hangs the child.
    with ProcessPoolExecutor(min(jobs, len(works), _cores()), mp_context=get_context("spawn")) as pool:
        places: dict[Future[Measured], int] = {
            pool.submit(measure, work, method): k for k, work in enumerate(works)
        }
        try:
            for done in as_completed(places):
                yield places[done], done.result()
        except BrokenProcessPool:
            raise InputError(
                "--jobs: a process ended before it was done; expected memory for all; take fewer jobs"
            ) from None
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def _silent(_: int) -> Iterator[Callable[[int], None]]:
    yield lambda done: None
