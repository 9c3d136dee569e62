"""A node that publishes a speed, controlled by parameters."""

from __future__ import annotations

import rclpy
from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor, SetParametersResult
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import Float64


class SpeedPublisher(Node):
    """Publishes the parameter speed on /speed, every period seconds."""

    def __init__(self) -> None:
        """Declare the parameters and create the publisher and its timer."""
        super().__init__('speed_publisher')
        limits = FloatingPointRange(from_value=0.0, to_value=1.0, step=0.0)
        self.declare_parameter(
            'speed',
            0.25,
            ParameterDescriptor(description='Speed in m/s.', floating_point_range=[limits]),
        )
        self.declare_parameter('period', 0.1, ParameterDescriptor(description='Period in s.'))
        self.declare_parameter('robot', 'burger', ParameterDescriptor(read_only=True))
        self.add_on_set_parameters_callback(self.check)
        self.add_post_set_parameters_callback(self.apply)
        self.publisher = self.create_publisher(Float64, 'speed', 10)
        self.timer = self.create_timer(self.get_parameter('period').value, self.publish)

    def check(self, parameters: list[Parameter]) -> SetParametersResult:
        """Refuse a period that is not positive."""
        for parameter in parameters:
            if parameter.name == 'period' and parameter.value <= 0.0:
                return SetParametersResult(successful=False, reason='the period must be positive')
        return SetParametersResult(successful=True)

    def apply(self, parameters: list[Parameter]) -> None:
        """Start a timer with the new period."""
        for parameter in parameters:
            if parameter.name == 'period':
                self.destroy_timer(self.timer)
                self.timer = self.create_timer(parameter.value, self.publish)

    def publish(self) -> None:
        """Publish the speed, and log it once a second."""
        message = Float64(data=self.get_parameter('speed').value)
        self.publisher.publish(message)
        self.get_logger().info(f'speed: {message.data:.2f} m/s', throttle_duration_sec=1.0)


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    rclpy.init(args=args)
    node = SpeedPublisher()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
