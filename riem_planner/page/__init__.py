# SPDX-License-Identifier: Apache-2.0
"""The plan page: one HTML file that opens from disk and shows a plan among its zones.

`document` gathers what is shown as one JSON value, and puts it with the page's own style and
scripts (`page.html`, `page.css`, `view.js`, `plots.js`, `page.js`) into one file.
"""

from riem_planner.page.document import plan_page

__all__ = ["plan_page"]
