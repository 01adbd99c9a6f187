"""HTML reports, each in one self-contained file."""

from palpate.report.html import Page
from palpate.report.performance import performance_page
from palpate.report.run import run_page
from palpate.report.sweep import sweep_page
from palpate.report.together import device_page, together_page
from palpate.report.workspace import workspace_page
from palpate.report.zwidth import zwidth_page

__all__ = [
    "Page",
    "device_page",
    "performance_page",
    "run_page",
    "sweep_page",
    "together_page",
    "workspace_page",
    "zwidth_page",
]
