"""An installed Chromium that draws scenes: found, started once, told over a pipe, and ended."""

from posekit.viewer.browser.find_browser import find_browser as find_browser
from posekit.viewer.browser.studio import Studio as Studio
