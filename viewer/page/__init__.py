"""The interactive page of a result: one file that works offline, or served on this machine alone."""

from posekit.viewer.page.page import page_html as page_html
from posekit.viewer.page.page import write_page as write_page
from posekit.viewer.page.server import PageServer as PageServer
