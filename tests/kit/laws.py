"""How often hypothesis tries a law: a fifth as often in the fast run, as often as it says with `--all-examples`."""

from __future__ import annotations

from typing import Any

from hypothesis import HealthCheck, settings

SAMPLE, FEW = 20, 5
# No law depends on how fast a machine is, nor whether it can be tried there.
_CALM = [HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.function_scoped_fixture]
settings.register_profile("sample", deadline=None, suppress_health_check=_CALM, max_examples=SAMPLE)
settings.register_profile("all", deadline=None, suppress_health_check=_CALM, max_examples=100)


def examples(count: int, **more: Any) -> settings:
    """Return settings for a law that is tried `count` times, or a fifth of that in the fast run."""
    everything = settings.get_current_profile_name() == "all"
    return settings(max_examples=count if everything else min(count, max(FEW, count // 5)), **more)
