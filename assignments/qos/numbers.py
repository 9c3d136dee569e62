"""Random numbers that are published to the subscriber, so that students cannot know them."""

from __future__ import annotations

import random


def numbers(seed: int) -> list[dict[str, int]]:
    """Fourteen numbers of six digits, all different."""
    return [{"data": value} for value in random.Random(seed).sample(range(100_000, 1_000_000), 14)]
