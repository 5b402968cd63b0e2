"""Files: `open` reads all formats, `save` writes them; layouts in ``urdf/layouts`` map names of points to joints."""

from posekit.formats.open import open as open
from posekit.formats.save import save as save
