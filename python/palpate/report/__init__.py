"""What a person sees: figures of a trace, and pages that carry everything they need in one file."""

from palpate.report.html import Page

__all__ = ["Page"]
