"""Images of ROS as arrays of numpy, and back."""

from .core import CvBridge, CvBridgeError

__all__ = ["CvBridge", "CvBridgeError"]
