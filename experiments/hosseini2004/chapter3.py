"""Chapter 3: linear models, the identified model, friction factors, and the first closed loops."""

from __future__ import annotations

from collections.abc import Callable

from palpate import devices
from palpate.report import Page

from experiments.hosseini2004.chapter2 import DEVICE
from experiments.hosseini2004.chapter3_contradictions import contradictions
from experiments.hosseini2004.chapter3_identification import arx_models, friction_factors
from experiments.hosseini2004.chapter3_loops import open_loop_with_friction, table31
from experiments.hosseini2004.chapter3_models import case_c, case_d, discretisation, experimental, linear_model
from experiments.hosseini2004.checks import Check

__all__ = ["chapter3"]


def chapter3(page: Page, tick: Callable[[str, float], None]) -> list[Check]:
    """Compute chapter 3, write it on the page and return its checks; `tick(text, fraction)` reports progress."""
    device = devices.load(DEVICE)
    page.section("Chapter 3: linear models, identification, friction", "chapter-3")
    checks = linear_model(page, device)
    checks += discretisation(page, device)
    tick("identified model", 0.05)
    checks += experimental(page)
    tick("identified model against the arm", 0.08)
    checks += contradictions(page, device)
    tick("ARX identification", 0.1)
    checks += arx_models(page, device)
    tick("friction factors", 0.3)
    checks += friction_factors(page, device)
    tick("lead–lag, table 3.1", 0.78)
    checks += table31(page, device)
    tick("open loop with friction", 0.85)
    checks += open_loop_with_friction(page, device)
    tick("cases C and D", 0.97)
    checks += case_c(page, device)
    checks += case_d(page, device)
    return checks
