"""Any articulated object from a single uncalibrated picture (Taylor 2000): linkages, and their family of postures."""

from posekit.linkages.linkage import Linkage as Linkage
from posekit.linkages.linkage import Midpoint as Midpoint
from posekit.linkages.linkage_family import LinkageFamily as LinkageFamily
from posekit.linkages.linkage_family import name_nearer as name_nearer
from posekit.linkages.linkage_family import read_nearer as read_nearer
from posekit.linkages.reading import linkage_names as linkage_names
from posekit.linkages.reading import linkage_of as linkage_of
from posekit.linkages.reading import load_linkage as load_linkage
from posekit.linkages.scale_minima import Minima as Minima
from posekit.linkages.scale_search import search as search
from posekit.linkages.spanning import SpanningTree as SpanningTree
from posekit.linkages.spanning import span as span
