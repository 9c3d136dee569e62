// A node that publishes the state of the robot in a message of its own type.

#include <cmath>
#include <functional>
#include <memory>

#include "enpm702_msgs/msg/bot_status.hpp"
#include "nav_msgs/msg/odometry.hpp"
#include "rclcpp/rclcpp.hpp"

using enpm702_msgs::msg::BotStatus;
using nav_msgs::msg::Odometry;

// Return the rotation of a quaternion about the z axis, in radians.
double yaw_of(const geometry_msgs::msg::Quaternion & q)
{
  return std::atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z));
}

// Makes a BotStatus of every odometry message.
class InterfaceDemo : public rclcpp::Node
{
public:
  InterfaceDemo()
  : Node("interface_demo")
  {
    this->declare_parameter("model", static_cast<int>(BotStatus::BURGER));
    publisher_ = this->create_publisher<BotStatus>("/interface_demo", 10);
    subscription_ = this->create_subscription<Odometry>(
      "/odom", 10, std::bind(&InterfaceDemo::odom_callback, this, std::placeholders::_1));
  }

private:
  // Publish the state of the robot.
  void odom_callback(const Odometry & odometry)
  {
    const auto & pose = odometry.pose.pose;
    const auto & twist = odometry.twist.twist;
    BotStatus status;
    status.model = this->get_parameter("model").as_int();
    status.pose.x = pose.position.x;
    status.pose.y = pose.position.y;
    status.pose.theta = yaw_of(pose.orientation);
    status.velocities = {twist.linear.x, twist.angular.z};
    publisher_->publish(status);
  }

  rclcpp::Publisher<BotStatus>::SharedPtr publisher_;
  rclcpp::Subscription<Odometry>::SharedPtr subscription_;
};

int main(int argc, char * argv[])
{
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<InterfaceDemo>());
  rclcpp::shutdown();
  return 0;
}
