#include <chrono>

#include <geometry_msgs/msg/twist.h>
#include <sensor_msgs/msg/laser_scan.h>

#include "rcl_node.hpp"

class BotController : public Node
{
public:
  BotController(int argc, char ** argv)
  : Node(argc, argv, "bot_controller")
  {
    sensor_msgs__msg__LaserScan__init(&scan);
    publisher = create_publisher(
      ROSIDL_GET_MSG_TYPE_SUPPORT(geometry_msgs, msg, Twist), "/cmd_vel", 10);
    create_subscription(
      ROSIDL_GET_MSG_TYPE_SUPPORT(sensor_msgs, msg, LaserScan), "/scan", &scan,
      [this] {scan_callback();}, "BotController::scan_callback()", 10);
    create_wall_timer(100, [this] {watchdog_callback();}, "BotController::watchdog_callback()");
  }

  ~BotController() {sensor_msgs__msg__LaserScan__fini(&scan);}

private:
  using Clock = std::chrono::steady_clock;

  void scan_callback()
  {
    last_scan = Clock::now();
    const float front = scan.ranges.data[0];
    // A beam that met nothing reports inf, on the real robot 0.0.
    drive(front != 0.0F && front <= 0.2F ? 0.0 : 0.1);
  }

  void watchdog_callback()
  {
    if (last_scan != Clock::time_point() && Clock::now() - last_scan > std::chrono::seconds(1)) {
      drive(0.0);
    }
  }

  void drive(double speed)
  {
    geometry_msgs__msg__Twist message{};
    geometry_msgs__msg__Twist__init(&message);
    message.linear.x = speed;
    check(rcl_publish(publisher, &message, nullptr));
  }

  sensor_msgs__msg__LaserScan scan;
  rcl_publisher_t * publisher;
  Clock::time_point last_scan;
};

int main(int argc, char ** argv)
{
  BotController node(argc, argv);
  node.spin();
}
