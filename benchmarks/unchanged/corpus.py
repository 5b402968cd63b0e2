"""The corpus, `cases.txt`: one case a line, its name, then its command; its kind is the first word of its name.

``@CASE/FILE`` is what an earlier case wrote, ``@inputs/FILE`` what `inputs` wrote, ``@data/FILE`` a real recording
(the case is left out where no data was given); ``&&`` runs one command after another. ``python NAME …`` runs a
function of `calls`. A name that starts with ``~`` says that numbers are refined: found by iteration, good to 1e-9
instead of 1e-12; so are those of every case that reads such a case's files.
"""

from __future__ import annotations

import re
import shlex
from dataclasses import dataclass, replace
from fnmatch import fnmatch
from pathlib import Path

CASE_REFERENCE = re.compile(r"@([a-z0-9-]+)(?=[/:]|$)")
INPUTS_READ = frozenset(
    {"synth-walker", "synth-walker-side", "synth-random", "synth-random-noise", "synth-uncalibrated"}
)
"""The views of which `inputs` makes detectors' files, motion, and files that are wrong."""

CASES_FILE = Path(__file__).with_name("cases.txt")


@dataclass(frozen=True, kw_only=True)
class Case:
    """One case: what is run, in a folder of its own, and how exact its numbers are.

    Parameters
    ----------
    name : str
        Its name, which is that of its folder too.
    commands : tuple of tuple of str
        What is run, one after another; references are not yet resolved.
    refined : bool
        Whether numbers are found by iteration, and good to 1e-9 instead of 1e-12.
    """

    name: str
    commands: tuple[tuple[str, ...], ...]
    refined: bool

    @property
    def kind(self) -> str:
        """The first word of its name."""
        return self.name.split("-", maxsplit=1)[0]

    @property
    def reads(self) -> set[str]:
        """What it reads: names of cases, ``inputs``, ``data``."""
        return {
            name for command in self.commands for word in command for name in CASE_REFERENCE.findall(word)
        }


def cases(*, data: bool, only: str = "*") -> list[Case]:
    """Return the corpus in an order in which it can be run.

    Parameters
    ----------
    data : bool
        Whether real recordings were given.
    only : str
        A glob of names; what those read is kept too.
    """
    corpus: dict[str, Case] = {}
    for line in CASES_FILE.read_text().splitlines():
        if not line.strip() or line.startswith("#"):
            continue
        name, text = line.split(maxsplit=1)
        commands = tuple(tuple(shlex.split(command)) for command in text.split(" && "))
        case = Case(name=name.lstrip("~"), commands=commands, refined=name.startswith("~"))
        if any(corpus[read].refined for read in case.reads if read in corpus):
            case = replace(case, refined=True)
        corpus[case.name] = case
    if not data:
        absent = {"data"}
        for case in corpus.values():
            if case.reads & absent or any("-real" in word for command in case.commands for word in command):
                absent.add(case.name)
        corpus = {name: case for name, case in corpus.items() if name not in absent}
    wanted = {name for name in corpus if fnmatch(name, only)}
    for case in reversed(corpus.values()):  # what is read stands before what reads it
        if case.name in wanted:
            wanted |= case.reads & set(corpus)
            wanted |= INPUTS_READ if "inputs" in case.reads else set()
    return [case for name, case in corpus.items() if name in wanted]
