// A node that listens to the robot's odometry and to its LiDAR.

#include <functional>
#include <memory>

#include "nav_msgs/msg/odometry.hpp"
#include "rclcpp/rclcpp.hpp"
#include "sensor_msgs/msg/laser_scan.hpp"

using std::placeholders::_1;

// Logs the robot's position and the distance to the obstacle ahead.
class BotSubscriber : public rclcpp::Node
{
public:
  BotSubscriber()
  : Node("bot_subscriber")
  {
    odom_subscription_ = this->create_subscription<nav_msgs::msg::Odometry>(
      "/odom", 10, std::bind(&BotSubscriber::odom_callback, this, _1));
    scan_subscription_ = this->create_subscription<sensor_msgs::msg::LaserScan>(
      "/scan", 10, std::bind(&BotSubscriber::scan_callback, this, _1));
  }

private:
  // Log where the robot is, in metres.
  void odom_callback(const nav_msgs::msg::Odometry::SharedPtr message)
  {
    const auto & position = message->pose.pose.position;
    RCLCPP_INFO(this->get_logger(), "Position: x = %.2f, y = %.2f", position.x, position.y);
  }

  // Log the front range: beam 0 looks straight ahead.
  void scan_callback(const sensor_msgs::msg::LaserScan::SharedPtr message)
  {
    RCLCPP_INFO(this->get_logger(), "Front range: %.2f", message->ranges[0]);
  }

  rclcpp::Subscription<nav_msgs::msg::Odometry>::SharedPtr odom_subscription_;
  rclcpp::Subscription<sensor_msgs::msg::LaserScan>::SharedPtr scan_subscription_;
};

int main(int argc, char * argv[])
{
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<BotSubscriber>());
  rclcpp::shutdown();
  return 0;
}
