#include <nav_msgs/msg/odometry.h>
#include <sensor_msgs/msg/laser_scan.h>

#include "rcl_node.hpp"

class BotSubscriber : public Node
{
public:
  BotSubscriber(int argc, char ** argv)
  : Node(argc, argv, "bot_subscriber")
  {
    nav_msgs__msg__Odometry__init(&odometry);
    sensor_msgs__msg__LaserScan__init(&scan);
    create_subscription(
      ROSIDL_GET_MSG_TYPE_SUPPORT(nav_msgs, msg, Odometry), "/odom", &odometry,
      [this] {odom_callback();}, "BotSubscriber::odom_callback()", 10);
    create_subscription(
      ROSIDL_GET_MSG_TYPE_SUPPORT(sensor_msgs, msg, LaserScan), "/scan", &scan,
      [this] {scan_callback();}, "BotSubscriber::scan_callback()", 10);
  }

  ~BotSubscriber()
  {
    nav_msgs__msg__Odometry__fini(&odometry);
    sensor_msgs__msg__LaserScan__fini(&scan);
  }

private:
  void odom_callback()
  {
    const auto & position = odometry.pose.pose.position;
    RCUTILS_LOG_INFO_NAMED("bot_subscriber", "Position: x = %.2f, y = %.2f", position.x, position.y);
  }

  void scan_callback()
  {
    RCUTILS_LOG_INFO_NAMED("bot_subscriber", "Front range: %.2f", scan.ranges.data[0]);
  }

  nav_msgs__msg__Odometry odometry;
  sensor_msgs__msg__LaserScan scan;
};

int main(int argc, char ** argv)
{
  BotSubscriber node(argc, argv);
  node.spin();
}
