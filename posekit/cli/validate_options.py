"""Options of `posekit validate`: by which body and by what postures are judged, and what is stated of files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from posekit.cli.options import AngleTolerance, Rules, option, rule_numbers, signed_length, split

if TYPE_CHECKING:
    from posekit.validation import AskedValidation, StatedMotion


@dataclass(frozen=True, kw_only=True)
class BodyOptions:
    """By which body postures are judged."""

    urdf: Annotated[
        str,
        option(
            "--urdf",
            "FILE|NAME",
            "stick_figure, a robot of example-robot-data (human, g1, talos, …), or a URDF. Default: the stick "
            "figure; a result's own.",
        ),
    ] = ""
    lengths: Annotated[
        str,
        option(
            "--lengths",
            "model|median|each",
            "Whose segment lengths the model gets: none, each recording's medians, each posture's own (robots, slow). "
            "Default: median; a result's own.",
        ),
    ] = ""
    joint_map: Annotated[
        str, option("--joint-map", "FILE|NAME", "Which frames of the robot stand for the joints.")
    ] = ""
    bodies: Annotated[
        str,
        option(
            "--bodies",
            "auto|urdf|visual|capsules",
            "What collides, of a robot: its collision bodies, its visual ones, or capsules that are made up.",
        ),
    ] = "auto"
    srdf: Annotated[str, option("--srdf", "FILE", "The robot's SRDF: which pairs are not checked.")] = ""
    package_dir: Annotated[
        list[Path] | None,
        option("--package-dir", "DIR", "Where its meshes' packages are; may be given again."),
    ] = None
    trusted: Annotated[
        bool | None,
        typer.Option(
            "--trusted/--untrusted",
            help="Whether to load the URDF at once, or in a child process with limits first (default: the second, "
            "for what is not built in).",
        ),
    ] = None
    sequence: Annotated[
        bool,
        typer.Option(
            "--sequence", help="Frames in time: a robot's fit starts from the one before, clip by clip."
        ),
    ] = False

    @property
    def changes(self) -> dict[str, Any]:
        """The settings that are given; None where one is not."""
        if self.joint_map:
            from posekit.robots.joint_map import load_joint_map

            load_joint_map(self.joint_map)  # one that is none is refused before any file
        return {
            "lengths": self.lengths or None,
            "joint_map": self.joint_map or None,
            "bodies": self.bodies,
            "srdf": self.srdf or None,
            "package_dirs": self.package_dir or (),
            "untrusted": None if self.trusted is None else not self.trusted,
        }


@dataclass(frozen=True, kw_only=True)
class StatedOptions:
    """What is stated of files, in place of what they say or what is recognised."""

    unit: Annotated[
        str,
        option("--unit", "m|cm|mm|in", "What lengths are in. Default: as the file says, or the body's size."),
    ] = ""
    up: Annotated[
        str, option("--up", "AXIS", "Against gravity: +z, +y, … Default: as the file says, or the bodies.")
    ] = ""
    rate: Annotated[
        float | None,
        option(
            "--rate", "FPS", "Frames a second. Default: as the file says; without, speeds are not judged."
        ),
    ] = None
    body_model: Annotated[
        Path | None,
        option("--body-model", "FILE.npz", "Your SMPL, SMPL+H or SMPL-X, for files of angles as AMASS's."),
    ] = None

    @property
    def stated(self) -> StatedMotion:
        """What is stated."""
        from posekit.validation import StatedMotion as Made

        return Made(unit=self.unit, up=self.up, rate=self.rate, body_model=self.body_model)


@dataclass(frozen=True, kw_only=True)
class JudgedOptions:
    """By what postures and motion are judged, and what may be off."""

    checks: Annotated[
        str,
        option(
            "--checks",
            "LIST",
            "By commas. Stick figure: rigid-parts, joint-range, collision (these by default), walking; robots: reach, "
            "rigid-parts, joint-range, collision (these by default), balance; and those over time, by default the "
            "profile's.",
        ),
    ] = ""
    profile: Annotated[
        str,
        option(
            "--profile",
            "NAME|FILE",
            "Checks over time and their thresholds: posekit, phuma, or a TOML table.",
        ),
    ] = "posekit"
    ground: Annotated[
        str,
        option(
            "--ground", "HEIGHT", "Where the ground is along up, as 0m. Default: estimated from each clip."
        ),
    ] = ""
    strict: Annotated[
        bool,
        typer.Option(
            "--strict",
            help="Judge postures as those of the figure itself: by its lengths, 3 cm and 0.001 degrees, no noise.",
        ),
    ] = False
    noise: Annotated[
        str,
        option(
            "--noise",
            "LENGTH",
            "Standard deviation of measured coordinates, as 5mm, for which tolerances allow. Default: estimated "
            "from the limbs' lengths over time; a result has none.",
        ),
    ] = ""
    ranges: Annotated[
        str,
        option(
            "--ranges",
            "NAME|FILE",
            "Joint ranges: anatomical, urdf, table1, table1-printed, or a TOML file. Default: a result's own, else "
            "anatomical; a robot's own limits.",
        ),
    ] = ""
    rules: Rules = "1,2"
    walkers: Annotated[
        str,
        option(
            "--walkers",
            "paper|people|paper-printed",
            "Thresholds of those rules: by Lee & Chen's word, as real walkers keep them, or as printed. Default: "
            "paper; a result's own.",
        ),
    ] = ""
    rigid_tolerance: Annotated[
        str,
        option(
            "--rigid-tolerance",
            "LENGTH",
            "How far distances inside rigid parts, and the fit of a robot, may be off. Default: 3cm, more where spines "
            "bend and noise was measured; what a result's postures were recovered with.",
        ),
    ] = ""
    angle_tolerance: AngleTolerance = None
    contact_margin: Annotated[
        str,
        option(
            "--contact-margin",
            "LENGTH",
            "Clearance that bodies must keep, as 1cm; negative allows penetration. Default: 0cm; a result's own.",
        ),
    ] = ""

    @property
    def changes(self) -> dict[str, Any]:
        """The settings that are given; None where one is not."""
        from posekit.formats.own import parse_length

        rigid = self.rigid_tolerance
        return {
            "checks": split(self.checks) if self.checks else None,
            "profile": self.profile,
            "ground": signed_length(self.ground, "--ground") if self.ground else None,
            "strict": self.strict or None,
            "noise": parse_length(self.noise, name="--noise") if self.noise else None,
            "ranges": self.ranges or None,
            "rules": rule_numbers(self.rules),
            "walkers": self.walkers or None,
            "rigid_tolerance": parse_length(rigid, name="--rigid-tolerance") if rigid else None,
            "angle_tolerance": self.angle_tolerance,
            "contact_margin": signed_length(self.contact_margin, "--contact-margin")
            if self.contact_margin
            else None,
        }


def asked_of(body: BodyOptions, stated: StatedOptions, judged: JudgedOptions) -> AskedValidation:
    """Put together what is asked of every file.

    Parameters
    ----------
    body, stated, judged
        The options.

    Raises
    ------
    InputError
        Where one of them is impossible.
    """
    from posekit.validation import AskedValidation as Made

    changes = {**body.changes, **judged.changes}
    return Made(
        urdf=body.urdf,
        changes={name: value for name, value in changes.items() if value is not None},
        stated=stated.stated,
        sequence=body.sequence,
    )
