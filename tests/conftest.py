"""Settings of the property tests."""

from __future__ import annotations

from hypothesis import HealthCheck, settings
from nightly import NIGHTLY

# Machines are shared, so no example has a deadline. Only nightly tests draw new examples: no chance fails a change.
SLOW = [HealthCheck.too_slow]
settings.register_profile("shared", deadline=None, derandomize=not NIGHTLY, suppress_health_check=SLOW)
settings.load_profile("shared")
