"""A node that takes calibrations of a camera, if they make sense."""

from __future__ import annotations

import time

import rclpy
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor
from rclpy.node import Node
from sensor_msgs.srv import SetCameraInfo

WRITING_S = 0.4
READING_S = 0.05


class CameraServer(Node):
    """Offers /set_camera_info."""

    def __init__(self) -> None:
        """Create the service and the timer."""
        super().__init__('camera_server')
        self.service = self.create_service(
            SetCameraInfo,
            'set_camera_info',
            self.set_camera_info,
            callback_group=ReentrantCallbackGroup(),
        )
        self.timer = self.create_timer(0.1, self.read_temperature)

    def read_temperature(self) -> None:
        """Read the camera's temperature."""
        time.sleep(READING_S)

    def set_camera_info(
        self, request: SetCameraInfo.Request, response: SetCameraInfo.Response
    ) -> SetCameraInfo.Response:
        """Refuse a calibration that makes no sense; write any other one to the camera."""
        info = request.camera_info
        problem = ''
        if info.width == 0 or info.height == 0:
            problem = 'the size of the image is zero'
        elif info.k[0] <= 0.0 or info.k[4] <= 0.0:
            problem = 'the focal length must be positive'
        if problem:
            self.get_logger().warning(f'calibration refused: {problem}')
        else:
            time.sleep(WRITING_S)
            self.get_logger().info('calibration accepted')
        response.success = not problem
        response.status_message = problem or 'written'
        return response


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    rclpy.init(args=args)
    node = CameraServer()
    executor = MultiThreadedExecutor(num_threads=4)
    executor.add_node(node)
    try:
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
