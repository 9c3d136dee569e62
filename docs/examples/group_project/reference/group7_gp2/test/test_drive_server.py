"""Tests of the server."""

from group7_gp2.drive_server import is_possible


def test_a_distance_ahead_is_possible() -> None:
    """A robot can drive 1 m ahead."""
    assert is_possible(1.0)


def test_a_distance_backwards_is_not_possible() -> None:
    """A robot cannot drive backwards."""
    assert not is_possible(-0.5)
