#include <algorithm>
#include <cmath>
#include <deque>
#include <optional>
#include <utility>

#include "geometry_msgs/msg/twist.hpp"
#include "rclcpp/rclcpp.hpp"
#include "turtlesim/msg/pose.hpp"
#include "turtlesim/srv/set_pen.hpp"

constexpr double SIDE = 2.0;
constexpr double NEAR = 0.02;
constexpr double STRAIGHT = 0.01;
constexpr double GAIN = 2.0;
constexpr double LEAST_SPEED = 0.1;
constexpr double MOST_SPEED = 1.5;

/// The same angle from -pi to pi.
double wrap(double angle)
{
  return std::atan2(std::sin(angle), std::cos(angle));
}

/// A speed for an error: proportional, neither too slow nor too fast.
double limited(double error)
{
  return std::copysign(std::clamp(std::abs(GAIN * error), LEAST_SPEED, MOST_SPEED), error);
}

/// Drives from corner to corner.
class TurtleSquare : public rclcpp::Node
{
public:
  TurtleSquare()
  : Node("turtle_square")
  {
    publisher_ = create_publisher<geometry_msgs::msg::Twist>("/turtle1/cmd_vel", 10);
    client_ = create_client<turtlesim::srv::SetPen>("/turtle1/set_pen");
    client_->wait_for_service();
    auto pen = std::make_shared<turtlesim::srv::SetPen::Request>();
    pen->r = 255;
    pen->width = 5;
    client_->async_send_request(
      pen, [this](rclcpp::Client<turtlesim::srv::SetPen>::SharedFuture) {is_red_ = true;});
    subscription_ = create_subscription<turtlesim::msg::Pose>(
      "/turtle1/pose", 10, [this](turtlesim::msg::Pose::ConstSharedPtr pose) {move(*pose);});
  }

private:
  /// Go on to the next corner.
  void move(const turtlesim::msg::Pose & pose)
  {
    if (!is_red_) {
      return;
    }
    if (!corners_) {
      const double x = pose.x, y = pose.y;
      corners_ = {{x + SIDE, y}, {x + SIDE, y + SIDE}, {x, y + SIDE}, {x, y}};
    }
    geometry_msgs::msg::Twist command;
    if (!corners_->empty()) {
      steer(command, pose);
    }
    publisher_->publish(command);
  }

  /// Turn to the corner on the spot, then drive there.
  void steer(geometry_msgs::msg::Twist & command, const turtlesim::msg::Pose & pose)
  {
    const double dx = corners_->front().first - pose.x, dy = corners_->front().second - pose.y;
    const double distance = std::hypot(dx, dy);
    const double error = wrap(std::atan2(dy, dx) - pose.theta);
    if (!is_driving_ && std::abs(error) > STRAIGHT) {
      command.angular.z = limited(error);
    } else if (distance > NEAR && std::abs(error) < M_PI / 2) {
      is_driving_ = true;
      command.linear.x = limited(distance);
    } else {
      is_driving_ = false;
      corners_->pop_front();
    }
  }

  std::optional<std::deque<std::pair<double, double>>> corners_;
  bool is_driving_ = false;
  bool is_red_ = false;
  rclcpp::Publisher<geometry_msgs::msg::Twist>::SharedPtr publisher_;
  rclcpp::Client<turtlesim::srv::SetPen>::SharedPtr client_;
  rclcpp::Subscription<turtlesim::msg::Pose>::SharedPtr subscription_;
};

int main(int argc, char * argv[])
{
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<TurtleSquare>());
  rclcpp::shutdown();
  return 0;
}
