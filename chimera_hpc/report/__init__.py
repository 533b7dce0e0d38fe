"""Writes the report of a sweep: one HTML file with map, tree, projections, pictures, failures."""

from chimera_hpc.report.page import REPORT, Report, write_report

__all__ = ["REPORT", "Report", "write_report"]
