"""Files: `open` reads any once, `save` writes one; layouts in ``urdf/layouts`` say which name is which joint."""

from posekit.formats.open import open as open
from posekit.formats.save import save as save
