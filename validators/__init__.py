"""Validation of postures and motion: the protocol of checks, the built-in checks, and reports of their findings."""

from posekit.validators.body import Body as Body
from posekit.validators.check import Check as Check
from posekit.validators.check import Judgement as Judgement
from posekit.validators.check import NotAskedError as NotAskedError
from posekit.validators.judge import PostureJudge as PostureJudge
from posekit.validators.judge import Validator as Validator
from posekit.validators.judge import assert_valid as assert_valid
from posekit.validators.judge import judge_postures as judge_postures
from posekit.validators.judge import validate_motion as validate_motion
from posekit.validators.report import Report as Report
