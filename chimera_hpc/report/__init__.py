"""One HTML file to look at a sweep: map, tree, projections, pictures, failures, provenance.

The file holds all that it shows, Bokeh's scripts included, and asks the network for nothing. It is
made from the store and, where there is one, results.json beside it.
"""

from chimera_hpc.report.page import REPORT, Report, write_report

__all__ = ["REPORT", "Report", "write_report"]
