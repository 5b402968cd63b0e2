"""Damaged files of every container, given to the command: it must answer, or refuse the file in one line.

    python -m benchmarks.fuzz -o DIR [--seconds 600] [--seed 0] [--data DIR]

posekit writes intact files: samples, and each motion and result container. Bytes of a file, or of members of an
archive, are damaged, and the file is given to `inspect`, `validate`, `convert` or `recover` in a forked process with
limits of time and memory. A case is clean if the command ends with 0 or 1, or with 2 after one printable line that
starts with ``posekit: error:``, without writing a file, and if it never ends by an exception, a signal or the limits.
Other cases are kept in DIR with the damaged file, the arguments and the output.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import json
import os
import pkgutil
import random
import re
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
import zipfile
from collections import Counter
from collections.abc import Mapping
from pathlib import Path

import posekit
from benchmarks.common import data_of, files_below, parser, table
from posekit.robots.find import find
from posekit.samples import samples

MOTION_ENDINGS = ("bvh", "trc", "csv", "parquet", "npz", "json", "trc.gz", "bvh.gz")
RESULT_ENDINGS = ("json", "npz", "parquet", "json.gz")
COMMANDS = {
    "": (
        "inspect IN",
        "validate IN -o OUT.json",
        "convert IN OUT.bvh",
        "convert IN OUT.npz",
        "convert IN OUT.json",
    ),
    ".csv": ("validate IN --urdf g1 -o OUT.json", "convert IN OUT.npz --urdf g1"),
    ".json": ("recover IN -o OUT.json", "recover IN -o OUT.npz --stature 175cm"),
    ".toml": ("recover SEEDS/keypoints -o OUT.json --camera IN --stature 175cm",),
    ".urdf": ("validate SEEDS/walk.npz -o OUT.json --urdf IN",),
}
"""Commands by the ending of the damaged file IN, beside those for all.

OUT is what is written, SEEDS the folder of whole files.
"""

LARGEST_SEED = 3_000_000
"""Bytes of a file of ``--data`` that is damaged; larger ones only slow the run down."""

MEMORY_BYTES, PROCESSOR_SECONDS, PATIENCE_SECONDS = 4 << 30, 30, 180.0
LONGEST_REFUSAL = 2000
CRASHED = 70

MARKS = (
    b"<",
    b"[" * 100,
    b"{",
    b"}",
    b",",
    b"\0",
    b"\xff\xfe",
    b"\xef\xbb\xbf",
    b"\x1b]0;x\x07",
    b"null",
    b'"x"',
)
NUMBERS = (
    b"nan",
    b"-inf",
    b"-1",
    b"0",
    b"",
    b"9" * 400,
    b"1e999",
    b"1e308",
    b"9223372036854775808",
    b"0x10",
    b"1.5.2",
)


def damaged(data: bytes, rng: random.Random) -> bytes:
    """Return data changed in one to four places; of an archive often inside its members."""
    if data[:2] == b"PK" and rng.random() < 0.6:
        with contextlib.suppress(zipfile.BadZipFile, NotImplementedError):
            return _members_damaged(data, rng)
    for _ in range(rng.randint(1, 4)):
        data = _once(data, rng)
    return data


def _once(data: bytes, rng: random.Random) -> bytes:
    start = rng.randrange(max(len(data), 1))
    length = rng.randint(0, 8) if rng.random() < 0.7 else rng.randint(0, len(data) // 2)
    kind = rng.choice(("number", "number", "mark", "cut", "double", "byte", "end", "line"))
    if kind == "number":
        found = list(re.finditer(rb"-?\d+(\.\d+)?(e-?\d+)?", data[start : start + 4000]))
        if found:
            one = rng.choice(found)
            return data[: start + one.start()] + rng.choice(NUMBERS) + data[start + one.end() :]
    if kind == "line":
        lines = data.split(b"\n")
        at, other = rng.randrange(len(lines)), rng.randrange(len(lines))
        lines[at] = rng.choice((b"", lines[other], lines[at] + b"\n" + lines[at]))
        return b"\n".join(lines)
    if kind == "end":
        return data[:start]
    middle = {"cut": b"", "double": data[start : start + length] * 2, "byte": bytes([rng.randrange(256)])}
    return (
        data[:start] + middle.get(kind, rng.choice(MARKS)) + data[start + (length if kind != "byte" else 1) :]
    )


def _members_damaged(data: bytes, rng: random.Random) -> bytes:
    """Damage, drop, exchange or rename a member of an archive, which stays a valid archive."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    name, other = rng.choice(sorted(members)), rng.choice(sorted(members))
    kind = rng.choice(("bytes", "bytes", "drop", "exchange", "rename"))
    if kind == "bytes":
        members[name] = damaged(members[name], rng)
    elif kind == "exchange":
        members[name] = members[other]
    else:
        held = members.pop(name)
        if kind == "rename":
            members[f"x{name}"] = held
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for member, content in members.items():
            archive.writestr(member, content)
    return out.getvalue()


