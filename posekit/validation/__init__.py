"""Whatever holds postures judged: files, folders, arrays; to verdicts and reports."""

from posekit.validation.advice import said_of as said_of
from posekit.validation.files import AskedValidation as AskedValidation
from posekit.validation.files import validate_files as validate_files
from posekit.validation.judging import ReportBuilder as ReportBuilder
from posekit.validation.judging import WantedDetail as WantedDetail
from posekit.validation.judging import validate_postures as validate_postures
from posekit.validation.reading import StatedMotion as StatedMotion
from posekit.validation.reading import files_of as files_of
from posekit.validation.validate import validate as validate
