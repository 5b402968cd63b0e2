"""Run the corpus in one environment, and keep what came of it."""

from __future__ import annotations

import json
import os
import subprocess
import time
from collections import Counter
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

from benchmarks.unchanged.canonical import files_of, text_of
from benchmarks.unchanged.corpus import CASE_REFERENCE, INPUTS_READ, Case, cases
from benchmarks.unchanged.inputs import write_inputs

CALLS_SCRIPT = Path(__file__).with_name("calls.py")
LIMIT_SECONDS = 600.0


def record(
    folder: Path,
    *,
    posekit: Path,
    python: Path,
    pythonpath: Path | None,
    data: Path | None,
    only: str,
    jobs: int,
) -> None:
    """Run the corpus, and write a record a case into `folder`/records.

    Parameters
    ----------
    folder : Path
        A new folder, outside of any checkout.
    posekit, python : Path
        The executables of the environment that is recorded.
    pythonpath : Path or None
        Another checkout that goes before what the environment has installed.
    data : Path or None
        The folder of real recordings.
    only : str
        A glob of cases; what they read is run too.
    jobs : int
        Cases at a time.
    """
    folder = folder.resolve()
    work, records = folder / "work", folder / "records"
    work.mkdir(parents=True)
    records.mkdir()
    data = data.resolve() if data else None
    environment = {
        name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "POSEKIT"))
    }
    environment |= {"COLUMNS": "100", "TERM": "dumb", "NO_COLOR": "1", "LC_ALL": "C.UTF-8", "TZ": "UTC"}
    if pythonpath is not None:
        environment["PYTHONPATH"] = str(pythonpath.resolve())
    programs = {
        "posekit": [str(posekit.absolute())],
        "python": [str(python.absolute()), "-P", str(CALLS_SCRIPT)],
    }
    where = [*programs["python"][:2], "-c", "import posekit; print(posekit.__file__)"]
    code, said = _outcome(where, folder, environment)
    print(f"records {said['stdout'].strip()}" if code == 0 else said["stderr"], flush=True)
    corpus = cases(data=data is not None, only=only)
    seconds: dict[str, float] = {}
    exits: dict[str, list[int]] = {}

    def run(case: Case, before: list[Future[None]]) -> None:
        for one in before:
            one.result()
        (work / case.name).mkdir()
        start = time.monotonic()
        written = _run(case, work, programs, environment, data)
        seconds[case.name] = round(time.monotonic() - start, 2)
        exits[case.name] = [one["exit"] for one in written["runs"]]
        (records / f"{case.name}.json").write_text(json.dumps(written))

    def inputs(before: list[Future[None]]) -> None:
        for one in before:
            one.result()
        write_inputs(work / "inputs", work, data)

    done: dict[str, Future[None]] = {}
    start = time.monotonic()
    with ThreadPoolExecutor(jobs) as pool:  # first in, first out: what a case reads has begun before it
        for case in corpus:
            if "inputs" in case.reads and "inputs" not in done:
                done["inputs"] = pool.submit(inputs, [done[name] for name in sorted(INPUTS_READ)])
            done[case.name] = pool.submit(run, case, [done[name] for name in sorted(case.reads - {"data"})])
        for one in done.values():
            one.result()
    total = round(time.monotonic() - start, 1)
    (folder / "times.json").write_text(json.dumps({"total": total, "cases": seconds}, indent=1))
    kinds = Counter(case.kind for case in corpus)
    print(
        f"{len(corpus)} cases in {total} s: {', '.join(f'{kind} {count}' for kind, count in kinds.items())}"
    )
    refused = [
        name
        for name, codes in exits.items()
        if not name.startswith("hostile") and not set(codes) <= ({0} if name.startswith("python") else {0, 1})
    ]
    print(f"refused, though not hostile: {', '.join(sorted(refused)) or 'none'}")


def _run(
    case: Case, work: Path, programs: dict[str, list[str]], environment: dict[str, str], data: Path | None
) -> dict[str, Any]:
    places = {str(work): "<work>"} | ({str(data): "<data>"} if data else {})

    def resolved(word: str) -> str:
        return CASE_REFERENCE.sub(lambda name: str(data) if name[1] == "data" else f"../{name[1]}", word)

    runs: list[dict[str, Any]] = []
    for program, *words in case.commands:
        command = [*programs[program], *map(resolved, words)]
        code, said = _outcome(command, work / case.name, environment)
        outputs = {stream: text_of(text, places) for stream, text in said.items()}
        runs.append({"argv": [program, *words], "exit": code} | outputs)
    return {
        "name": case.name,
        "refined": case.refined,
        "runs": runs,
        "files": files_of(work / case.name, places),
    }


def _outcome(command: list[str], folder: Path, environment: dict[str, str]) -> tuple[int, dict[str, str]]:
    """Return the exit code and the two streams of a command; -1000 where it did not end in time."""
    try:
        ran = subprocess.run(
            command,
            cwd=folder,
            env=environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=LIMIT_SECONDS,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return -1000, {"stdout": "", "stderr": f"did not end within {LIMIT_SECONDS:g} seconds"}
    return ran.returncode, {"stdout": ran.stdout, "stderr": ran.stderr}
