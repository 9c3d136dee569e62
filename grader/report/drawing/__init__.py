"""Drawings of a run as SVG."""
