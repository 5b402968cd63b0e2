"""`batch`: process every file of an archive of views, key points and motion once, on local cores or on Ray.

The output of a view or of key points is a recovered result; the output of a motion is a validation report. Each input
has one output file, which is written completely or not at all, and one line in `MANIFEST` with the checksums of input
and output. If a run stops, the next run therefore computes only the remaining inputs. An input is computed again if it
or the settings have changed.
"""

from __future__ import annotations

import hashlib
import json
import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, fields
from os import PathLike
from pathlib import Path
from typing import Any, Final

from posekit.errors import PosekitError, one_line, refusal, shown
from posekit.geometry import Record
from posekit.inputs import are_paths, files_of, names_below
from posekit.motion import Motion
from posekit.settings import RecoverSettings, Settings, ValidateSettings
from posekit.validators.report import plural

#: Name of the table of inputs in the output folder. Each line is a JSON object; the last line of an input is valid.
MANIFEST: Final = "manifest.jsonl"
#: Number of inputs submitted per process: enough that no process waits.
IN_FLIGHT: Final = 2

#: ``input``, ``key`` (checksum of input and settings), ``output``, ``sha256`` of the output, ``kind``, ``summary``; a
#: failed input has ``error`` in place of the last four entries.
Entry = dict[str, Any]


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class BatchRun(Record):
    """Outcome of a batch run.

    Parameters
    ----------
    done : tuple of Entry
        Inputs that were computed.
    kept : tuple of Entry
        Inputs whose output already existed.
    failed : tuple of Entry
        Inputs that cannot be processed, each with its error.
    """

    done: tuple[Entry, ...]
    kept: tuple[Entry, ...]
    failed: tuple[Entry, ...]

    def _facts(self) -> list[str]:
        return [f"{len(self.done)} done", f"{len(self.kept)} kept", f"{len(self.failed)} failed"]


def batch(
    inputs: Any,
    output: str | PathLike[str],
    settings: Settings | None = None,
    *,
    jobs: int = 1,
    ray: str = "",
    say: Callable[[str], None] | None = None,
    camera: str | PathLike[str] | None = None,
    person: str = "",
    layout: str = "",
    rate: float | None = None,
) -> BatchRun:
    """Recover views and key points, and validate motion, of many files.

    Parameters
    ----------
    inputs : path or sequence of path
        Files, folders and patterns; a file that is named several times is processed once.
    output : path
        Folder of results (``.npz``) and reports (``.json``). If the folder holds the output of a stopped run, the run
        is continued.
    settings : RecoverSettings or ValidateSettings, optional
        Motion is validated with the fields that `RecoverSettings` and `ValidateSettings` share.
    jobs : int
        Number of processes; 1 uses the calling process.
    ray : str
        Address of a Ray cluster, or ``local`` for a cluster on this machine (extra ``ray``).
    say : callable, optional
        Function that is called with one line of text for each input.
    camera, person, layout, rate
        As in `posekit.recover`.

    Returns
    -------
    BatchRun

    Raises
    ------
    InputError
        If a path does not exist, or the output is not a folder. An input that cannot be processed raises no error; it
        is listed in ``failed``.

    Examples
    --------
    >>> import posekit.batch
    >>> posekit.batch.batch("archive/", "results", jobs=8)  # doctest: +SKIP
    BatchRun(118 done, 0 kept, 1 failed)
    """
    asked, folder = Settings.of(settings or RecoverSettings()), Path(output)
    if folder.exists() and not folder.is_dir():
        raise refusal(folder, "", "a file", "a folder", "name another folder")
    inside = folder.resolve()
    if not are_paths(inputs):
        raise refusal("batch", "inputs", shown(type(inputs).__name__), "paths", "name files or folders")
    found = {path.resolve(): path for path in files_of(inputs)}
    paths = [path for resolved, path in found.items() if inside not in resolved.parents]
    if not paths:
        raise refusal(folder, "", "no input outside of it", "input files", "name another output folder")
    folder.mkdir(parents=True, exist_ok=True)
    options = {"camera": camera, "person": person, "layout": layout, "rate": rate}
    about = json.dumps(
        [asked.to_json(), {k: str(v) for k, v in options.items()}], sort_keys=True, default=str
    )
    earlier, names = _manifest(folder), names_below(str(path) for path in paths)
    done, kept, failed = list[Entry](), list[Entry](), list[Entry]()
    tasks: list[Task] = []
    for path in paths:
        name = names[str(path)].as_posix()
        entry: Entry = {"input": name, "key": _checksum(path, about)}
        old = earlier.get(name, {})
        if old.get("key") == entry["key"] and "output" in old and _is_whole(folder / old["output"], old):
            kept.append(old)
        else:
            tasks.append((entry, str(path), str(folder), asked, options))
    work = _on_ray(tasks, ray) if ray else _in_processes(tasks, jobs) if jobs > 1 else map(_computed, tasks)
    with (folder / MANIFEST).open("a", encoding="utf-8") as manifest:
        for entry in work:
            manifest.write(json.dumps(entry) + "\n")
            manifest.flush()
            (failed if "error" in entry else done).append(entry)
            if say is not None:
                say(f"{entry['input']}: {entry.get('error') or entry['summary']}")
    if say is not None:
        say(f"{len(done)} done, {len(kept)} kept, {len(failed)} failed in {folder}")
    return BatchRun(done=tuple(done), kept=tuple(kept), failed=tuple(failed))


