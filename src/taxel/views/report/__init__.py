"""Self-contained HTML pages of results: no script, no link to another file."""

from taxel.views.report.run_page import RunPage, write_run_report
from taxel.views.report.teng_pages import write_checked_report, write_teng_report

__all__ = ["RunPage", "write_checked_report", "write_run_report", "write_teng_report"]
