#include "p_controller_demo/p_controller.hpp"

#include <algorithm>
#include <cmath>
#include <functional>

namespace
{
constexpr double LINEAR_GAIN = 0.6;   // m/s for each m
constexpr double ANGULAR_GAIN = 1.5;  // rad/s for each rad
constexpr double MAX_LINEAR = 0.22;   // m/s
constexpr double MAX_ANGULAR = 2.84;  // rad/s

// The heading of an orientation, in rad from -pi to pi.
double yaw_of(const geometry_msgs::msg::Quaternion & q)
{
  return std::atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z));
}

// The same angle in the range from -pi to pi.
double wrap(double angle)
{
  return std::atan2(std::sin(angle), std::cos(angle));
}
}  // namespace

PController::PController()
: Node("p_controller_demo")
{
  goal_x_ = this->declare_parameter("goal_x", 1.0);
  goal_y_ = this->declare_parameter("goal_y", 0.0);
  goal_theta_ = this->declare_parameter("goal_theta", 0.0);
  goal_tolerance_ = this->declare_parameter("goal_tolerance", 0.05);
  angle_tolerance_ = this->declare_parameter("angle_tolerance", 0.05);
  publisher_ = this->create_publisher<geometry_msgs::msg::Twist>("/cmd_vel", 10);
  subscription_ = this->create_subscription<nav_msgs::msg::Odometry>(
    "/odom", 10, std::bind(&PController::odom_callback, this, std::placeholders::_1));
}

void PController::odom_callback(const nav_msgs::msg::Odometry & odometry)
{
  const auto & position = odometry.pose.pose.position;
  const double yaw = yaw_of(odometry.pose.pose.orientation);
  const double dx = goal_x_ - position.x;
  const double dy = goal_y_ - position.y;
  const double distance = std::hypot(dx, dy);

  geometry_msgs::msg::Twist command;
  if (!arrived_ && distance > goal_tolerance_) {
    const double heading_error = wrap(std::atan2(dy, dx) - yaw);
    command.linear.x = std::min(LINEAR_GAIN * distance, MAX_LINEAR);
    command.angular.z = std::clamp(ANGULAR_GAIN * heading_error, -MAX_ANGULAR, MAX_ANGULAR);
  } else {
    arrived_ = true;
    const double theta_error = wrap(goal_theta_ - yaw);
    if (std::abs(theta_error) > angle_tolerance_) {
      command.angular.z = std::clamp(ANGULAR_GAIN * theta_error, -MAX_ANGULAR, MAX_ANGULAR);
    }
  }
  publisher_->publish(command);
}
