#include <algorithm>
#include <cmath>
#include <deque>
#include <memory>

#include <geometry_msgs/msg/twist.hpp>
#include <nav_msgs/msg/odometry.hpp>
#include <rclcpp/rclcpp.hpp>
#include <waypoint_msgs/msg/waypoint.hpp>

using geometry_msgs::msg::Twist;
using nav_msgs::msg::Odometry;
using waypoint_msgs::msg::Waypoint;

constexpr double LINEAR_GAIN = 1.0;
constexpr double ANGULAR_GAIN = 2.0;
constexpr double MAX_LINEAR_M_S = 0.2;
constexpr double MAX_ANGULAR_RAD_S = 1.5;
constexpr double AHEAD_RAD = 0.3;
constexpr double HEADING_RAD = 0.05;

/// The heading of an orientation, in rad from -pi to pi.
double yaw_of(const geometry_msgs::msg::Quaternion & q) {
  return std::atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z));
}

/// The same angle in the range from -pi to pi.
double wrap(double angle) { return std::atan2(std::sin(angle), std::cos(angle)); }

/// The rate of turn for a heading error.
double turning(double error) {
  return std::clamp(ANGULAR_GAIN * error, -MAX_ANGULAR_RAD_S, MAX_ANGULAR_RAD_S);
}

/// Drives to the waypoints in the order in which they come.
class WaypointFollower : public rclcpp::Node {
 public:
  WaypointFollower() : Node("waypoint_follower") {
    publisher_ = create_publisher<Twist>("/cmd_vel", 10);
    reached_ = create_publisher<Waypoint>("/reached", 10);
    waypoint_subscription_ = create_subscription<Waypoint>(
      "/waypoints", 10, [this](const Waypoint & waypoint) { waypoints_.push_back(waypoint); });
    odometry_subscription_ = create_subscription<Odometry>(
      "/odom", 10, [this](const Odometry & odometry) { take_odometry(odometry); });
  }

 private:
  /// Steers to the first waypoint that is left; without one, stands.
  void take_odometry(const Odometry & odometry) {
    Twist command;
    if (!waypoints_.empty()) {
      steer(command, odometry);
    }
    publisher_->publish(command);
  }

  /// Fills in the command: first drive to the waypoint, then turn to its heading.
  void steer(Twist & command, const Odometry & odometry) {
    const Waypoint waypoint = waypoints_.front();
    const auto & position = odometry.pose.pose.position;
    const double yaw = yaw_of(odometry.pose.pose.orientation);
    const double dx = waypoint.x - position.x;
    const double dy = waypoint.y - position.y;
    const double distance = std::hypot(dx, dy);
    if (distance <= waypoint.tolerance) {
      is_there_ = true;
    }
    if (!is_there_) {
      const double error = wrap(std::atan2(dy, dx) - yaw);
      command.angular.z = turning(error);
      if (std::abs(error) < AHEAD_RAD) {
        command.linear.x = std::min(MAX_LINEAR_M_S, LINEAR_GAIN * distance);
      }
      return;
    }
    const double error = wrap(waypoint.theta - yaw);
    if (std::abs(error) > HEADING_RAD) {
      command.angular.z = turning(error);
      return;
    }
    reached_->publish(waypoint);
    waypoints_.pop_front();
    is_there_ = false;
  }

  std::deque<Waypoint> waypoints_;
  bool is_there_ = false;
  rclcpp::Publisher<Twist>::SharedPtr publisher_;
  rclcpp::Publisher<Waypoint>::SharedPtr reached_;
  rclcpp::Subscription<Waypoint>::SharedPtr waypoint_subscription_;
  rclcpp::Subscription<Odometry>::SharedPtr odometry_subscription_;
};

/// Runs the node until Ctrl+C.
int main(int argc, char ** argv) {
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<WaypointFollower>());
  rclcpp::shutdown();
  return 0;
}
