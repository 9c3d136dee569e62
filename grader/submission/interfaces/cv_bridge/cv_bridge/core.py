"""CvBridge: what students call to get an array of numpy out of an image of ROS, and back.

Pictures in JPEG need OpenCV (`cv2`), which an assignment may allow; PNG does not.
"""

import re
import struct
import sys
import zlib

import numpy as np
from sensor_msgs.msg import CompressedImage, Image

_NAMED = {
    "rgb8": ("uint8", 3),
    "bgr8": ("uint8", 3),
    "rgba8": ("uint8", 4),
    "bgra8": ("uint8", 4),
    "mono8": ("uint8", 1),
    "mono16": ("uint16", 1),
}
_TYPES = {"U": "uint", "S": "int", "F": "float"}
_ORDERS = {"rgb8": "rgb", "bgr8": "bgr", "rgba8": "rgba", "bgra8": "bgra", "mono8": "m"}
_SIGNATURE = b"\x89PNG\r\n\x1a\n"


class CvBridgeError(TypeError):
    """An image cannot be converted."""


class CvBridge:
    """Converts between messages of sensor_msgs and arrays of numpy, as OpenCV has them."""

    def encoding_to_dtype_with_channels(self, encoding):
        """The type and the number of channels of an encoding such as bgr8 or 32FC1."""
        if encoding in _NAMED:
            return _NAMED[encoding]
        parts = re.fullmatch(r"(8|16|32|64)([USF])C(\d*)", encoding)
        if not parts:
            raise CvBridgeError(f"Unrecognized image encoding [{encoding}]")
        return _TYPES[parts[2]] + parts[1], int(parts[3] or 1)

    def imgmsg_to_cv2(self, img_msg, desired_encoding="passthrough"):
        """An array of shape (height, width) or (height, width, channels) from an Image."""
        kind, channels = self.encoding_to_dtype_with_channels(img_msg.encoding)
        dtype = np.dtype(kind).newbyteorder(">" if img_msg.is_bigendian else "<")
        rows = np.frombuffer(img_msg.data, np.uint8).reshape(img_msg.height, img_msg.step)
        packed = np.ascontiguousarray(rows[:, : img_msg.width * channels * dtype.itemsize])
        shape = (img_msg.height, img_msg.width, channels)
        found = packed.view(dtype).reshape(shape if channels > 1 else shape[:2])
        return _converted(found.astype(kind), img_msg.encoding, desired_encoding)

    def cv2_to_imgmsg(self, cvim, encoding="passthrough", header=None):
        """An Image from an array; its encoding is only a name for what the array holds."""
        if not isinstance(cvim, np.ndarray):
            raise TypeError("Your input type is not a numpy array")
        channels = cvim.shape[2] if cvim.ndim > 2 else 1
        own = f"{cvim.dtype.itemsize * 8}{cvim.dtype.kind.upper().replace('I', 'S')}C{channels}"
        if encoding == "passthrough":
            encoding = own
        elif self.encoding_to_dtype_with_channels(encoding) != (cvim.dtype.name, channels):
            raise CvBridgeError(f"encoding specified as {encoding}, but image has type {own}")
        message = Image(height=cvim.shape[0], width=cvim.shape[1], encoding=encoding)
        message.step = cvim.shape[1] * channels * cvim.dtype.itemsize
        message.is_bigendian = int(sys.byteorder == "big")
        message.data.frombytes(np.ascontiguousarray(cvim).tobytes())
        if header is not None:
            message.header = header
        return message

    def compressed_imgmsg_to_cv2(self, cmprs_img_msg, desired_encoding="passthrough"):
        """An array from a CompressedImage: blue, green, red, as OpenCV reads it."""
        data = bytes(cmprs_img_msg.data)
        if data.startswith(_SIGNATURE):
            return _converted(_png_read(data), "bgr8", desired_encoding)
        found = _opencv().imdecode(np.frombuffer(data, np.uint8), -1)
        return _converted(found, "bgr8" if found.ndim > 2 else "mono8", desired_encoding)

    def cv2_to_compressed_imgmsg(self, cvim, dst_format="jpg"):
        """A CompressedImage from an array of blue, green and red."""
        message = CompressedImage(format=dst_format)
        if dst_format == "png" and cvim.dtype == np.uint8 and cvim.ndim == 3:
            message.data.frombytes(_png(cvim[..., ::-1]))
        else:
            message.data.frombytes(_opencv().imencode(f".{dst_format}", cvim)[1].tobytes())
        return message


def _converted(found, encoding, desired):
    """The array in another encoding: other orders of the colours, or grey."""
    if desired in ("passthrough", encoding):
        return found
    if encoding not in _ORDERS or desired not in _ORDERS:
        raise CvBridgeError(f"cannot convert from {encoding} to {desired}")
    planes = dict(zip(_ORDERS[encoding], np.moveaxis(np.atleast_3d(found), 2, 0), strict=True))
    if desired == "mono8":
        red, green, blue = (planes[name].astype(np.uint32) for name in "rgb")
        # As OpenCV weights them.
        return ((4899 * red + 9617 * green + 1868 * blue + 8192) >> 14).astype(np.uint8)
    grey = planes.get("m")
    white = np.full(found.shape[:2], 255, np.uint8)
    planes = {"a": white, **(planes if grey is None else dict.fromkeys("rgb", grey))}
    return np.stack([planes[name] for name in _ORDERS[desired]], axis=2)


def _opencv():
    try:
        import cv2
    except ImportError as error:
        raise CvBridgeError("this format needs OpenCV; PNG does not") from error
    return cv2


def _png(picture):
    """Red, green and blue as a PNG."""
    height, width, _ = picture.shape
    rows = np.zeros((height, 1 + 3 * width), np.uint8)
    rows[:, 1:] = picture.reshape(height, 3 * width)
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    parts = ((b"IHDR", header), (b"IDAT", zlib.compress(rows.tobytes())), (b"IEND", b""))
    return _SIGNATURE + b"".join(_chunk(kind, data) for kind, data in parts)


def _chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def _png_read(data):
    """Blue, green and red of a PNG as rosgrade's camera and this module write it."""
    at, chunks = len(_SIGNATURE), {b"IDAT": b""}
    while at < len(data):
        size, kind = struct.unpack(">I4s", data[at : at + 8])
        chunks[kind] = chunks.get(kind, b"") + data[at + 8 : at + 8 + size]
        at += 12 + size
    width, height, *form = struct.unpack(">IIBBBBB", chunks[b"IHDR"])
    if form == [8, 2, 0, 0, 0]:
        rows = np.frombuffer(zlib.decompress(chunks[b"IDAT"]), np.uint8)
        filters, pixels = np.split(rows.reshape(height, 1 + 3 * width), [1], axis=1)
        if (filters == 2).all():
            pixels = np.cumsum(pixels, axis=0, dtype=np.uint8)
        if (filters == filters[0]).all() and filters[0, 0] in (0, 2):
            return pixels.reshape(height, width, 3)[..., ::-1]
    return _opencv().imdecode(np.frombuffer(data, np.uint8), -1)
