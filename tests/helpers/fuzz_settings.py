"""How hypothesis runs where it is not a test that calls it: so many examples from a seed, as long as they take."""

from hypothesis import HealthCheck, Phase, settings


def examples(count: int) -> settings:
    """Return settings for so many examples, of which a failing one is shrunk; nothing is kept between runs."""
    return settings(
        max_examples=count,
        deadline=None,
        database=None,
        phases=[Phase.generate, Phase.shrink],
        suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.filter_too_much],
    )
