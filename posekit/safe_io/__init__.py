"""Intake: the one door through which every file from outside comes.

A file is opened only when it is a regular file of bounded size; what is made of it has bounded depth and
number, finite numbers, no entities and no pickles. Every refusal is one line. What is written goes out by the same
door: whole, or not at all.
"""

from posekit.safe_io.extras import extra as extra
from posekit.safe_io.json_file import parse_json as parse_json
from posekit.safe_io.json_file import read_json as read_json
from posekit.safe_io.mesh_file import check_mesh as check_mesh
from posekit.safe_io.npz_file import Archive as Archive
from posekit.safe_io.npz_file import open_npz as open_npz
from posekit.safe_io.npz_file import read_npy as read_npy
from posekit.safe_io.refusal import bounded as bounded
from posekit.safe_io.refusal import cut as cut
from posekit.safe_io.refusal import nearest as nearest
from posekit.safe_io.refusal import one_line as one_line
from posekit.safe_io.refusal import perhaps as perhaps
from posekit.safe_io.refusal import refusal as refusal
from posekit.safe_io.refusal import shown as shown
from posekit.safe_io.regular_file import open_file as open_file
from posekit.safe_io.regular_file import read_bytes as read_bytes
from posekit.safe_io.text_file import read_text as read_text
from posekit.safe_io.toml_file import parse_toml as parse_toml
from posekit.safe_io.toml_file import read_toml as read_toml
from posekit.safe_io.writing import replacing as replacing
from posekit.safe_io.writing import write_json as write_json
from posekit.safe_io.writing import write_lines as write_lines
from posekit.safe_io.writing import write_text as write_text
from posekit.safe_io.xml_file import parse_xml as parse_xml
from posekit.safe_io.xml_file import read_xml as read_xml
