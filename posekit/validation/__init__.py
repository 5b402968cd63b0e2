"""Whole files judged: postures or configurations to verdicts and reports."""

from posekit.validation.advice import said_of as said_of
from posekit.validation.validate import RecoveredWith as RecoveredWith
from posekit.validation.validate import recovered_with as recovered_with
from posekit.validation.validate import validate as validate
