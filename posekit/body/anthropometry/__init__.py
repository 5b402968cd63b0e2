"""How long a person's segments are: from stature, from named proportions, from recordings of the person.

`lengths_from_proportions` needs the stature alone; `lengths_from_postures` takes recordings in space,
`lengths_from_views` the key points of one camera; `read_lengths` what was found before. Each result says how far each
length may be off, and `posekit.body.Figure.scaled` makes the figure of it.
"""

from posekit.body.anthropometry.body import SegmentLengths as SegmentLengths
from posekit.body.anthropometry.lengths_file import read_lengths as read_lengths
from posekit.body.anthropometry.lengths_file import write_lengths as write_lengths
from posekit.body.anthropometry.postures import PostureLengths as PostureLengths
from posekit.body.anthropometry.postures import lengths_from_postures as lengths_from_postures
from posekit.body.anthropometry.proportions import lengths_from_proportions as lengths_from_proportions
from posekit.body.anthropometry.proportions import proportion_names as proportion_names
from posekit.body.anthropometry.views import LengthEvidence as LengthEvidence
from posekit.body.anthropometry.views import ViewLengths as ViewLengths
from posekit.body.anthropometry.views import lengths_from_views as lengths_from_views
