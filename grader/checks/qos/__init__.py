"""Checks of QoS profiles."""
