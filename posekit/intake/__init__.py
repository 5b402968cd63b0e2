"""Intake: the one door through which every file from outside comes.

A file is opened only when it is a regular file of bounded size; what is made of it has bounded depth and
number, finite numbers, no entities and no pickles. Every refusal is one line. What is written goes out by the same
door: whole, or not at all.
"""

from posekit.intake.extras import extra as extra
from posekit.intake.json_file import parse_json as parse_json
from posekit.intake.json_file import read_json as read_json
from posekit.intake.mesh_file import check_mesh as check_mesh
from posekit.intake.npz_file import Archive as Archive
from posekit.intake.npz_file import open_npz as open_npz
from posekit.intake.refusal import cut as cut
from posekit.intake.refusal import nearest as nearest
from posekit.intake.refusal import one_line as one_line
from posekit.intake.refusal import refusal as refusal
from posekit.intake.refusal import shown as shown
from posekit.intake.regular_file import open_file as open_file
from posekit.intake.regular_file import read_bytes as read_bytes
from posekit.intake.text_file import read_text as read_text
from posekit.intake.toml_file import parse_toml as parse_toml
from posekit.intake.toml_file import read_toml as read_toml
from posekit.intake.writing import replacing as replacing
from posekit.intake.writing import write_json as write_json
from posekit.intake.writing import write_lines as write_lines
from posekit.intake.writing import write_text as write_text
from posekit.intake.xml_file import parse_xml as parse_xml
from posekit.intake.xml_file import read_xml as read_xml