def write_seeds(folder: Path, data: list[Path]) -> list[Path]:
    """Write intact files of every kind, and copy small files of the data."""
    samples(folder)
    walk = posekit.open(folder / "walk.npz")
    for ending in MOTION_ENDINGS:
        posekit.save(walk, folder / f"motion.{ending}")
    result = posekit.recover(folder / "walk.json")
    for ending in RESULT_ENDINGS:
        posekit.save(result, folder / f"result.{ending}")
    posekit.save(posekit.validate(folder / "jump.bvh"), folder / "report.json")
    shutil.copy(find("figure")[1], folder / "figure.urdf")
    for number, file in enumerate(files_below(data)):
        if file.stat().st_size < LARGEST_SEED:
            shutil.copy(file, folder / f"{number}.{file.name}")
    return [file for file in files_below([folder]) if file.is_file()]


def placed(arguments: list[str], places: Mapping[str, Path]) -> list[str]:
    """Put paths in where arguments begin with the name of a place."""
    names = "|".join(places)
    return [re.sub(rf"^({names})\b", lambda at: str(places[at[0]]), one) for one in arguments]


def run_command(arguments: list[str]) -> int:
    """Run a command in this process and return its exit code."""
    from posekit.__main__ import main as posekit_main

    sys.argv = ["posekit", *arguments]
    try:
        posekit_main()
    except SystemExit as ended:
        return ended.code if isinstance(ended.code, int) else int(ended.code is not None)
    return 0


def in_fork(arguments: list[str], said: Path) -> int | None:
    """Run a command in a fork that prints to `said`; return its exit code, -N of signal N, None if it hangs."""
    child = os.fork()
    if child == 0:
        code = CRASHED
        out = os.open(said, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(out, 1)
        os.dup2(out, 2)
        try:
            sys.stdout, sys.stderr = (os.fdopen(stream, "w", errors="backslashreplace") for stream in (1, 2))
            resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
            resource.setrlimit(resource.RLIMIT_CPU, (PROCESSOR_SECONDS, PROCESSOR_SECONDS))
            code = run_command(arguments)
        except BaseException:  # whatever it is, it is looked for
            os.write(2, traceback.format_exc().encode(errors="replace"))
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(code)
    ends = time.monotonic() + PATIENCE_SECONDS
    while time.monotonic() < ends:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.002)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return None


def outcome(code: int | None, said: str, written: list[str]) -> str:
    """Return ``accepted`` or ``refused``, or the reason why the case is not clean."""
    if code is None or code in (-signal.SIGXCPU, -signal.SIGKILL):
        return "hangs"
    if code < 0:
        return f"signal {-code}"
    if code == CRASHED or "Traceback (most recent call last)" in said:
        return "traceback"
    if code != 2:
        return "accepted" if code in (0, 1) else f"exit {code}"
    lines = [line for line in said.splitlines() if line.startswith("posekit: error:")]
    if len(lines) != 1 or len(lines[0]) > LONGEST_REFUSAL or not lines[0].isprintable():
        return "not one line"
    return "written beside a refusal" if written else "refused"


def main() -> int:
    made = parser(__doc__)
    made.add_argument("-o", "--output", type=Path, required=True)
    made.add_argument("--seconds", type=float, default=600.0)
    given = made.parse_args()
    counts: Counter[tuple[str, str]] = Counter()
    here = Path.cwd()
    with tempfile.TemporaryDirectory() as spare:
        folder = Path(spare)
        seeds = write_seeds(folder / "seeds", data_of(given))
        for module in pkgutil.walk_packages(posekit.__path__, "posekit."):  # once for all forks
            importlib.import_module(module.name)
        ends, number = time.monotonic() + given.seconds, 0
        while time.monotonic() < ends:
            rng = random.Random(f"{given.seed}.{number}")
            seed, case = rng.choice(seeds), folder / "case"
            shutil.rmtree(case, ignore_errors=True)
            case.mkdir()
            file = case / seed.name
            file.write_bytes(damaged(seed.read_bytes(), rng))
            places = {"IN": file, "OUT": case / "out", "SEEDS": folder / "seeds"}
            command = rng.choice((*COMMANDS[""], *COMMANDS.get(seed.suffix, ())))
            arguments = placed(command.split(), places)
            os.chdir(case)
            code = in_fork(arguments, folder / "said")
            os.chdir(here)
            said = (folder / "said").read_text(errors="replace")
            what = outcome(code, said, [path.name for path in case.iterdir() if path != file])
            counts["".join(seed.suffixes[-2:]) if seed.suffix == ".gz" else seed.suffix, what] += 1
            if what not in ("accepted", "refused"):
                given.output.mkdir(parents=True, exist_ok=True)
                shutil.copy(file, given.output / f"{number}.{seed.name}")
                about = {"what": what, "arguments": arguments, "said": said[-4000:]}
                (given.output / f"{number}.case.json").write_text(json.dumps(about, indent=1))
                print(
                    f"{number}: {what}: {seed.name}: {' '.join(arguments[:1])}", file=sys.stderr, flush=True
                )
            number += 1
    whats = sorted({what for _, what in counts})
    rows = [(kind, *(counts[kind, what] for what in whats)) for kind in sorted({kind for kind, _ in counts})]
    print(f"{sum(counts.values())} cases")
    print(table(("container", *whats), rows))
    return int(any(what not in ("accepted", "refused") for what in whats))


if __name__ == "__main__":
    sys.exit(main())