def _manifest(folder: Path) -> dict[str, Entry]:
    """Return the last manifest entry of each input; an incomplete line of the manifest is ignored."""
    found: dict[str, Entry] = {}
    path = folder / MANIFEST
    lines = path.read_text(encoding="utf-8").splitlines() if path.is_file() else []
    for line in lines:
        try:
            entry = json.loads(line)
        except json.JSONDecodeError:
            continue
        if isinstance(entry, dict) and "input" in entry:
            found[entry["input"]] = entry
    if lines and not path.read_bytes().endswith(b"\n"):
        with path.open("a", encoding="utf-8") as file:
            file.write("\n")
    return found


def _checksum(path: Path, about: str = "") -> str:
    """Return the SHA-256 of the text `about` and a file, or of `about` and all files of a folder of key points."""
    digest = hashlib.sha256(about.encode())
    for file in [path] if path.is_file() else sorted(one for one in path.rglob("*") if one.is_file()):
        with file.open("rb") as data:
            while block := data.read(1 << 20):
                digest.update(block)
    return digest.hexdigest()


def _is_whole(path: Path, entry: Entry) -> bool:
    return path.is_file() and _checksum(path) == entry.get("sha256")


#: Arguments of a process: entry, input, output folder, settings, options.
Task = tuple[Entry, str, str, Settings, dict[str, Any]]


def _computed(task: Task) -> Entry:
    """Process one input, write its output, and return its manifest entry, which has the error if one occurs."""
    import posekit

    entry, path, folder, settings, options = task
    try:
        held = posekit.open(path, options["layout"], rate=options["rate"])
        if isinstance(held, Motion) or hasattr(held, "survivors"):
            own = {one.name for one in fields(ValidateSettings)}
            shared = {one.name: getattr(settings, one.name) for one in fields(settings) if one.name in own}
            made: Any = posekit.validate(held, ValidateSettings(**shared))
            kind, suffix, summary = "report", ".json", made.decision
        else:
            recover = settings if isinstance(settings, RecoverSettings) else RecoverSettings()
            made = posekit.recover(held, recover, **options)
            counted = f"{plural(len(made), 'frame')}, {plural(len(made.survivors), 'posture')}"
            kind, suffix, summary = "result", ".npz", counted
        target = Path(folder) / f"{entry['input']}.{kind}{suffix}"
        target.parent.mkdir(parents=True, exist_ok=True)
        posekit.save(made, target)
    except (PosekitError, OSError, MemoryError) as error:
        return {**entry, "error": one_line(str(error) or type(error).__name__)}
    output = target.relative_to(folder).as_posix()
    return {**entry, "output": output, "sha256": _checksum(target), "kind": kind, "summary": summary}


def _in_processes(tasks: Sequence[Task], jobs: int) -> Iterator[Entry]:
    """Compute inputs in a pool of processes.

    Raises
    ------
    InputError
        If a process dies, for example from lack of memory. Finished outputs remain, and a new run computes the
        remaining inputs.
    """
    with ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context("spawn")) as pool:
        try:
            for future in as_completed([pool.submit(_computed, task) for task in tasks]):
                yield future.result()
        except BrokenProcessPool:
            remedy = "use fewer --jobs and run the command again"
            raise refusal("batch", "", "a process that died", "enough memory for all", remedy) from None


def _on_ray(tasks: Sequence[Task], address: str) -> Iterator[Entry]:
    """Compute inputs on a Ray cluster.

    Raises
    ------
    InputError
        If Ray is not installed, or there is no cluster at the address.
    """
    try:
        import ray
    except ImportError:
        expected, remedy = "Ray", "install posekit[ray]"
        raise refusal("batch", "ray", "no installed ray", expected, remedy) from None
    try:
        cluster = None if address == "local" else address
        ray.init(address=cluster, ignore_reinit_error=True, log_to_driver=False)
    except (ConnectionError, ValueError, RuntimeError):
        expected = "the address of a cluster, or local"
        raise refusal("batch", "ray", shown(address), expected, "check it") from None
    remote = ray.remote(max_retries=1)(_computed)
    waiting, running = list(reversed(tasks)), dict[Any, Task]()
    room = IN_FLIGHT * max(int(ray.cluster_resources().get("CPU", 1)), 1)
    while waiting or running:
        while waiting and len(running) < room:
            task = waiting.pop()
            running[remote.remote(task)] = task
        for ready in ray.wait(list(running))[0]:
            task = running.pop(ready)
            try:
                yield ray.get(ready)
            except ray.exceptions.RayError as error:
                yield {**task[0], "error": one_line(f"{task[1]}: {error}")[:500]}
